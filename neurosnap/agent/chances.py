"""Plans where chance decides, by what followed each action in past readings.

Of the ticks that are remembered, each at which one action was taken is a *move*, from
the place that was read before it to the one after. Moves from the same place by the
same action are counted by where they led: these counts are their chances. The plan
takes, wherever it is, the action that promises most: to arrive at a target, to come to
what was hardly tried, or the most of what is preferred. What comes a step later is
worth less, by `DISCOUNT` or `PATIENCE`.

Nothing is stored for it: the readings are those that sensors are grown from, and are
asked for when a plan is made. So a place is known only by moves that are remembered,
and an action that was not taken there has no chance. Where what was done a step before
tells much of what follows, places look alike that are not: then there is no such plan
to a target, as it would go in circles.

References:
    Not the paper's, which leaves chance open. Counts taken for the truth are "certainty
    equivalence"; the values are found by value iteration (Bellman 1957), for the chance
    to reach a set (Bertsekas & Tsitsiklis 1991). With a model of counts a discount errs
    less than none (Jiang et al. 2015). What was never tried promises most, and less
    with each try: as in R-max (Brafman & Tennenholtz 2002), by degrees.
"""

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.clones import Walk, walk_in
from neurosnap.agent.plan import WAYS, ContingentPlan
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import History, in_order

SURE: Final = 16
"""Moves by an action from a place after which its chances count as known."""
HIDDEN: Final = 0.1
"""The share of what is left open that the move before may tell: beyond it places look
alike that are not, and no plan is made that takes them for one."""
DISCOUNT: Final = 0.99
"""What something is worth that comes a step later: of what is preferred, or a try."""
PATIENCE: Final = 0.999
"""The same of a target: the chance to arrive comes first, but of two ways that are
nearly as sure the sooner is the better."""
_NEAR = 1e-7  # values that differ by less are not improved any further
_SWEEPS = 2000  # at most
_SHOWN = 1e-5  # a chance that a sweep adds less to is near enough to be shown
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
    """``(m,)``, ascending: the tick after it, counted from the oldest remembered."""


class Transitions(NamedTuple):
    """What follows in each place by each action; ``e`` outcomes, in ascending order."""

    start: NDArray[np.intp]
    """``(p,)``: the place of each pair of a place and an action that was taken."""
    action: NDArray[np.intp]
    """``(p,)``: the action."""
    gain: Values
    """``(p,)``: what was read right after it was worth, on average."""
    pair: NDArray[np.intp]
    """``(e,)``: the pair of each outcome."""
    after: NDArray[np.intp]
    """``(e,)``: the place that it is."""
    times: NDArray[np.intp]
    """``(e,)``: in how many moves."""


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
        prefers: What each of some literals is worth, whenever it is read. If there are
            neither: to come to where some action was taken fewer than `SURE` times, and
            take it.
        history: Of it only which ticks it holds: what was read then is asked for.
        here: ``(2N,)``, the state.
        doubted: ``(n,)``: which of the world's own sensors may be coins, that tell no
            place from another; they are left out unless they are `telling`.
        explores: Whether to prefer to all else what was hardly tried; if there is
            neither, it is.

    Returns:
        A plan. None if no move that is remembered leads on to where it is to arrive
        from here; or, of what is preferred, if none is remembered.
    """
    seen = yield from _counted(body, target, prefers, history, doubted)
    if seen is None or (not prefers and (seen.hides or not (target or seen.slips))):
        return None
    table, size = seen.table, len(seen.places)
    acted = np.zeros(size, np.bool_)
    acted[table.start] = True
    tries, rarest = _hardly_known(seen, len(body.actions))
    why, least = "explores", tries
    if target:
        why, least = "arrives", seen.met.astype(np.float64)
    elif prefers:
        most = max(0.0, *prefers.values()) / (1 - DISCOUNT)
        hopeful = explores & (tries > 0)
        why, least = "prefers", np.where(acted, -np.inf, 0.0)
        least[hopeful] = most * tries[hopeful]
    values, best = values_of(table, least, PATIENCE if target else DISCOUNT)
    best = np.where(values <= least, rarest, best)
    useful = acted & ~seen.met & ((values > 0) | bool(prefers))
    if target:
        values = _arriving(table, best, seen.met)
    literals = np.zeros((size, len(here)), np.bool_)
    literals[:-1, 2 * seen.sensors] = seen.places[:-1]
    literals[:-1, 2 * seen.sensors + 1] = ~seen.places[:-1]
    actions = np.where(useful, best, -1)
    ticks = SURE if explores and not target else max(SURE, history.ticks // 4)
    until, ways = history.tick + ticks, _ways(table, actions)
    plan = ContingentPlan(actions, literals, why, values, until, *ways)
    return plan if prefers or plan.goes_on(here, history.tick) else None


class _Counted(NamedTuple):
    """What is remembered of moves; ``S`` places, of ``R`` sensors."""

    sensors: NDArray[np.intp]
    """``(R,)``: those that tell one place from another."""
    places: NDArray[np.bool_]
    """``(S, R)``: what each reads. The last stands for what is behind an end."""
    met: NDArray[np.bool_]
    """``(S,)``: where the target is met."""
    table: Transitions
    hides: bool
    """Whether places look alike that are not."""

    @property
    def slips(self) -> bool:
        """Whether any action led to different places from one."""
        return len(self.table.pair) > len(self.table.start)


def _counted(
    body: Body,
    target: Sequence[int],
    prefers: Mapping[int, float],
    history: History,
    doubted: NDArray[np.bool_],
) -> Search[_Counted | None]:
    """Ask for past readings, and count moves; None if there are none, or no places."""
    sought = [a >> 1 for a in target]
    makes_place = {*np.flatnonzero(body.position[::2]).tolist(), *body.carries, *sought}
    numbers = sorted(makes_place | {a >> 1 for a in prefers})
    sensors, first = np.array(numbers, np.intp), len(body.own)
    taken = [2 * (first + action) for action in range(len(body.actions))]
    asked = *taken, *(b for k in numbers for b in (2 * k, 2 * k + 1))
    read = (yield Question(readings=tuple(dict.fromkeys(asked)))).readings
    moves = moves_in(walk_in(read, sensors, taken, history.tick))
    gains = np.zeros(len(moves.tick))
    for literal, worth in prefers.items():
        on = moves.after[:, numbers.index(literal >> 1)]
        gains += worth * (on != bool(literal & 1))
    kept = ~np.isin(sensors, np.setdiff1d(np.flatnonzero(doubted), sought))
    if not kept.all():
        kept |= telling(moves, len(taken))
    kept &= np.isin(sensors, list(makes_place))  # what is only liked makes no place
    sensors, before, after = sensors[kept], moves.before[:, kept], moves.after[:, kept]
    if not before.size:
        return None
    places, number = _numbered(np.concatenate((before, after)))
    pairs = number[: len(before)] * len(taken) + moves.action
    led = number[len(before) :]
    hides = told_before(pairs, led, moves.tick) > HIDDEN
    on, wanted = np.isin(2 * sensors, target), np.isin(sensors, sought)
    met = bool(target) & (places == on)[:, wanted].all(axis=1)
    # Where an episode ended may look like a place that goes on.
    places, met = np.pad(places, ((0, 1), (0, 0))), np.append(met, False)
    over = np.append(in_order([history.over], history.tick)[0], False)
    led = np.where(over[moves.tick + 1] & ~met[led], len(met) - 1, led)
    table = _transitions(pairs, led, gains, len(places), len(taken))
    return _Counted(sensors, places, met, table, hides)


def _hardly_known(seen: _Counted, actions: int) -> tuple[Values, NDArray[np.intp]]:
    """Return what a try is worth in each place, and the rarest action there.

    ``(S,)`` each: 1 where some action was never taken, 0 where each was often enough,
    and where none was: there the episode is over. `SURE` times are enough; once is, if
    nothing slips.
    """
    table, sure = seen.table, SURE if seen.slips else 1
    times = np.zeros((len(seen.places), actions), np.int64)
    times[table.start, table.action] = np.bincount(table.pair, table.times)
    worth = np.maximum(1 - times.min(axis=1) / sure, 0.0)
    return np.where(times.any(axis=1), worth, 0.0), times.argmin(axis=1)


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
    pairs: NDArray[np.intp],
    led: NDArray[np.intp],
    gains: Values,
    places: int,
    actions: int,
) -> Transitions:
    """Return what follows, by the pair of each move, where it led, and its gain."""
    outcomes, times = np.unique(pairs * places + led, return_counts=True)
    of, after = np.divmod(outcomes, places)
    _, pair = np.unique(of, return_inverse=True)
    named, moved, count = np.unique(pairs, return_inverse=True, return_counts=True)
    start, action = np.divmod(named, actions)
    gain = np.bincount(moved, gains) / count
    return Transitions(start, action, gain, pair, after, times)


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
    shares, outcomes = _shares(table)
    for _ in range(_SWEEPS):
        led = np.add.reduceat(shares * values[table.after], outcomes)
        worth = table.gain + discount * led
        better = values.copy()
        better[starts] = np.maximum(np.maximum.reduceat(worth, first), least[starts])
        near = np.abs(better - values).max() < _NEAR
        values = better
        if near:
            break
    # The first of the best: pairs are in the order of the places, then of the actions.
    hits = np.flatnonzero(worth == np.maximum.reduceat(worth, first)[place])
    where, at = np.unique(place[hits], return_index=True)
    best = np.zeros(len(least), np.intp)
    best[starts[where]] = table.action[hits[at]]
    return values, best


def _shares(table: Transitions) -> tuple[Values, NDArray[np.intp]]:
    """Return the share of each outcome, ``(e,)``, and where those of a pair begin."""
    outcomes = np.flatnonzero(np.diff(table.pair, prepend=-1))
    return table.times / np.add.reduceat(table.times, outcomes)[table.pair], outcomes


def _arriving(
    table: Transitions, best: NDArray[np.intp], met: NDArray[np.bool_]
) -> Values:
    """Return the chance to arrive at some time from each place, by these actions."""
    shares, _ = _shares(table)
    chosen = (best[table.start] == table.action)[table.pair]
    start, after = table.start[table.pair[chosen]], table.after[chosen]
    chances = met.astype(np.float64)
    for _ in range(_SWEEPS):
        led = np.bincount(start, shares[chosen] * chances[after], len(met))
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
    shares, _ = _shares(table)
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
    share[start[few], rank[few]] = shares[mine[few]]
    return after, share
