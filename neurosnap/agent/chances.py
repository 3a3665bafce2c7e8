"""Plans where chance decides, by what followed each action in past readings.

Of the ticks that are remembered, each at which one action was taken is a *move*, from
the place that was read before it to the one after. Moves from the same place by the
same action are counted by where they led: these counts are their chances. The plan
takes, wherever it is, the action with the greatest chance to arrive, and of equal ones
the one that arrives sooner.

Nothing is stored for it: the readings are those that sensors are grown from, and are
asked for when a plan is made. So a place is known only by moves that are remembered,
and an action that was not taken there has no chance. Where what was done a step before
tells much of what follows, places look alike that are not: then there is no such plan.

References:
    Not the paper's, which leaves chance open. Counts taken for the truth are "certainty
    equivalence"; the values are found by value iteration (Bellman 1957), for the chance
    to reach a set (Bertsekas & Tsitsiklis 1991).
"""

from collections.abc import Sequence
from statistics import NormalDist
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.clones import Walk, walk_in
from neurosnap.agent.plan import ContingentPlan
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import History

SURE: Final = 16
"""Moves by an action from a place after which its chances count as known."""
HIDDEN: Final = 0.1
"""The share of what is left open that the move before may tell: beyond it places look
alike that are not, and no plan is made that takes them for one."""
LAPSE: Final = 1e-4
"""The chance a step to give up: what makes the sooner of two ways the better one."""
_NEAR = 1e-9  # values that differ by less are not improved any further
_SWEEPS = 10_000  # at most: what is known then is less than the chance, never more
_ACCIDENT = 0.01  # the chance that any sensor seems to tell something, and does not


Values: TypeAlias = NDArray[np.float64]


class Moves(NamedTuple):
    """What actions led to, as often as is remembered; ``m`` moves."""

    before: NDArray[np.bool_]
    """``(m, R)``: what was read before, of the sensors that make a place."""
    action: NDArray[np.intp]
    """``(m,)``."""
    after: NDArray[np.bool_]
    """``(m, R)``: what was read after it, of the same sensors."""
    tick: NDArray[np.intp]
    """``(m,)``, ascending: the tick after it."""


class Transitions(NamedTuple):
    """What follows in each place by each action; ``e`` outcomes, in ascending order."""

    start: NDArray[np.intp]
    """``(p,)``: the place of each pair of a place and an action that was taken."""
    action: NDArray[np.intp]
    """``(p,)``: the action."""
    pair: NDArray[np.intp]
    """``(e,)``: the pair of each outcome."""
    after: NDArray[np.intp]
    """``(e,)``: the place that it is."""
    times: NDArray[np.intp]
    """``(e,)``: in how many moves."""


def plan_by_chance(
    body: Body,
    target: Sequence[int],
    history: History,
    here: NDArray[np.bool_],
    doubted: NDArray[np.bool_],
) -> Search[ContingentPlan | None]:
    """Ask for past readings, and plan by what followed each action.

    Args:
        body: What is sensed and done; its actions are sensed.
        target: Literals of the world's own, to be achieved jointly; none: to come to
            where some action was taken fewer than `SURE` times, and take it.
        history: Of it only which ticks it holds: what was read then is asked for.
        here: ``(2N,)``, the state.
        doubted: ``(n,)``: which of the world's own sensors may be coins, that tell no
            place from another; they are left out unless they are `telling`.

    Returns:
        A plan that is of use here; None if no move that is remembered leads on to where
        it is to arrive.
    """
    wanted = {a >> 1: not a & 1 for a in target}
    felt = np.flatnonzero(body.position[::2]).tolist()
    sensors = np.array(sorted({*felt, *wanted, *body.carries}), np.intp)
    first = len(body.own)
    taken = [2 * (first + action) for action in range(len(body.actions))]
    numbers: list[int] = sensors.tolist()
    asked = *taken, *(b for k in numbers for b in (2 * k, 2 * k + 1))
    read = (yield Question(readings=tuple(dict.fromkeys(asked)))).readings
    moves = moves_in(walk_in(read, sensors, taken, history.tick))
    coins = np.setdiff1d(np.flatnonzero(doubted), list(wanted))
    kept = ~np.isin(sensors, coins)
    if not kept.all():
        kept |= telling(moves, len(taken))
    sensors, before, after = sensors[kept], moves.before[:, kept], moves.after[:, kept]
    if not before.size:
        return None
    places, number = _numbered(np.concatenate((before, after)))
    pairs, led = (
        number[: len(before)] * len(taken) + moves.action,
        number[len(before) :],
    )
    if told_before(pairs, led, moves.tick) > HIDDEN:
        return None
    table = _transitions(pairs, led, len(places), len(taken))
    if wanted:
        on = np.array([wanted.get(k, False) for k in sensors.tolist()])
        met = (places == on)[:, np.isin(sensors, list(wanted))].all(axis=1)
        values, best = values_of(table, met)
        useful, until, why = ~met, history.tick + history.ticks // 4, "arrives"
    else:
        met, rarest = _hardly_known(table, len(places), len(taken))
        values, best = values_of(table, met)
        best = np.where(met, rarest, best)
        useful, until = np.ones_like(met), history.tick + SURE
        why = "comes to what was hardly tried"
    useful &= values > 0
    literals = np.zeros((int(useful.sum()), len(here)), np.bool_)
    literals[:, 2 * sensors] = places[useful]
    literals[:, 2 * sensors + 1] = ~places[useful]
    plan = ContingentPlan(best[useful], literals, why, values[useful], until)
    return plan if plan.goes_on(here, history.tick) else None


def _hardly_known(
    table: Transitions, places: int, actions: int
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Return where some action was taken fewer than `SURE` times, and the rarest there.

    ``(S,)`` each. Where no action was ever taken the episode is over. If every action
    has led to one place from each, nothing is left to chance: then nothing is told.
    """
    if len(table.pair) == len(table.start):
        return np.zeros(places, np.bool_), np.zeros(places, np.intp)
    times = np.zeros((places, actions), np.int64)
    times[table.start, table.action] = np.bincount(table.pair, table.times)
    hardly = times.any(axis=1) & (times.min(axis=1) < SURE)
    return hardly, times.argmin(axis=1)


def moves_in(walk: Walk) -> Moves:
    """Return the moves among past readings.

    Where a reading is unknown, or no action that is known led to it, there is none.
    """
    known = walk.known
    moved = np.flatnonzero((walk.actions[1:] >= 0) & known[1:] & known[:-1])
    after = moved + 1
    return Moves(walk.on[moved], walk.actions[after], walk.on[after], after)


def telling(moves: Moves, actions: int) -> NDArray[np.bool_]:
    """Return which sensors tell what follows, or are told by what was before: ``(R,)``.

    A coin does neither, and tells no place from another. Each pair of a sensor before
    and one after is tested for independence, action by action, by Pearson's chi-square
    with one degree of freedom; all of them seem independent with a chance of 0.99 where
    they are. A sensor that tells something together with another only is missed.
    """
    size = moves.before.shape[1]
    largest = np.zeros((size, size))
    for action in range(actions):
        mine = moves.action == action
        before, after = (
            each[mine].astype(np.float64) for each in (moves.before, moves.after)
        )
        count, x, y = len(before), before.sum(axis=0), after.sum(axis=0)
        both = before.T @ after  # whole numbers: exact in any order
        spread = np.outer(x * (count - x), y * (count - y))
        excess = (count * both - np.outer(x, y)) ** 2 * count
        square = np.divide(excess, spread, out=np.zeros_like(both), where=spread > 0)
        largest = np.maximum(largest, square)
    tests = max(1, actions * size * size)
    limit = NormalDist().inv_cdf(1 - _ACCIDENT / tests / 2) ** 2
    found: NDArray[np.bool_] = (
        np.maximum(largest.max(axis=0), largest.max(axis=1)) > limit
    )
    return found


def _numbered(
    rows: NDArray[np.bool_],
) -> tuple[NDArray[np.bool_], NDArray[np.intp]]:
    """Return the different ones of ``(m, R)`` rows, and for each row which it is."""
    packed = np.packbits(rows, axis=1)
    keys = np.ascontiguousarray(packed).view(f"V{packed.shape[1]}").ravel()
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    return rows[first], number


def _transitions(
    pairs: NDArray[np.intp], led: NDArray[np.intp], places: int, actions: int
) -> Transitions:
    """Return what follows, by the pair of each move and the place it led to."""
    outcomes, times = np.unique(pairs * places + led, return_counts=True)
    of, after = np.divmod(outcomes, places)
    named, pair = np.unique(of, return_inverse=True)
    return Transitions(*np.divmod(named, actions), pair, after, times)


def told_before(
    pairs: NDArray[np.intp], led: NDArray[np.intp], tick: NDArray[np.intp]
) -> float:
    """Return the share of what is left open that the move before tells.

    About 0 where chance alone decides what a place and an action lead to, 1 where the
    move before tells all of it.
    It is Goodman and Kruskal's tau of the move before and the place that followed,
    within each pair, less what it is expected to be by accident.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        tick: ``(m,)``, ascending, the tick after it.
    """
    then = np.flatnonzero(np.diff(tick, prepend=-1) == 1)
    then = then[then > 0]
    _, pair = np.unique(pairs[then], return_inverse=True)
    many = 1 + int(max(pairs.max(), led.max()))
    of, first, case, size = np.unique(
        pairs[then - 1] * many + pairs[then],
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    if not len(of):
        return 0.0

    def purity(group: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return for each group the sum of the squares of how often each followed."""
        cells, times = np.unique(group * many + led[then], return_counts=True)
        sums: Values = np.zeros(int(group.max()) + 1)
        np.add.at(sums, cells // many, times.astype(np.float64) ** 2)
        return sums

    whole = np.bincount(pair)[pair[first]].astype(np.float64)
    alike = purity(pair)[pair[first]]
    other = (whole - size) * (whole**2 - alike) / np.maximum(whole - 1, 1)
    expected = float(((size * alike + other) / whole**2).sum())
    found = float((purity(case) / size).sum())
    left = len(then) - expected
    return (found - expected) / left if left > 0 else 0.0


def values_of(
    table: Transitions, met: NDArray[np.bool_]
) -> tuple[Values, NDArray[np.intp]]:
    """Return the chance to arrive from each place, and the best action there.

    Args:
        table: What follows; of one move at least.
        met: ``(S,)``: the places where the target is met.

    Returns:
        ``(S,)`` each; a chance is less by `LAPSE` for each step of the way. Where no
        action was taken the chance is 0, and the action means nothing.
    """
    values: Values = met.astype(np.float64)
    worth: Values = np.zeros(len(table.start))
    starts, first = np.unique(table.start, return_index=True)
    place = np.searchsorted(starts, table.start)
    outcomes = np.flatnonzero(np.diff(table.pair, prepend=-1))  # where a pair begins
    shares = table.times / np.add.reduceat(table.times, outcomes)[table.pair]
    for _ in range(_SWEEPS):
        led = shares * values[table.after]
        worth = (1 - LAPSE) * np.add.reduceat(led, outcomes)
        better = values.copy()
        better[starts] = np.maximum(np.maximum.reduceat(worth, first), met[starts])
        near = np.abs(better - values).max() < _NEAR
        values = better
        if near:
            break
    # The first of the best: pairs are in the order of the places, then of the actions.
    hits = np.flatnonzero(worth == np.maximum.reduceat(worth, first)[place])
    where, at = np.unique(place[hits], return_index=True)
    best = np.zeros(len(met), np.intp)
    best[starts[where]] = table.action[hits[at]]
    return values, best
