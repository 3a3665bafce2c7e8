"""The policies by name: random walker, excitation-driven agent, planners.

The *walker* acts at random, and asks one planning wave a tick: what it asks, and what
it does, is drawn without regard to the answer.

The *excited* agent moves to better states, or at least not to worse ones. Its target is
one sensation, so it needs no plan: it takes an action that guarantees `better`; failing
that, one that guarantees `worse*`, now and then a random one; failing that, a random
one.

References:
    [GK] "Closing the Loop: Excitation-Driven Navigation".
"""

import math
from collections.abc import Iterable, Mapping
from typing import TypedDict, Unpack, get_args

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.imagining_planner import ImaginingPlanner
from neurosnap.agent.planner import Planner
from neurosnap.agent.policy import (
    EXPLORE,
    TRIES,
    AgentKind,
    Deliberation,
    Exploration,
    Policy,
    checked_share,
)
from neurosnap.agent.random_draws import RandomNumbers, pick
from neurosnap.errors import InvalidValueError, either, similar


class Walker:
    """A policy that chooses actions at random.

    Args:
        actions: How many there are; 0 for a source that takes none.
        seed: Draws the actions.
    """

    def __init__(self, actions: int, seed: int) -> None:
        self._actions = np.arange(actions)
        self._random = RandomNumbers(seed)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Ask what one sensation of the state implies, and act at random all the same.

        The sensation is drawn anew each tick: a wave that has to travel, where a state
        wave finds every cell fired already. Where the state is empty nothing is asked.
        """
        on, draws = np.flatnonzero(state), self._random.at(tick)
        if len(on):
            # A number of its own: what is asked must not change what is done.
            yield [(pick(on, draws[1]),)]
        if not self._actions.size:
            return -1, "the source takes no actions"
        return pick(self._actions, draws[0]), "random walk"

    def grow(self, body: Body) -> None:
        """Change nothing: a walker does not depend on its sensors."""


class Excited:
    """A policy that takes an action that certainly improves its state, if there is one.

    Args:
        body: Its sensors include `better` and `worse`.
        seed: Draws among equals, and when to explore.
        explore: The share of random actions where the best that can be guaranteed is
            `worse*`, in [0, 1].

    Raises:
        InvalidValueError: The body has no such sensors or no actions, or `explore` is
            out of range.
    """

    def __init__(self, body: Body, seed: int, explore: float = EXPLORE) -> None:
        self._actions = Actions(body)
        if not {"better", "worse"}.issubset(body.own):
            rule = "must have a world with the sensors better and worse"
            raise InvalidValueError("agent excited", rule, list(body.own))
        self._better = 2 * body.own.index("better")
        self._not_worse = 2 * body.own.index("worse") + 1
        self._explore = checked_share(explore)
        self._random = RandomNumbers(seed)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Ask for the consequences of every action, and take the best."""
        bound = guaranteed((yield self._actions.signals(state)))
        draws = self._random.at(tick)
        options = np.flatnonzero(bound[:, self._better])
        why = "guarantees better"
        if not options.size:
            options = np.flatnonzero(bound[:, self._not_worse])
            why = "guarantees worse*; nothing guarantees better"
            if not options.size:
                options = np.arange(len(bound))
                why = "at random: nothing guarantees better or worse*"
            elif draws[1] < self._explore:
                options = np.arange(len(bound))
                why = "at random, to explore; nothing guarantees better"
        return pick(options, draws[0]), why

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor."""
        self._actions = Actions(body)


class Aims(TypedDict, total=False):
    """The target of a policy, and how it explores."""

    target: Iterable[str | int]
    """For a planner: literals of the world's own, by name or number, to be achieved
    jointly. One that imagines may have none: it explores."""
    explore: Exploration
    """The share of random actions; a walker's are all random. ``"planned"``: a planner
    that imagines goes to the nearest action with an unknown outcome where it knows no
    way to its target. `TRIES` of its actions are random if it has none."""
    prefer: Mapping[str | int, float]
    """For a planner that imagines and grows sensors, instead of a target: what each of
    some literals is worth whenever it is sensed. It acts for most of it: what comes
    later is worth less, see `neurosnap.agent.chances.DISCOUNT`."""


def new_policy(
    kind: AgentKind,
    body: Body,
    seed: int,
    *,
    imagine: int = 0,
    experience: Experience | None = None,
    **aims: Unpack[Aims],
) -> Policy:
    """Return a policy.

    Args:
        kind: ``"walker"``, ``"excited"`` or ``"planner"``.
        body: What is sensed and done.
        seed: Draws whatever is random.
        imagine: For a planner: how many states it may imagine for a decision; 0: it
            looks one step ahead.
        experience: What a planner that imagines has to know.
        aims: Its target, and how it explores.

    Raises:
        InvalidValueError: What is given does not go with the kind, or the body with it.
    """
    if kind not in (kinds := get_args(AgentKind)):
        rule = f"must be {either(kinds)}{similar(kind, kinds)}"
        raise InvalidValueError("kind", rule, kind)
    target, explore = tuple(aims.get("target", ())), aims.get("explore", EXPLORE)
    prefers = aims.get("prefer", {})
    if kind != "planner" and target:
        # An excited agent's is a place, and its world's to know.
        who = "a planner or an excited agent" if kind == "walker" else "a planner only"
        raise InvalidValueError("target", f"must go with {who}", target)
    if prefers and not (kind == "planner" and imagine and experience is not None):
        rule = "must go with a planner that imagines (such as imagine = 2000)"
        raise InvalidValueError("prefer", rule, dict(prefers))
    if prefers and target:
        raise InvalidValueError("prefer", "must come without a target", target)
    if kind != "planner" and imagine:
        raise InvalidValueError("imagine", "must go with a planner only", imagine)
    planned = explore == "planned"
    if planned and not (imagine and experience is not None):
        rule = "must go with a planner that imagines (such as imagine = 2000)"
        raise InvalidValueError("explore", rule, explore)
    share = (0.0 if target else TRIES) if explore == "planned" else explore
    match kind:
        case "walker":
            return Walker(len(body.actions), seed)
        case "excited":
            return Excited(body, seed, share)
        case "planner" if imagine and experience is not None:
            # Without growth most outcomes stay unknown in part: to look for them would
            # never end.
            curious = planned or (not prefers and (not target or body.room > 0))
            given = seed, share, experience, imagine, curious
            return ImaginingPlanner(body, prefers or target, *given)
        case "planner":
            return Planner(body, target, seed, share)


def preferences(text: str) -> dict[str | int, float]:
    """Return what each of some literals is worth, as a text says it.

    Raises:
        InvalidValueError: A part is no name and a number with ``=`` between them, or a
            name is there twice.

    Examples:
        >>> preferences("tile=goal=1, tile=hole=-2.5")
        {'tile=goal': 1.0, 'tile=hole': -2.5}
    """
    worths: dict[str | int, float] = {}
    for part in text.split(",") if text.strip() else ():
        name, _, number = part.rpartition("=")
        try:
            worth = float(number)
        except ValueError:
            worth = math.nan
        if not (name := name.strip()) or math.isnan(worth) or name in worths:
            rule = "must be names with a number each, such as won=1,lost=-1"
            raise InvalidValueError("prefer", rule, text)
        worths[name] = worth
    return worths
