"""Plans: lists of actions, their expected results, and their wording for people."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.sensorium import Sensorium

WAYS = 3
"""Places that a plan says an action may lead to."""


class Names(NamedTuple):
    """What a reason calls things."""

    actions: Sequence[str]
    sensors: Sensorium


@dataclass(frozen=True, slots=True, eq=False)
class ImaginedState:
    """A state that an action is imagined to lead to, or the present state."""

    place: NDArray[np.bool_]
    """``(2N,)``: the literals that hold, as far as they tell places apart."""
    before: "ImaginedState | None" = None
    """Where the action was taken; None if it is where things are now."""
    action: int = -1
    """The one that led to it."""
    steps: int = 0
    """How many actions led to it."""
    by_chance: bool = False
    """Whether it, or one on the way, is left to chance in part."""

    def way(self) -> list["ImaginedState"]:
        """Return the states from the first, which no action led to, to this one."""
        states: list[ImaginedState] = []
        state: ImaginedState | None = self
        while state is not None:
            states.append(state)
            state = state.before
        return states[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class Plan:
    """A list of actions, and the state in which each is to be taken."""

    actions: tuple[int, ...]
    """One or more."""
    places: NDArray[np.bool_]
    """``(actions, 2N)``: what is expected of the state before each."""
    why: str
    """How its reason begins."""

    def goes_on(self, place: NDArray[np.bool_], _tick: int) -> bool:
        """Return whether a state, ``(2N,)``, has all that was expected."""
        return not (self.places[0] & ~place).any()

    def step(self, _place: NDArray[np.bool_]) -> tuple[int, "Plan | None"]:
        """Return the next action, and the plan behind it."""
        action, *rest = self.actions
        after = Plan(tuple(rest), self.places[1:], self.why) if rest else None
        return action, after

    def reason(self, _place: NDArray[np.bool_], names: Names) -> str:
        """Return why its next action is taken; `plan_told` reads it."""
        shown = ", ".join(names.actions[action] for action in self.actions[:_SHOWN])
        more = ", …" if len(self.actions) > _SHOWN else ""
        return f"{self.why}in {len(self.actions)}: {shown}{more}"


@dataclass(frozen=True, slots=True, eq=False)
class ContingentPlan:
    """For each of several places the action to take there, where chance decides."""

    actions: NDArray[np.intp]
    """``(k,)``; -1 where it is of no use."""
    places: NDArray[np.bool_]
    """``(k, 2N)``: the literals that tell each place; none: an episode is over."""
    why: str
    """``arrives`` at a target, or ``guesses`` how, as places look alike; ``explores``
    what was hardly tried, or ``tries`` what was seldom, where once is enough; or
    ``prefers``."""
    values: NDArray[np.float64]
    """``(k,)``: the chance to arrive from each; or what it promises of the preferred,
    what comes later being worth less."""
    until: int
    """The tick after which so much is new that it is made anew."""
    after: NDArray[np.intp]
    """``(k, WAYS)``: the places that the action led to most often; -1: no more. One
    that ``tries`` has none where it does."""
    shares: NDArray[np.float64]
    """``(k, WAYS)``: of all times."""

    def goes_on(self, place: NDArray[np.bool_], tick: int) -> bool:
        """Return whether it is of use in a state, ``(2N,)``, at a tick."""
        return tick <= self.until and self._at(place) >= 0

    def step(self, place: NDArray[np.bool_]) -> tuple[int, "ContingentPlan"]:
        """Return the action in one of its places, and the plan behind it.

        That is the same plan; but one that tries has no more of a place where it does.
        """
        at = self._at(place)
        action = int(self.actions[at])
        if self.why != "tries" or self.after[at, 0] >= 0:
            return action, self
        actions = self.actions.copy()
        actions[at] = -1
        return action, replace(self, actions=actions)

    def reason(self, place: NDArray[np.bool_], names: Names) -> str:
        """Return why its action is taken in one of its places, and what may follow."""
        at = self._at(place)
        value, action = self.values[at], names.actions[self.actions[at]]
        match self.why:
            case "arrives" | "guesses" if not value:
                promise = "knows no way, and comes to what was hardly tried"
            case "arrives":
                promise = f"arrives with a chance of {100 * value:.0f} %"
            case "guesses":
                promise = "cannot tell some places apart, and guesses"
            case "prefers":
                promise = f"expects {value:.3g} of what it prefers"
            case "tries":
                promise = "comes to what was seldom tried"
            case _:
                promise = "comes to what was hardly tried"
        several = [
            f"{self._change(at, after, names)} ({100 * share:.0f} %)"
            for after, share in zip(
                self.after[at].tolist(), self.shares[at].tolist(), strict=True
            )
            if after >= 0
        ]
        slips = f", which led to {', '.join(several)}" if len(several) > 1 else ""
        return f"{promise}: {action}{slips}"

    def _change(self, at: int, after: int, names: Names) -> str:
        """Return what is otherwise in one place than in another, in words."""
        if not self.places[after].any():
            return "an end"
        other = np.flatnonzero(self.places[after] & ~self.places[at]).tolist()
        more = " …" if len(other) > _CHANGES else ""
        shown = " ".join(map(names.sensors.name, other[:_CHANGES]))
        return f"{shown}{more}" if other else "no change"

    def _at(self, place: NDArray[np.bool_]) -> int:
        """Return which place it is; -1 if the plan is of no use there."""
        mine = np.flatnonzero(~(self.places & ~place).any(axis=1))
        if not mine.size:
            return -1
        # What it is not known of in one place may be known in another.
        most = int(mine[self.places[mine].sum(axis=1).argmax()])
        return most if self.actions[most] >= 0 else -1


_SHOWN = 6  # actions of a plan that a reason names
_CHANGES = 2  # literals by which it tells what may follow
_TOLD = re.compile(
    r"(?:(?P<why>.*), )?in (?P<left>[1-9]\d{0,8}): (?P<actions>.*?)(?P<more>, …)?"
)


AnyPlan: TypeAlias = Plan | ContingentPlan


class PlanTold(NamedTuple):
    """The part of a decision's reason that describes the plan."""

    left: int
    """Actions to be taken, this one included."""
    actions: tuple[int, ...]
    """The first of them."""
    why: str
    """What the plan is for; empty: to achieve the target."""


def plan_told(why: str, names: Sequence[str]) -> PlanTold | None:
    """Return the plan that a decision's reason names, by the actions' names, or None.

    Examples:
        >>> plan_told("to begin another episode, in 2: up, left", ["left", "up"])
        PlanTold(left=2, actions=(1, 0), why='to begin another episode')
    """
    found = _TOLD.fullmatch(why)
    if found is None:
        return None
    left, shown = int(found["left"]), found["actions"].split(", ")
    whole = len(shown) == min(left, _SHOWN) and bool(found["more"]) == (left > _SHOWN)
    if not whole or not set(names).issuperset(shown):
        return None
    return PlanTold(left, tuple(map(names.index, shown)), found["why"] or "")
