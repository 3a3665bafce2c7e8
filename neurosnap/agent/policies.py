"""A factory of policies by name."""

from collections.abc import Iterable

from neurosnap.agent.body import Body
from neurosnap.agent.excited import Excited
from neurosnap.agent.experience import Experience
from neurosnap.agent.imagining_planner import ImaginingPlanner
from neurosnap.agent.planner import Planner
from neurosnap.agent.policy import EXPLORE, TRIES, AgentKind, Exploration, Policy
from neurosnap.agent.random_walk import Walker
from neurosnap.errors import InvalidValueError


def new_policy(
    kind: AgentKind,
    body: Body,
    seed: int,
    *,
    target: Iterable[str | int] = (),
    explore: Exploration = EXPLORE,
    imagine: int = 0,
    experience: Experience | None = None,
) -> Policy:
    """Return a policy.

    Args:
        kind: ``"walker"``, ``"excited"`` or ``"planner"``.
        body: What is sensed and done.
        seed: Draws whatever is random.
        target: For a planner: literals of the world's own, by name or number.
        explore: The share of random actions; a walker's are all random. Planned: a
            planner that imagines goes to the nearest action with an unknown outcome
            where it knows no way to its target. `TRIES` of its actions are random if it
            has none.
        imagine: For a planner: how many states it may imagine for a decision; 0: it
            looks one step ahead.
        experience: What a planner that imagines has to know.

    Raises:
        InvalidValueError: What is given does not go with the kind, or the body with it.
    """
    target = tuple(target)
    if kind != "planner" and target:
        # An excited agent's is a place, and its world's to know.
        who = "a planner or an excited agent" if kind == "walker" else "a planner only"
        raise InvalidValueError("target", f"must go with {who}", target)
    if kind != "planner" and imagine:
        raise InvalidValueError("imagine", "must go with a planner only", imagine)
    planned = explore == "planned"
    if planned and not (imagine and experience is not None):
        rule = "must go with a planner that imagines (such as imagine = 2000)"
        raise InvalidValueError("explore", rule, explore)
    share = (0.0 if target else TRIES) if explore == "planned" else explore
    match kind:
        case "walker":
            return Walker(len(body.choices), seed)
        case "excited":
            return Excited(body, seed, share)
        case "planner" if imagine and experience is not None:
            # Without growth most outcomes stay unknown in part: to look for them would
            # never end.
            curious = planned or not target or body.finds > 0
            return ImaginingPlanner(
                body, target, seed, share, experience, imagine, curious=curious
            )
        case "planner":
            return Planner(body, target, seed, share)
