"""Greedy planning: finds the nearest target state, and an action towards it.

The subgoals are the projection of the state onto the target in the model space: what
would be sensed at the closest point of the target.

With an `Experience` it remembers as well where nothing led nearer to the target. Such a
place is *raised*: it seems farther away from then on, by as much as the best step from
there makes it, so that the agent is not stuck there for ever. That costs no wave more,
and is what an agent does that imagines no way to its target.

References:
    [GK] "Algorithm: Greedy Reactive Planning (GRP)"; lemma "Reasoning in Snapshots",
    which holds for a coherent target only: an incoherent one is reduced first. To get
    stuck is what it calls a failure of greedy planning to be overcome; to raise places
    is LRTA* (Korf 1990), with open subgoals as the distance to begin with.
"""

from collections.abc import Iterable, Mapping
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.policy import EXPLORE, Deliberation, checked_share
from neurosnap.agent.random_draws import RandomNumbers, pick
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import Sensorium, complement

_SHOWN = 4  # subgoals a reason names


class Planner:
    """A policy that plans greedily: one step ahead, toward the nearest subgoal.

    Subgoals are counted among the literals of the world's state sensors and those of
    the target: sensors of the agent's own action, and of the previous step, are no
    goals.

    Args:
        body: What is sensed and done.
        target: Literals by name or number, to be achieved jointly.
        seed: Draws among equals, and when to explore.
        explore: The share of random actions, in [0, 1].
        experience: Remembers which places were raised; if None, none is.

    Raises:
        InvalidValueError: There is no target, it names no literal of the world's own or
            one and its complement, the body has no actions, or `explore` is out of
            range.
    """

    def __init__(
        self,
        body: Body,
        target: Iterable[str | int],
        seed: int,
        explore: float = EXPLORE,
        experience: Experience | None = None,
    ) -> None:
        self._target = target_literals(body, target)
        self._explore = checked_share(explore)
        self._random = RandomNumbers(seed)
        self._experience = experience
        self.grow(body)

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor; it is no goal."""
        self._actions = Actions(body)
        self._sensorium = Sensorium(body.sensors)
        self._position = body.position
        self._goals = self._position.copy()
        self._goals[list(self._target)] = True

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Ask for the consequences of every action and of the target; take the best."""
        *closures, above = yield [*self._actions.signals(state), self._target]
        draws = self._random.at(tick)
        if draws[1] < self._explore:
            return pick(np.arange(len(closures)), draws[0]), "at random, to explore"
        wanted = subgoals(state & self._position, above) & self._goals
        bound = guaranteed(closures)
        met = bound & wanted
        score = met.sum(axis=1)
        if self._experience is not None:
            held = int((state & wanted).sum())
            score = self._raise(self._experience, score, bound, state, held)
        best = (score == score.max()).nonzero()[0]
        action = pick(best, draws[0])
        return action, self._why(met[action], wanted, len(best))

    def _raise(
        self,
        experience: Experience,
        met: NDArray[np.int_],
        bound: NDArray[np.bool_],
        state: NDArray[np.bool_],
        held: int,
    ) -> NDArray[np.int_]:
        """Return how good each action is, and raise the place if none leads nearer.

        Args:
            experience: Has the places that were raised.
            met: ``(actions,)``, how many subgoals each guarantees.
            bound: ``(actions, 2N)``, all that each guarantees.
            state: ``(2N,)``.
            held: How many subgoals the state has.
        """
        keys = [experience.key(after & experience.looked_at) for after in bound]
        raised = [experience.raised.get(key, 0) for key in keys]
        score: NDArray[np.int_] = met - np.array(raised)
        safe = np.array(
            [
                after[[*self._target]].all()
                or not experience.foresees_end(state, action, after)
                for action, after in enumerate(bound)
            ]
        )
        if safe.any():  # any of these before what ends the episode short of the target
            score[~safe] = score[safe].min() - 1
        here = experience.key(state & experience.looked_at)
        experience.lift(here, held + 1 - int(score.max()))
        return score

    def _why(
        self, met: NDArray[np.bool_], wanted: NDArray[np.bool_], equals: int
    ) -> str:
        achieved = met.nonzero()[0]
        if not achieved.size:
            return f"at random: nothing guarantees any of {wanted.sum()} subgoals"
        names = [self._sensorium.name(a) for a in achieved[:_SHOWN]]
        more = ", …" if achieved.size > _SHOWN else ""
        tie = f"; one of {equals} as good" if equals > 1 else ""
        return (
            f"guarantees {achieved.size} of {wanted.sum()} subgoals"
            f" ({', '.join(names)}{more}){tie}"
        )


def subgoals(state: NDArray[np.bool_], above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the projection of a state onto a target: ``(2N,)``.

    That is ``coh(T)`` propagated over the graph loaded with ``S``, both being closed
    upwards: their union without ``coh(T)*`` ([GK] lemma "Reasoning in Snapshots").

    Args:
        state: ``(2N,)``, coherent and closed upwards.
        above: ``(2N,)``, ``↑T``.
    """
    reduced = above & ~complement(above)
    return (state | reduced) & ~complement(reduced)


def target_literals(body: Body, target: Iterable[str | int]) -> tuple[int, ...]:
    """Return the literals of a target, ascending.

    Raises:
        InvalidValueError: It is empty, names something that is neither a literal of the
            world's own sensors nor a latch or a clone that was grown, or holds a
            literal and its complement.
    """
    if isinstance(target, str):
        raise InvalidValueError("target", "must be several, not one string", target)
    sensorium = Sensorium(body.own)
    literals = set()
    carried = {2 * k + off for k in body.carries for off in (0, 1)}
    names = {Sensorium(body.sensors).name(literal): literal for literal in carried}
    for wanted in target:
        literal = names.get(wanted) if isinstance(wanted, str) else wanted
        if literal is None:
            literal = sensorium.literal(str(wanted))
        if literal not in carried:
            sensorium.name(literal)
        literals.add(int(literal))
    if not literals:
        raise InvalidValueError("target", "must name a sensation to achieve", "nothing")
    for literal in literals:
        if literal ^ 1 in literals:
            rule = "must not hold a literal and its complement"
            raise InvalidValueError("target", rule, sensorium.name(literal & ~1))
    return tuple(sorted(literals))


def weighed_literals(
    body: Body, prefers: Mapping[str | int, float]
) -> dict[int, float]:
    """Return what literals are worth, by number, ascending.

    Raises:
        InvalidValueError: A weight is not finite, or what is named no target.
    """
    for name, weight in prefers.items():
        if not isfinite(weight):
            rule = "must have finite weights"
            raise InvalidValueError("prefer", rule, f"{name}={weight}")
    numbers = [target_literals(body, [name])[0] for name in prefers]
    both = dict(zip(numbers, map(float, prefers.values()), strict=True))
    return dict(sorted(both.items()))
