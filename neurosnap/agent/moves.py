"""Counts what followed each action in past readings, from place to place.

Of the ticks that are remembered, each at which one action was taken is a *move*, from
the place that was read before it to the one after. A place is what the sensors read
that tell one from another: not those that are coins.

Nothing is stored for it: the readings are those that sensors are grown from, and are
asked for each time. Where places look alike that are not (`places_apart`), what was
sensed of the step before is part of a place, as far as it tells; where that is not
enough, they *hide* something. Once no context can be grown, a place has the latches as
well, and what an action led to in this trajectory is expected again, if that tells.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.clones import Walk, walk_in
from neurosnap.agent.places_apart import expected_now, hidden, telling, told_by
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import History, in_order

_MOST = 8  # sensors of the step before that tell places apart

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
