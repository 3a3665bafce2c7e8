"""Plans where chance decides, by what followed each action in past readings.

What followed each action in the past is counted (`moves`), and the counts are taken for
chances. The plan takes, wherever it is, the action that promises most: to arrive at a
target, to come to what was hardly tried, or the most of what is preferred. What comes a
step later is worth less, by `DISCOUNT` or `PATIENCE`.

A place is known only by moves that are remembered, and an action that was not taken
there has no chance. Where places look alike that are not, no plan is made to a target
or to explore while a sensor can be grown that tells them apart: it would go in circles.
Then it is the best there is, and *guesses*.

References:
    Not the paper's, which leaves chance open. Counts taken for the truth are "certainty
    equivalence"; the values are found by value iteration (Bellman 1957), for the chance
    to reach a set (Bertsekas & Tsitsiklis 1991). With a model of counts a discount errs
    less than none (Jiang et al. 2015). What was never tried promises most, and less
    with each try: as in R-max (Brafman & Tennenholtz 2002), by degrees.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.moves import CountedMoves, Transitions, Values, counted
from neurosnap.agent.plan import WAYS, ContingentPlan
from neurosnap.poc.learning.history_questions import Search
from neurosnap.poc.learning.reading_history import History

SURE: Final = 16
"""Moves by an action from a place after which its chances count as known."""
DISCOUNT: Final = 0.99
"""What something is worth that comes a step later: of what is preferred, or a try."""
PATIENCE: Final = 0.999
"""The same of a target: the chance to arrive comes first, but of two ways that are
nearly as sure the sooner is the better."""
AGAIN: Final = 0.01
"""What it is worth to do again what was done once, where all was done often enough."""
HOPE: Final = 1e-4
"""The chance that what was never tried leads to a target, where no way is known."""
_NEAR = 1e-7  # of the greatest gain: what differs by less is improved no further
_SWEEPS = 2000  # at most
_SHOWN = 1e-5  # a chance that a sweep adds less to is near enough to be shown


def plan_by_chance(
    body: Body,
    target: Sequence[int],
    prefers: Mapping[int, float],
    history: History,
    here: NDArray[np.bool_],
    doubted: NDArray[np.bool_],
    explores: bool = False,
) -> Search[ContingentPlan | None]:
    """Ask for past readings, and plan by what followed each action.

    Args:
        body: What is sensed and done; its actions are sensed.
        target: Literals of the world's own, to be achieved jointly.
        prefers: What each of some literals is worth, whenever it is read. Without a
            target and preferences the plan is to come to where some action was taken
            fewer than `SURE` times, and to take it.
        history: Of it only which ticks it holds: what was read then is asked for.
        here: ``(2N,)``, the state.
        doubted: ``(n,)``: which of the world's own sensors may be coins, that tell no
            place from another; they are left out unless they are `telling`.
        explores: Whether one with preferences takes what was hardly tried for the best.

    Returns:
        A plan; None if no moves are remembered; or, while a sensor can be grown, if
        places look alike, or nothing slips that was to be explored. With preferences it
        may be of no use here; without them, None is returned then, too.
    """
    seen = yield from counted(body, target, prefers, history, doubted)
    if seen is None:
        return None
    if body.has_room and (seen.hides or not (target or prefers or seen.slips)):
        return None
    table, size = seen.table, len(seen.places)
    acted = np.zeros(size, np.bool_)
    acted[table.start] = True
    again = not (target or prefers or body.has_room)
    tries, rarest = _hardly_known(seen, len(body.actions), again)
    why, least = "explores" if seen.slips else "tries", tries
    if target:
        why = "guesses" if seen.hides else "arrives"
        least = seen.met.astype(np.float64)
        if not body.has_room:
            least = np.maximum(least, HOPE * tries)
    elif prefers:
        most = max(0.0, *prefers.values()) / (1 - DISCOUNT)
        hopeful = explores & (tries > 0)
        why, least = "prefers", np.where(acted, -np.inf, 0.0)
        least[hopeful] = most * tries[hopeful]
    values, best = values_of(table, least, PATIENCE if target else DISCOUNT)
    trying = values <= least
    best = np.where(trying, rarest, best)
    useful = acted & ~seen.met & ((values > 0) | bool(prefers))
    if target:
        values = _arriving(table, best, seen.met)
    literals = np.zeros((size, len(here)), np.bool_)
    # In this order, as of a latch both are among them, and may be unknown.
    literals[:-1, seen.literals ^ 1] = ~seen.places[:-1]
    literals[:-1, seen.literals] = seen.places[:-1]
    actions = np.where(useful, best, -1)
    # What it learns on its way to a target may tell that it goes in circles.
    ticks = max(SURE, history.ticks // 4) if prefers and not explores else SURE
    until, (after, shares) = history.tick + ticks, _ways(table, actions)
    if why == "tries":
        after[trying], shares[trying] = -1, 0
    plan = ContingentPlan(actions, literals, why, values, until, after, shares)
    return plan if prefers or plan.goes_on(here, history.tick) else None


def _hardly_known(
    seen: CountedMoves, actions: int, again: bool
) -> tuple[Values, NDArray[np.intp]]:
    """Return what a try is worth in each place, and the rarest action there.

    ``(S,)`` each: 1 where some action was never taken, 0 where each was often enough,
    and where none was: there the episode is over. `SURE` times are enough; once is, if
    nothing slips. But if there is nothing else to do, what was taken least is worth
    something `again`, so that it is remembered.
    """
    table, sure = seen.table, SURE if seen.slips else 1
    times = np.zeros((len(seen.places), actions), np.int64)
    times[table.start, table.action] = np.bincount(table.pair, table.times)
    least = times.min(axis=1)
    worth = np.maximum(1 - least / sure, AGAIN / np.maximum(least, 1) if again else 0.0)
    return np.where(times.any(axis=1), worth, 0.0), times.argmin(axis=1)


def values_of(
    table: Transitions, least: Values, discount: float
) -> tuple[Values, NDArray[np.intp]]:
    """Return what each place is worth, and the best action there.

    Args:
        table: What follows; of one move at least.
        least: ``(S,)``: what it is worth to be there, whatever is done; minus infinity
            where that is what is done.
        discount: What something is worth that comes a step later.

    Returns:
        ``(S,)`` each. Where no action was taken the action means nothing.
    """
    values: Values = np.where(np.isfinite(least), least, 0.0)
    worth: Values = np.zeros(len(table.start))
    starts, first = np.unique(table.start, return_index=True)
    place = np.searchsorted(starts, table.start)
    outcomes, unit = table.begins, float(np.abs(table.gain).max()) or 1.0
    for _ in range(_SWEEPS):
        led = np.add.reduceat(table.share * values[table.after], outcomes)
        worth = table.gain + discount * led
        better = values.copy()
        better[starts] = np.maximum(np.maximum.reduceat(worth, first), least[starts])
        near = np.abs(better - values).max() < _NEAR * unit
        values = better
        if near:
            break
    # The first of the best: pairs are in the order of the places, then of the actions.
    hits = np.flatnonzero(worth == np.maximum.reduceat(worth, first)[place])
    where, at = np.unique(place[hits], return_index=True)
    best = np.zeros(len(least), np.intp)
    best[starts[where]] = table.action[hits[at]]
    return values, best


def _arriving(
    table: Transitions, best: NDArray[np.intp], met: NDArray[np.bool_]
) -> Values:
    """Return the chance to arrive at some time from each place, by these actions."""
    chosen = (best[table.start] == table.action)[table.pair]
    start, after = table.start[table.pair[chosen]], table.after[chosen]
    share = table.share[chosen]
    chances = met.astype(np.float64)
    for _ in range(_SWEEPS):
        led = np.bincount(start, share * chances[after], len(met))
        better: Values = np.maximum(led, met)
        near = (better - chances).max() < _SHOWN
        chances = better
        if near:
            break
    return chances


def _ways(
    table: Transitions, actions: NDArray[np.intp]
) -> tuple[NDArray[np.intp], Values]:
    """Return the places to which the actions led most often, and how often.

    ``(S, WAYS)`` each; -1 where there are no more of them.
    """
    mine = np.flatnonzero((actions[table.start] == table.action)[table.pair])
    start = table.start[table.pair[mine]]
    order = np.lexsort((table.after[mine], -table.times[mine], start))
    mine, start = mine[order], start[order]
    begins = np.flatnonzero(np.diff(start, prepend=-1))
    rank = np.arange(len(start)) - np.repeat(begins, np.diff(begins, append=len(start)))
    few = rank < WAYS
    after = np.full((len(actions), WAYS), -1, np.intp)
    share = np.zeros((len(actions), WAYS))
    after[start[few], rank[few]] = table.after[mine[few]]
    share[start[few], rank[few]] = table.share[mine[few]]
    return after, share
