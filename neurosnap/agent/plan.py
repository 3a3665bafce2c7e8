"""Plans: lists of actions, their expected results, and their wording for people."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


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

    def goes_on(self, place: NDArray[np.bool_]) -> bool:
        """Return whether a state, ``(2N,)``, has all that was expected."""
        return not (self.places[0] & ~place).any()

    def step(self) -> tuple[int, "Plan | None"]:
        """Return the next action, and the plan behind it."""
        action, *rest = self.actions
        after = Plan(tuple(rest), self.places[1:], self.why) if rest else None
        return action, after


_SHOWN = 6  # actions of a plan that a reason names
_TOLD = re.compile(
    r"(?:(?P<why>.*), )?in (?P<left>[1-9]\d{0,8}): (?P<actions>.*?)(?P<more>, …)?"
)


def plan_reason(plan: Plan, names: Sequence[str]) -> str:
    """Return why a plan's next action is taken; `plan_told` reads it."""
    shown = ", ".join(names[action] for action in plan.actions[:_SHOWN])
    more = ", …" if len(plan.actions) > _SHOWN else ""
    return f"{plan.why}in {len(plan.actions)}: {shown}{more}"


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
