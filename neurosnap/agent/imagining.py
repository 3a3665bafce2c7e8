"""Planning by imagined waves: what each action leads to, and then what next.

From an imagined state the consequences of every action are asked for, a round of waves
for all states that are as many steps away. What an action guarantees is the next
imagined state. The first that has all of the target gives the shortest plan there is in
what has been learned. It is kept until something comes that it did not expect.

An action can be imagined where each of its contexts has been met: of a context that
never was, nothing has been learned, though it may seem to imply a lot.

What is left to chance cannot be learned, nor gone to. Where an action slips, one with a
target takes neither its outcome, nor what is done after it, for unknown. And where no
plan leads to the target, luck may: it goes on greedily and begins no other episode.

References:
    Not the paper's, whose planner looks one step ahead ([GK] "Algorithm: Greedy
    Reactive Planning") and names "replanning in the face of failure" as future work.
    To go where an outcome is unknown is the exploration of R-max (Brafman & Tennenholtz
    2002). Of its table there is which action was taken where, and that serves only to
    test what seems to be known, where most surprises are to be expected (Schmidhuber
    1991, "Curious model-building control systems").
"""

from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.contexts import Contexts
from neurosnap.agent.experience import Experience, Plan
from neurosnap.agent.plan_reason import plan_reason
from neurosnap.agent.planner import target_literals
from neurosnap.agent.policy import (
    Closures,
    Deliberation,
    Signal,
    checked_share,
)
from neurosnap.agent.random_numbers import RandomNumbers, pick
from neurosnap.agent.reflex import Reflex
from neurosnap.agent.surprises import BEGINNING
from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import complement

STATES: Final = 2000
"""Imagined states a decision may take, unless another number is given."""
_Search = Generator[list[Signal], Closures, "Plan | None"]


@dataclass(frozen=True, slots=True)
class _Node:
    """An imagined state and how it is reached."""

    state: NDArray[np.bool_]
    before: "_Node | None" = None
    action: int = -1
    steps: int = 0
    """How many actions led to it."""
    by_chance: bool = False
    """Whether it, or one on the way, is left to chance in part."""

    def way(self) -> list["_Node"]:
        """Return the nodes from the first, which no action led to, to this one."""
        nodes: list[_Node] = []
        node: _Node | None = self
        while node is not None:
            nodes.append(node)
            node = node.before
        return nodes[::-1]


class ImaginingPlanner:
    """Plans by imagined waves; where that leads nowhere, greedily, as `Reflex` does.

    Args:
        body: What is sensed and done; its actions exclude each other.
        target: Literals to be achieved jointly; none: to explore is all there is to do.
        seed: Draws among equals, and when to act at random.
        explore: The share of random actions, in [0, 1].
        experience: What was met so far; whoever decides by this keeps it up to date.
        states: How many states a decision may imagine.
        curious: Whether to go to the nearest action with an unknown outcome where no
            plan leads to the target, unless what it does there is left to chance.

    Raises:
        InvalidValueError: As for `Planner`; or the actions do not exclude each other,
            or there is neither a target nor curiosity.
    """

    def __init__(
        self,
        body: Body,
        target: Iterable[str | int],
        seed: int,
        explore: float,
        experience: Experience,
        states: int = STATES,
        curious: bool = False,
    ) -> None:
        if not body.exclusive:
            rule = "must come with actions that exclude each other"
            raise InvalidValueError("imagine", rule, body.actions)
        if states < 1:
            raise InvalidValueError("imagine", "must be 1 or more", states)
        wanted = tuple(target)
        if not wanted and not curious:
            rule = "must name a sensation to achieve, or come with exploration"
            raise InvalidValueError("target", rule, "nothing")
        self._reflex = Reflex(body, wanted, seed, experience) if wanted else None
        self._target = list(target_literals(body, wanted)) if wanted else []
        self._explore = checked_share(explore)
        self._random = RandomNumbers(seed)
        self._experience = experience
        self._states = states
        self._curious = curious
        self._own = len(body.own)
        self._names = body.actions
        experience.aim()
        self._fit(body)

    def _fit(self, body: Body) -> None:
        self._actions = Actions(body)
        self._contexts = Contexts(body)
        self._looked_at = body.looked_at
        self._first = 2 * (self._own + len(body.actions))  # contextual literal

    def grow(self, body: Body) -> None:
        """Go on with a body that has grown, or retired, a sensor; the plan is kept."""
        self._fit(body)
        if self._reflex is not None:
            self._reflex.grow(body)

    def decide(self, tick: int, state: NDArray[np.bool_]) -> Deliberation:
        """Follow the plan, or ask for the consequences of actions until there is one.

        Args:
            tick: The tick whose state is known.
            state: ``(2N,)``, the coherent state.
        """
        draws, known = self._random.at(tick), self._experience
        if draws[1] < self._explore:
            known.plan = None
            return pick(np.arange(len(self._names)), draws[0]), "at random, to explore"
        here = state & self._looked_at
        if known.plan is None or not known.plan.goes_on(here):
            known.plan = yield from self._search(here, draws[0])
        if known.plan is not None:
            why = plan_reason(known.plan, self._names)
            action, known.plan = known.plan.step()
            return action, why
        if self._reflex is not None:
            return (yield from self._reflex.decide(tick, state))
        return pick(np.arange(len(self._names)), draws[0]), "at random"

    def _search(self, here: NDArray[np.bool_], draw: float) -> _Search:
        """Imagine, all states of one distance at a time, until the target is met.

        Returns:
            The shortest plan. If there is none and the planner is curious, that to the
            nearest unknown outcome; if nothing is unknown, and nothing left to chance,
            to the nearest end of an episode: the next may begin elsewhere. One who only
            explores goes there or to test an outcome that seems to be known and was
            never seen, whichever gives most surprises a step, as far as one can tell:
            what was learned is only as true as what was met. None: there is nothing of
            this.
        """
        told = self._experience
        frontier, seen, left = [_Node(here)], {here.tobytes()}, self._states
        met = told.met
        always = met & ~complement(met)  # a sensor that never changed
        unknown: list[tuple[_Node, int]] = []
        known: list[tuple[_Node, int]] = []
        end: _Node | None = None  # the nearest
        chance = False  # whether some place on the way is left to it
        while frontier and not (unknown and not self._target):
            asked: list[tuple[_Node, int]] = []
            signals: list[Signal] = []
            doubtful: list[tuple[_Node, int]] = []
            for node in frontier:
                # Where it is now an action is due in any case.
                if node.before is not None and told.is_end(node.state, node.action):
                    end = end or node
                    continue
                possible = self._imaginable(node.state)
                for action, signal in enumerate(self._actions.signals(node.state)):
                    if possible[action]:
                        asked.append((node, action))
                        signals.append(signal)
                    elif not node.by_chance:
                        doubtful.append((node, action))
            closures = (yield signals) if signals else ()
            frontier = []
            for (node, action), bound in zip(asked, _bound(closures), strict=True):
                state = bound | always
                if self._target and state[self._target].all():
                    return self._planned(_Node(state, node, action), "")
                place = state & self._looked_at
                # One who only explores tests what seems to be known all the same.
                by_chance = bool(self._target) and (
                    node.by_chance or told.by_chance(place, action)
                )
                if by_chance:
                    chance = True
                elif not told.is_whole(place, action):
                    doubtful.append((node, action))
                else:
                    known.append((node, action))
                key = place.tobytes()
                if key not in seen and len(frontier) < left:
                    seen.add(key)
                    steps = node.steps + 1
                    frontier.append(_Node(place, node, action, steps, by_chance))
            left -= len(frontier)
            unknown = unknown or doubtful
        if not self._curious:
            return None
        nothing = np.zeros_like(here)
        if unknown:
            node, action = unknown[int(draw * len(unknown))]
            why = f"to learn what {self._names[action]} does there, "
            return self._planned(_Node(nothing, node, action), why)
        if not self._target:
            test, hope = self._test(known)
            if test is None:  # all was seen: see any of it again
                half, draw = divmod(2 * draw, 1.0)
                test, hope = known[int(draw * len(known))], 1.0 - half
            if end is None or hope >= self._hope(end, BEGINNING):
                node, action = test
                why = f"to test what {self._names[action]} does there, "
                return self._planned(_Node(nothing, node, action), why)
        if end is not None and not chance:
            action = int(draw * len(self._names))
            why = "to begin another episode, "
            return self._planned(_Node(nothing, end, action), why)
        return None

    def _test(
        self, known: list[tuple[_Node, int]]
    ) -> tuple[tuple[_Node, int] | None, float]:
        """Return the best outcome to test that seems to be known and was never seen.

        Returns:
            It, or None if all were seen; and the surprises to hope for a step.
        """
        told = self._experience
        best, most = None, 0.0
        for node, action in known:
            hope = self._hope(node, action)
            if hope > most and (told.key(node.state), action) not in told.tried:
                best, most = (node, action), hope
        return best, most

    def _hope(self, node: _Node, action: int) -> float:
        """Return how many surprises a step one may hope for on the way to a trial."""
        return self._experience.surprises.share(action) / (node.steps + 1)

    def _planned(self, last: _Node, why: str) -> Plan:
        first, *way = last.way()
        return Plan(
            tuple(node.action for node in way),
            np.stack([node.state for node in (first, *way[:-1])]),
            why,
        )

    def _imaginable(self, state: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return for each action whether all its contexts in a state have been met."""
        met = self._experience.met[self._first :: 2]
        never = self._contexts.hold(state) & ~met
        possible = np.ones(len(self._names), np.bool_)
        possible[self._contexts.action[never]] = False
        return possible


def _bound(closures: Closures) -> NDArray[np.bool_]:
    """Return what each signal guarantees: ``(n, 2N)``."""
    return guaranteed(closures) if len(closures) else np.zeros((0, 0), np.bool_)
