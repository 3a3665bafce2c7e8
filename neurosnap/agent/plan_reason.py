"""The reason of a decision that follows a plan, as text, and read back from it."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from neurosnap.agent.experience import Plan

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
    """What a reason says of the plan that is followed."""

    left: int
    """Actions to be taken, this one included."""
    actions: tuple[int, ...]
    """The first of them."""
    why: str
    """What the plan is for; empty: to achieve the target."""


def plan_told(why: str, names: Sequence[str]) -> PlanTold | None:
    """Return the plan that a decision's reason tells of; None: it tells of none.

    Args:
        why: The reason.
        names: What the actions are called.

    Example:
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
