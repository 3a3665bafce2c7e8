"""The plans that decisions follow, step by step."""

from collections.abc import Container, Mapping, Sequence

from neurosnap import wire
from neurosnap.agent.plan_reason import PlanTold, plan_told
from neurosnap.apps.viewer.api import Plan

BEFORE = 64
"""Ticks before some others whose decisions are needed: steps of a plan that were taken
longer ago are not shown."""


def plan_at(
    tick: int,
    decisions: Mapping[int, wire.Decision],
    asked: Container[int],
    actions: Sequence[str],
) -> Plan | None:
    """Return the plan that a tick's decision follows; None: it follows none.

    Args:
        tick: The tick.
        decisions: Those of the ticks around, by tick.
        asked: The ticks of planning waves: a plan that is followed asks none.
        actions: What the actions are called.
    """
    told = _told(decisions.get(tick), actions)
    if told is None:
        return None
    done: list[int] = []
    now = told
    while len(done) < BEFORE and tick not in asked:
        tick -= 1
        before = _told(decisions.get(tick), actions)
        if before is None or not _goes_on(before, now):
            break
        done.insert(0, before.actions[0])
        now = before
    return Plan(
        steps=[*done, *told.actions],
        at=len(done),
        more=told.left - len(told.actions),
        why=told.why,
    )


def _told(decision: wire.Decision | None, actions: Sequence[str]) -> PlanTold | None:
    told = None if decision is None else plan_told(decision.why, actions)
    if told is None or decision is None or decision.action != told.actions[0]:
        return None
    return told


def _goes_on(before: PlanTold, now: PlanTold) -> bool:
    """Return whether one decision follows the same plan as the next."""
    rest = before.actions[1:]
    same = (before.left, before.why) == (now.left + 1, now.why)
    return same and rest == now.actions[: len(rest)]
