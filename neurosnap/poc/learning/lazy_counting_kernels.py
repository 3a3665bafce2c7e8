"""Compiled loops that count pairs lazily: pairs that cannot change yet are skipped.

Most pairs cannot change their code for many observations to come. These are left alone,
and codes, dates and graph are after every observation as if all had been judged.

**State.** Of every sensor the last 64 readings are kept, as the bits of one word. The
counts of row `i`, of the pairs of sensor `i` with those before it, are as they were at
clock ``upto[i]``, at most 64 observations ago: what came since is the population of
``x_i & x_j``. So counts can be brought up to date at any time, and are before they are
read.

**Windows.** At its *turn*, every `WINDOW` observations, a row is brought up to date,
judged, and its slack is found out. Rows take turns: at each observation it is that of
one in so many. Where thresholds choose themselves it is the turn of their test, every
`TURNS` readings.

**Slack.** Let ``r`` be the weight of a pair's present joint reading and ``a, b, c`` the
other three; ``least`` and ``second`` the smallest two of the four; ``o`` and ``o'`` the
smallest two of ``a, b, c``. The code is an implication iff ``least < second`` and
``least < limit``; its place says which one. In `m` observations the weights grow, by
`m` in all; and the limit grows from ``low`` to at most ``high``, as a rounded product
with the clock. So for `m` observations the code stays

- *whatever is read* (`FREE`), if ``least >= high``: nothing is below the limit; or if
  ``least + m < min(second, low)``: the least stays alone and below the limit;
- *while both sensors read as they do* (`CALM`), for only ``r`` grows then: if ``o = o'
  <= r``, for the least is never alone (where both are 0 and say equivalence, they go on
  to); or if ``o < r``, and ``o < low`` or ``o >= high``: the least stays, and on its
  side of the limit.

All others are *listed* (`LISTED`) and judged at every observation until they are free
or calm. Thresholds that choose themselves change nothing of this: what was broken
stands iff it stood before, except at turns; so a pair that is judged alike again and
again has one code.

**Changes.** When a sensor changes, its calm pairs with sensors behind it are listed;
its own row becomes *dense*, judged as a whole at every observation until its turn. So
does a row with many listed pairs, or in which many sensors changed at once. In noise
all rows are dense, and nothing is lost.

**Cost.** ``O(N² / WINDOW + k N + l)`` time for ``k`` changes and ``l`` listed pairs,
where the paper has ``O(N²)``. The longest observation is one at which all rows become
dense: one population and one judgement a pair.

**Unknown readings.** All this takes every reading at every tick. Where readings may be
unknown (`count_squares`) the pairs of an unknown one are not touched: each pair has a
total of its own, and all are judged at every observation.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import (
    MARK,
    START,
    TURNS,
    Spells,
    withstand,
)
from neurosnap.poc.learning.graph_kernels import (
    Pairs,
    Row,
    code_of,
    difference,
    end_of,
    flip,
    place_of,
    rewire,
    row_of,
)
from neurosnap.poc.learning.twins import Parted, longer
from neurosnap.poc.order.literal_set_kernels import population
from neurosnap.system.compiled import njit

WINDOW: Final = 64
"""Observations from one turn of a row to the next: as many as a word has bits."""
FREE: Final = np.uint8(1)
CALM: Final = np.uint8(2)
LISTED: Final = np.uint8(4)
DENSE: Final = np.uint8(8)
"""Of a row: all its pairs are judged."""
_FEW: Final = 16
"""A row is dense if more than one in so many of its pairs are listed."""
_RARE: Final = 32
"""Or if more than one in so many of its pairs have another sensor that changed."""
_ONE = np.uint64(1)


class Due(NamedTuple):
    """The counting that is put off; `learn_lazily` takes it as a plain tuple."""

    readings: NDArray[np.uint64]
    """``(N,)``: whether a sensor read on at clock ``t``, as bit ``t % 64``."""
    upto: NDArray[np.int64]
    """``(N,)``: at what clock each row's counts are."""
    modes: NDArray[np.uint8]
    """``(N,)``: `FREE` if all pairs of a row are, `DENSE`, or else `CALM`."""
    slack: NDArray[np.uint8]
    """``(P,)``: `FREE`, `CALM` or `LISTED`; of no meaning in a dense row."""
    listed: NDArray[np.uint32]
    """``(2, C)``: the rows and columns of the listed pairs."""
    length: NDArray[np.int64]
    """``(1,)``: how many these are."""

    @classmethod
    def starting(cls, sensors: int, pairs: int, clock: int) -> "Due":
        """Return that of rows which are up to date, and planned at their turns."""
        return cls(
            np.zeros(sensors, np.uint64),
            np.full(sensors, clock, np.int64),
            np.full(sensors, DENSE),
            np.empty(pairs, np.uint8),
            np.empty((2, pairs // _FEW), np.uint32),
            np.zeros(1, np.int64),
        )

    def of_more(self, parted: Parted, pairs: int) -> "Due":
        """Return that of the groups there are now; new rows are dense.

        What is counted of these is still to be settled: see `settle_copies`. If rows
        have moved, all must be settled and dense.
        """
        listed = self.listed
        if pairs // _FEW > listed.shape[1]:
            listed = np.empty((2, pairs // _FEW * 2), np.uint32)
            listed[:, : self.listed.shape[1]] = self.listed
        modes = parted.of_groups(self.modes)
        modes[parted.rows] = DENSE
        slack = np.empty(pairs, np.uint8)
        if not parted.moved:
            slack = longer(self.slack, pairs)
        upto = parted.of_groups(self.upto)
        readings = parted.of_groups(self.readings)
        due = Due(readings, upto, modes, slack, listed, self.length)
        if parted.columns.size and not parted.moved:
            columns, rows = parted.columns, (parted.first, parted.rows.start)
            _copy_slack(parted.source, columns, rows, due)
        return due


class _Limits(NamedTuple):
    """What the weight against an implication must be below, and when."""

    clock: int
    """The number of observations, the present one included."""
    low: np.uint32
    """The limit now."""
    high: np.uint32
    """At the end of the window."""
    window: int
    """How many observations it has."""


@njit()
def learn_lazily(
    bits: NDArray[np.uint8],
    joints: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    clock: int,
    pairs: tuple[Any, ...],
    due: tuple[Any, ...],
    spells: Spells | None,
) -> bool:
    """Count one observation and derive the graph anew ([GK] defn:empirical snapshot).

    ``n_i += x_i``, ``n_ij += x_i x_j``, then ``a -> b`` iff
    ``w_ab* < min(tau clock, w_ab, w_a*b, w_a*b*)``, and ``a <-> b`` iff
    ``w_ab* = w_a*b = 0``. With no bit on and all rows dense it only derives.

    Args:
        bits: ``(N,)``, 0 or 1.
        joints: ``(P,)``, each row as `due` says; updated.
        marginals: ``(N,)``, updated.
        clock: The number of observations, this one included; at least 1.
        pairs: A `Pairs`; updated.
        due: A `Due`; updated.
        spells: Where thresholds choose themselves, which then are
            `neurosnap.poc.learning.automatic_threshold.SHARE`; else None.

    Returns:
        Whether any code changed.
    """
    count, auto = bits.shape[0], spells is not None
    kept, late = Pairs(*pairs), Due(*due)
    share, codes, first = kept.threshold, kept.codes, kept.first
    modes, upto = late.modes, late.upto
    turn = _turns(count, clock, spells)
    _read(bits, clock, marginals, late)
    end = end_of(first, codes.shape[0])
    _list_changed(bits, clock, turn, late, first, end)
    window = TURNS if auto else WINDOW
    low, high = limit_of(share, clock, auto), limit_of(share, clock + window, auto)
    limits = _Limits(clock, low, high, window)
    changed = _judge_listed(joints, marginals, limits, kept, turn, late, auto)
    fresh = np.empty(count, np.uint8)
    squares = np.empty((4, count if auto else 0), np.uint32)
    for i in range(first, end):
        if modes[i] != DENSE and not turn[i]:
            continue
        start = place_of(i, first)
        joint, now = joints[start : start + i], codes[start : start + i]
        if upto[i] < clock - 1:
            settle(i, joint, clock, late)
        else:
            upto[i] = clock
            for j in range(i if bits[i] else 0):
                joint[j] = np.uint32(joint[j] + np.uint32(bits[j]))
        _judge(i, joint, marginals, clock, low, spells, fresh)
        differ = difference(fresh, now)
        if spells is not None and differ & MARK:
            row = row_of(squares, 0, i)
            if turn[i]:
                _fill(i, joint, marginals, clock, row)
            withstand(i, turn[i], row, spells, now, fresh)
            differ = difference(fresh, now)
        if differ:
            rewire(i, fresh, kept, clock)
            changed = True
        if turn[i]:
            slack = late.slack[start : start + i]
            _write_slack(i, bits, joint, marginals, limits, slack)
            modes[i] = _mode(i, slack, late)
    return changed


@njit()
def _turns(count: int, clock: int, spells: Spells | None) -> NDArray[np.bool_]:
    """Return ``(N,)``: whether it is a row's turn."""
    turn = np.empty(count, np.bool_)
    for i in range(count):
        if spells is None:
            turn[i] = (clock + i) % WINDOW == 0
        else:
            turn[i] = spells[1][i]
    return turn


@njit()
def limit_of(share: float, clock: int, auto: bool) -> np.uint32:
    """Return the least whole number that is not below the limit.

    The product is rounded once, as a double, and so does not fall as the clock rises.
    """
    bound = share * clock
    if auto:
        bound = max(bound - START, 1.0)
    return np.uint32(math.ceil(bound))


@njit()
def _read(
    bits: NDArray[np.uint8], clock: int, marginals: NDArray[np.uint32], due: Due
) -> None:
    """Record the readings, and count them in the marginals."""
    place = np.uint64(clock & 63)
    for j in range(bits.shape[0]):
        marginals[j] = np.uint32(marginals[j] + np.uint32(bits[j]))
        others = due.readings[j] & ~(_ONE << place)
        due.readings[j] = others | np.uint64(bits[j]) << place


@njit()
def _list_changed(
    bits: NDArray[np.uint8],
    clock: int,
    turn: NDArray[np.bool_],
    due: Due,
    first: int,
    end: int,
) -> None:
    """List the pairs in which a sensor changed, or let their row be dense.

    The rows are those from `first` to before `end`.
    """
    before = np.uint64((clock - 1) & 63)
    changes, found = np.empty(bits.shape[0], np.int64), 0
    for i in range(bits.shape[0]):
        differs = (due.readings[i] >> before & _ONE) != bits[i]
        if first <= i < end and due.modes[i] == CALM and not turn[i]:
            start = place_of(i, first)
            dense = differs or _RARE * found > i
            for j in changes[: 0 if dense else found]:
                if due.slack[start + j] == CALM:
                    due.slack[start + j] = LISTED
                    dense |= not _list(i, j, due)
            if dense:
                due.modes[i] = DENSE
        if differs:
            changes[found] = i
            found += 1


@njit()
def _judge_listed(
    joints: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    limits: _Limits,
    pairs: Pairs,
    turn: NDArray[np.bool_],
    due: Due,
    auto: bool,
) -> bool:
    """Judge the listed pairs, none of which is at its turn; the calm leave the list.

    Returns:
        Whether any code changed.
    """
    clock, low, high = limits.clock, limits.low, limits.high
    place, window = np.uint64(clock & 63), np.uint32(limits.window)
    changed, kept = False, 0
    for entry in range(due.length[0]):
        i, j = int(due.listed[0, entry]), int(due.listed[1, entry])
        if turn[i] or due.modes[i] == DENSE:
            continue
        pair = place_of(i, pairs.first) + j
        mine, yours = marginals[i], marginals[j]
        both = population(_pending(i, clock, due) & due.readings[j])
        w11 = np.uint32(joints[pair] + np.uint32(both))
        w10, w01 = np.uint32(mine - w11), np.uint32(yours - w11)
        w00 = np.uint32(np.uint32(np.uint32(clock) - mine) - w01)
        code = code_of(w11, w10, w01, w00, low, None)[0]
        was = pairs.codes[pair]
        if auto and code != was and min(min(w11, w10), min(w01, w00)) > 0:
            code = np.uint8(0)
        if code != was:
            flip(i, j, code ^ was, pairs.rows)
            pairs.codes[pair], pairs.since[pair] = code, np.uint32(clock)
            pairs.latest[i] = np.uint32(clock)
            changed = True
        on = (due.readings[i] >> place & _ONE) > 0
        also = (due.readings[j] >> place & _ONE) > 0
        square = w11, w10, w01, w00
        slack = _slack_of(on, also, square, low, high, window)
        due.slack[pair] = slack
        if slack == LISTED:
            due.listed[0, kept], due.listed[1, kept] = np.uint32(i), np.uint32(j)
            kept += 1
    due.length[0] = kept
    return changed


@njit()
def _pending(i: int, clock: int, due: Due) -> np.uint64:
    """Return at which of the last 64 observations, not yet counted, a sensor was on."""
    few = clock - due.upto[i]
    if few >= WINDOW:
        return np.uint64(due.readings[i])
    recent = (_ONE << np.uint64(few)) - _ONE
    place = np.uint64((due.upto[i] + 1) & 63)
    back = np.uint64(-np.int64(place) & 63)
    around = recent >> back if place else recent
    return np.uint64(due.readings[i] & (recent << place | around))


@njit()
def settle(i: int, joint: NDArray[np.uint32], clock: int, due: Due) -> None:
    """Bring the counts of row `i`, ``(i,)``, up to date."""
    mine = _pending(i, clock, due)
    due.upto[i] = clock
    if mine == 0:
        return
    readings = due.readings
    for j in range(joint.shape[0]):
        joint[j] = np.uint32(joint[j] + np.uint32(population(mine & readings[j])))


@njit()
def settle_all(joints: NDArray[np.uint32], clock: int, due: Due, first: int) -> None:
    """Bring the counts of all rows up to date, of which `first` is the first."""
    for i in range(first, end_of(first, joints.shape[0])):
        start = place_of(i, first)
        settle(i, joints[start : start + i], clock, due)


@njit()
def settle_copies(
    source: NDArray[np.int64],
    begin: int,
    first: int,
    joints: NDArray[np.uint32],
    clock: int,
    due: Due,
) -> None:
    """Bring the counts of new rows up to date, which are copies of pairs that were.

    Args:
        source: ``(G,)``: of which row each is a copy; see `Parted`.
        begin: The first new row.
        first: The first row.
        joints: ``(P,)``; updated.
        clock: The number of observations.
        due: That of all rows.
    """
    for row in range(begin, source.shape[0]):
        like, start = source[row], place_of(row, first)
        mine = _pending(like, clock, due)
        due.upto[row] = clock
        for j in range(row if joints.shape[0] else 0):
            # The pair that was copied is in the row of the latter of the two.
            more, other = np.uint64(0), source[j]
            if 0 <= other < like:
                more = mine & due.readings[other]
            elif other > like:
                more = _pending(other, clock, due) & due.readings[like]
            joints[start + j] += np.uint32(population(more))


@njit()
def _copy_slack(
    source: NDArray[np.int64],
    columns: NDArray[np.int64],
    rows: tuple[int, int],
    due: Due,
) -> None:
    """Let the pairs of new columns be free, calm or listed as those they came from."""
    first, end = rows
    for i in range(first, end):
        start = place_of(i, first)
        for j in columns[: 0 if due.modes[i] == DENSE else columns.shape[0]]:
            slack = due.slack[start + source[j]]
            due.slack[start + j] = slack
            if slack == LISTED and not _list(i, j, due):
                due.modes[i] = DENSE


@njit()
def _slack_of(
    on: bool,
    also: bool,
    square: tuple[np.uint32, np.uint32, np.uint32, np.uint32],
    low: np.uint32,
    high: np.uint32,
    window: np.uint32,
) -> np.uint8:
    """Return how long a code stays: `FREE`, `CALM` or `LISTED`.

    Args:
        on: What the one sensor reads.
        also: What the other one does.
        square: The weights of the pair.
        low: The limit now.
        high: The limit at the end of the window.
        window: How many observations it has.
    """
    w11, w10, w01, w00 = square
    r = (w11 if also else w10) if on else (w01 if also else w00)
    a = (w10 if also else w11) if on else (w00 if also else w01)
    b, c = w01 if on else w11, w00 if on else w10
    lesser, larger = min(a, b), max(a, b)
    o, other = min(lesser, c), max(lesser, min(larger, c))
    least, second = min(r, o), min(max(r, o), other)
    # Differences, not sums: these could overflow.
    top = max(least, min(second, low))
    free = (least >= high) | (np.uint32(top - least) > window)
    stays = (r > o) & ((o < low) | (o >= high))
    calm = ((r >= o) & (o == other)) | stays
    return FREE if free else (CALM if calm else LISTED)


@njit()
def _judge(
    i: int,
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    clock: int,
    limit: np.uint32,
    spells: Spells | None,
    fresh: NDArray[np.uint8],
) -> None:
    """Write what one row's counts say of its pairs.

    Args:
        i: The row, a sensor.
        joint: ``(i,)``, of its pairs.
        marginals: ``(N,)``.
        clock: The clock.
        limit: What the weight against must be less than.
        spells: If None, no code is marked.
        fresh: ``(i,)`` or longer, overwritten with the codes.
    """
    mine = marginals[i]
    rest = np.uint32(np.uint32(clock) - mine)
    for j in range(joint.shape[0]):
        w11 = joint[j]
        w10 = np.uint32(mine - w11)
        w01 = np.uint32(marginals[j] - w11)
        w00 = np.uint32(rest - w01)
        code, up, down = code_of(w11, w10, w01, w00, limit, None)
        if spells is not None:
            # What is smallest is against what is implied.
            broken = (up | down) & (min(min(w10, w01), min(w11, w00)) > 0)
            code = np.uint8(code | MARK) if broken else code
        fresh[j] = code


@njit()
def _fill(
    i: int,
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    clock: int,
    row: Row,
) -> None:
    """Write the four weights of one row's pairs."""
    mine = marginals[i]
    rest = np.uint32(np.uint32(clock) - mine)
    for j in range(joint.shape[0]):
        row.both[j], row.only_i[j] = joint[j], np.uint32(mine - joint[j])
        row.only_j[j] = np.uint32(marginals[j] - joint[j])
        row.neither[j] = np.uint32(rest - row.only_j[j])


@njit()
def _mode(i: int, slack: NDArray[np.uint8], due: Due) -> np.uint8:
    """Return the mode of a row whose pairs have this slack, and list those to be."""
    kinds, listed = np.uint8(0), 0
    for j in range(i):
        kinds |= slack[j]
    if kinds == FREE:
        return FREE
    for j in range(i if kinds & LISTED else 0):
        listed += slack[j] == LISTED
    if _FEW * listed > i or due.length[0] + listed > due.listed.shape[1]:
        return DENSE
    for j in range(i if listed else 0):
        if slack[j] == LISTED:
            _list(i, j, due)
    return CALM


@njit()
def _write_slack(
    i: int,
    bits: NDArray[np.uint8],
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    limits: _Limits,
    slack: NDArray[np.uint8],
) -> None:
    """Write the slack of one row's pairs until its next turn."""
    on, mine, low, high = bits[i] > 0, marginals[i], limits.low, limits.high
    rest, window = np.uint32(np.uint32(limits.clock) - mine), np.uint32(limits.window)
    for j in range(joint.shape[0]):
        w11 = joint[j]
        w10 = np.uint32(mine - w11)
        w01 = np.uint32(marginals[j] - w11)
        square = w11, w10, w01, np.uint32(rest - w01)
        slack[j] = _slack_of(on, bits[j] > 0, square, low, high, window)


@njit()
def _list(i: int, j: int, due: Due) -> bool:
    """List a pair; return whether there was room."""
    length = due.length[0]
    if length == due.listed.shape[1]:
        return False
    due.listed[0, length], due.listed[1, length] = np.uint32(i), np.uint32(j)
    due.length[0] = length + 1
    return True


@njit()
def count_squares(
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    squares: NDArray[np.uint32],
    born: NDArray[np.uint32],
    clock: int,
    pairs: tuple[Any, ...],
    spells: Spells | None,
) -> bool:
    """Count what is known of one observation and derive the graph anew.

    ``w_ab += [a and b both on]`` where both sensors are known, then ``a -> b`` iff
    ``w_ab* < min(tau t, w_ab, w_a*b, w_a*b*)`` and ``a <-> b`` iff ``w_ab* = w_a*b = 0
    < t``, with ``t`` the sum of the four weights. With no bit known it only derives.

    A pair is judged once ``t >= age / 2`` or ``tau t >= 1``, with its age counted from
    the birth of the younger. A sensor that was read once would otherwise be equivalent
    to one literal of each that was read with it, and so make equivalent what is known
    to differ.

    Args:
        bits: ``(N,)``, 0 or 1; any where unknown.
        known: ``(N,)``, 0 or 1.
        squares: ``(4, P)``, updated; each column adds up to less than ``2**32``.
        born: ``(N,)``, the clock when each sensor began, ascending; 0 for those that
            were there from the start.
        clock: Observations so far, this one included.
        pairs: A `Pairs`; updated.
        spells: Where thresholds choose themselves, which then are
            `neurosnap.poc.learning.automatic_threshold.SHARE`; else None.

    Returns:
        Whether any code changed. O(N²/2) time.
    """
    count, kept = bits.shape[0], Pairs(*pairs)
    on, off = bits & known, known & ~bits
    codes, first = kept.codes, kept.first
    fresh = np.empty(count, np.uint8)
    changed, reads = False, known.any()
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        now = codes[start : start + i]
        # Of a sensor that is not read nothing new follows, but what grew too old.
        if reads and not known[i] and not now.any():
            continue
        row = row_of(squares, start, start + i)
        if known[i]:
            with_j = row.both if bits[i] else row.only_j
            without_j = row.only_i if bits[i] else row.neither
            for j in range(i):
                with_j[j] = np.uint32(with_j[j] + np.uint32(on[j]))
                without_j[j] = np.uint32(without_j[j] + np.uint32(off[j]))
        judge_squares(row, float(clock - int(born[i])), kept.threshold, spells, fresh)
        if spells is not None:
            withstand(i, spells[1][i], row, spells, now, fresh)
        if difference(fresh, now):
            rewire(i, fresh, kept, clock)
            changed = True
    return changed


@njit()
def judge_squares(
    row: Row,
    age: float,
    share: float,
    spells: Spells | None,
    fresh: NDArray[np.uint8],
) -> None:
    """Write what one row's counts say of its pairs.

    Args:
        row: The counts.
        age: Observations since its sensor began.
        share: The threshold.
        spells: If None, no code is marked.
        fresh: ``(i,)`` or longer, overwritten with their codes.
    """
    both, only_i, only_j, neither = row.both, row.only_i, row.only_j, row.neither
    for j in range(both.shape[0]):
        w11, w10, w01, w00 = both[j], only_i[j], only_j[j], neither[j]
        total = np.uint32(np.uint32(w11 + w10) + np.uint32(w01 + w00))
        # The product is rounded once; a whole number is compared exactly with it.
        whole = float(total)
        limit = share * whole
        if spells is not None:
            limit -= START
        bound = limit if spells is None else max(limit, 1.0)
        code, up, down = code_of(w11, w10, w01, w00, bound, None)
        if spells is not None:
            # What is smallest is against what is implied.
            broken = (up | down) & (min(min(w10, w01), min(w11, w00)) > 0)
            code = np.uint8(code | MARK) if broken else code
        judged = (2.0 * whole >= age) | (limit >= 1.0)
        fresh[j] = code if judged & (total > 0) else np.uint8(0)
