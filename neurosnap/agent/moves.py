"""Counts what followed each action in past readings, from place to place.

Of the ticks that are remembered, each at which one action was taken is a *move*, from
the place that was read before it to the one after. A place is what the sensors read
that tell one from another: not those that are coins.

Nothing is stored for it: the readings are those that sensors are grown from, and are
asked for each time. Where what was done a step before tells much of what follows,
places look alike that are not. What was sensed of that step is then part of a place, as
far as it tells; where that is not enough, they *hide* something. Once no context can be
grown, a place has the latches as well, and what an action led to in this trajectory is
expected again, if that tells.

References:
    Not the paper's. To tell places apart by the step before only where that tells what
    follows is McCallum's (1996) utile distinction.
"""

from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.clones import Walk, walk_in
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import History, in_order

HIDDEN: Final = 0.1
"""The share of what is left open that the move before may tell: beyond it places look
alike that are not, and are not to be taken for one."""
SELDOM: Final = 0.02
"""The share of all moves that it may tell all the same: so few are taken for chance."""
_MOST = 8  # sensors of the step before that tell places apart
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
    share: Values
    """``(e,)``: of the moves of its pair."""

    @property
    def begins(self) -> NDArray[np.intp]:
        """``(p,)``: where the outcomes of each pair begin."""
        return np.flatnonzero(np.diff(self.pair, prepend=-1))


class CountedMoves(NamedTuple):
    """What is remembered of moves; ``S`` places, of ``R`` sensors."""

    literals: NDArray[np.intp]
    """``(R,)``: those that tell one place from another."""
    places: NDArray[np.bool_]
    """``(S, R)``: which were read at each. The last stands for what is behind an
    end."""
    met: NDArray[np.bool_]
    """``(S,)``: where the target is met."""
    table: Transitions
    hides: bool
    """Whether places look alike that are not; not asked for what is preferred."""

    @property
    def slips(self) -> bool:
        """Whether any action led to different places from one."""
        return len(self.table.pair) > len(self.table.start)


def counted(
    body: Body,
    target: Sequence[int],
    prefers: Mapping[int, float],
    history: History,
    doubted: NDArray[np.bool_],
) -> Search[CountedMoves | None]:
    """Ask for past readings, and count moves; None if there are none, or no places.

    Args:
        body: What is sensed and done; its actions are sensed.
        target: Literals to be achieved jointly; their sensors are part of a place.
        prefers: What each of some literals is worth: the gain of a move after it.
        history: Of it only which ticks it holds, and where trajectories ended.
        doubted: ``(n,)``: which of the world's own sensors may be coins; they are left
            out unless they are `telling`.
    """
    sought = [a >> 1 for a in target]
    # What is carried may be unknown for long, and then no move would be known.
    carried = body.carries if body.has_room else ()
    makes_place = {*np.flatnonzero(body.position[::2]).tolist(), *carried, *sought}
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
    kept &= np.isin(sensors, list(makes_place))  # what is only preferred makes none
    moves = moves._replace(before=moves.before[:, kept], after=moves.after[:, kept])
    if not moves.before.size:
        return None
    literals, many = 2 * sensors[kept], len(taken)
    if not body.has_room:
        literals, moves = yield from _latched(body, history, literals, moves)
    places, pairs, led = _numbered(moves, many)
    hides = not prefers and hidden(pairs, led, moves.tick)
    if hides:
        literals, moves = yield from _told_apart(body, history, literals, moves)
        places, pairs, led = _numbered(moves, many)
        hides = hidden(pairs, led, moves.tick)
    on, wanted = np.isin(literals, target), np.isin(literals >> 1, sought)
    met = bool(target) & (places == on)[:, wanted].all(axis=1)
    # Where an episode ended may look like a place that goes on.
    places, met = np.pad(places, ((0, 1), (0, 0))), np.append(met, False)
    over = np.append(in_order([history.over], history.tick)[0], False)
    led = np.where(over[moves.tick + 1] & ~met[led], len(met) - 1, led)
    if target and not body.has_room:
        begun = in_order([history.begun], history.tick)[0]
        kept = expected_now(pairs, led, moves.tick, begun)
        pairs, led, gains = pairs[kept], led[kept], gains[kept]
    table = _transitions(pairs, led, gains, len(places), many)
    return CountedMoves(literals, places, met, table, hides)


def _latched(
    body: Body,
    history: History,
    literals: NDArray[np.intp],
    moves: Moves,
) -> Search[tuple[NDArray[np.intp], Moves]]:
    """Add to moves what latches were, on or off, or unknown."""
    more = [a for _, number in body.latches for a in (2 * number, 2 * number + 1)]
    if not more:
        return literals, moves
    read = (yield Question(readings=tuple(more))).readings
    then = in_order([read[a] for a in more], history.tick).T
    return np.append(literals, more), _with(moves, then)


def _told_apart(
    body: Body,
    history: History,
    literals: NDArray[np.intp],
    moves: Moves,
) -> Search[tuple[NDArray[np.intp], Moves]]:
    """Add what was sensed of the step before to moves, as far as it tells places apart.

    Of the step before tell the contexts and the actions; not what is carried.
    """
    others = np.setdiff1d(body.read[len(body.own) :], body.carries).tolist()
    asked = Question(readings=tuple(2 * k for k in others))
    read = (yield asked).readings
    then = in_order([read[2 * k] for k in others], history.tick).T
    for _ in range(_MOST):
        _, pairs, led = _numbered(moves, len(body.actions))
        alike = hidden(pairs, led, moves.tick)
        best = told_by(pairs, led, then[moves.tick - 1]) if alike else None
        if best is None:
            break
        literals = np.append(literals, 2 * others[best])
        moves = _with(moves, then[:, best])
    return literals, moves


def _with(moves: Moves, then: NDArray[np.bool_]) -> Moves:
    """Return moves whose places have more of what was read, by tick."""
    return moves._replace(
        before=np.column_stack((moves.before, then[moves.tick - 1])),
        after=np.column_stack((moves.after, then[moves.tick])),
    )


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
    moves: Moves, actions: int
) -> tuple[NDArray[np.bool_], NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of moves, ``(S, R)``, and by their numbers what the moves are.

    Returns:
        The places; of each move ``(m,)`` its pair of a place and an action, and the
        place it led to.
    """
    rows = np.concatenate((moves.before, moves.after))
    packed = np.packbits(rows, axis=1)
    keys = np.ascontiguousarray(packed).view(f"V{packed.shape[1]}").ravel()
    _, first, number = np.unique(keys, return_index=True, return_inverse=True)
    start, led = np.split(number, 2)
    return rows[first], start * actions + moves.action, led


def expected_now(
    pairs: NDArray[np.intp],
    led: NDArray[np.intp],
    tick: NDArray[np.intp],
    begun: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which moves tell what follows in this trajectory: ``(m,)``.

    What is hidden may last as long as a trajectory. Then an action leads to what it led
    to here before, and to try it again and again is to go in circles. If that tells
    more than `HIDDEN` of what is left open, of each pair that was met in this
    trajectory only the last time counts, and those that followed the same outcome.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        tick: ``(m,)``, ascending, the tick after it.
        begun: By tick, whether a trajectory began there.
    """
    since = np.maximum.accumulate(np.where(begun, np.arange(len(begun)), -1))
    of = since[tick]
    order = np.argsort(pairs, kind="stable")  # of each in the order of its ticks
    again = (np.diff(pairs[order]) == 0) & (np.diff(of[order]) == 0)
    later, earlier = order[1:][again], order[:-1][again]
    many = 1 + int(max(pairs.max(), led.max()))
    _, cell, times = np.unique(
        pairs * many + led, return_inverse=True, return_counts=True
    )
    by_accident = (times[cell] / np.bincount(pairs)[pairs])[earlier].sum()
    told = (led[later] == led[earlier]).sum() - by_accident
    kept = np.ones(len(pairs), np.bool_)
    if told <= HIDDEN * (len(later) - by_accident):
        return kept
    last = np.full(many, -1)  # outcome by pair, in this trajectory
    now = np.flatnonzero(of == since[-1])
    last[pairs[now]] = led[now]
    before = np.full(len(pairs), -1)
    before[later] = led[earlier]
    kept &= (last[pairs] < 0) | (before == last[pairs])
    newest = np.unique(pairs[now][::-1], return_index=True)[1]
    kept[now[::-1][newest]] = True
    return kept


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
    gain, share = np.bincount(moved, gains) / count, times / count[pair]
    return Transitions(start, action, gain, pair, after, times, share)


def hidden(
    pairs: NDArray[np.intp], led: NDArray[np.intp], tick: NDArray[np.intp]
) -> bool:
    """Return whether places look alike that are not; see `told_before`."""
    of_open, of_all = told_before(pairs, led, tick)
    return of_open > HIDDEN and of_all > SELDOM


def told_before(
    pairs: NDArray[np.intp], led: NDArray[np.intp], tick: NDArray[np.intp]
) -> tuple[float, float]:
    """Return what the move before tells, as a share of what is left open, and of all.

    The first is about 0 where chance alone decides what a place and an action lead to,
    1 where the move before tells all of it. The second is the share of all moves whose
    outcome it tells, and nothing else does. The first is Goodman and Kruskal's tau of
    the move before and the place that followed, within each pair, less what it is
    expected to be by accident.

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
        return 0.0, 0.0

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
    told, left = found - expected, len(then) - expected
    return (told / left, told / len(then)) if left > 0 else (0.0, 0.0)


def told_by(
    pairs: NDArray[np.intp], led: NDArray[np.intp], readings: NDArray[np.bool_]
) -> int | None:
    """Return the sensor that tells most of what a place and an action leave open.

    Args:
        pairs: ``(m,)``, which place and action each move was from.
        led: ``(m,)``, the place it led to.
        readings: ``(m, C)``, what each sensor read before it.

    Returns:
        The first of those that tell most, by Goodman and Kruskal's tau, less what is
        expected by accident; None if that is less than `HIDDEN` of what is open.
    """
    many = 1 + int(max(pairs.max(), led.max()))
    cells, cell = np.unique(pairs * many + led, return_inverse=True)
    _, of, outcomes = np.unique(cells // many, return_inverse=True, return_counts=True)
    several = outcomes[of] > 1
    moves = np.flatnonzero(several[cell])
    if not moves.size:
        return None
    moves = moves[np.argsort(cell[moves], kind="stable")]
    begins = np.flatnonzero(np.diff(cell[moves], prepend=-1))
    first = np.flatnonzero(np.diff(of[several], prepend=-1))
    whole = np.diff(begins, append=len(moves))[:, None].astype(np.float64)
    on = np.add.reduceat(readings[moves], begins, axis=0, dtype=np.float64)

    def parts(times: Values) -> tuple[Values, Values]:
        """Return for each pair how many moves, and the sum of squares by outcome."""
        return np.add.reduceat(times, first), np.add.reduceat(times**2, first)

    size, alike = parts(whole)
    found = np.zeros((len(first), readings.shape[1]))
    parted = np.ones_like(found, np.bool_)
    for part in on, whole - on:
        of_part, squares = parts(part)
        found += squares / np.maximum(of_part, 1)
        parted &= of_part > 0
    accident = (alike + (size**2 - alike) / np.maximum(size - 1, 1)) / size
    gain = (found - np.where(parted, accident, alike / size)).sum(axis=0)
    best = int(gain.argmax())
    left = float((size - accident).sum())
    return best if gain[best] > HIDDEN * left else None
