"""Compiled loops of learning that judge a pair only where its code might change.

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
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import MARK, START, TURNS, withstand
from neurosnap.poc.learning.pair_counts import population
from neurosnap.poc.learning.update_kernels import (
    difference,
    end_of,
    fill,
    flip,
    judge,
    pair_code,
    place_of,
    rewire,
)
from neurosnap.poc.order.literals import Words
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
_SAMPLE: Final = 64
_ONE = np.uint64(1)


class Lag(NamedTuple):
    """What is put off."""

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
    def starting(cls, sensors: int, pairs: int, clock: int) -> "Lag":
        """Return that of rows which are up to date, and planned at their turns."""
        return cls(
            np.zeros(sensors, np.uint64),
            np.full(sensors, clock, np.int64),
            np.full(sensors, DENSE),
            np.empty(pairs, np.uint8),
            np.empty((2, pairs // _FEW), np.uint32),
            np.zeros(1, np.int64),
        )


@njit()
def learn_lazily(
    bits: NDArray[np.uint8],
    joints: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    clock: int,
    tick: int,
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32],
    latest: NDArray[np.uint32],
    lag: Lag,
    spells: NDArray[np.uint32] | None = None,
    turns: NDArray[np.uint8] | None = None,
    first: int = 0,
) -> bool:
    """Count one observation and derive the graph anew ([GK] defn:empirical snapshot).

    ``n_i += x_i``, ``n_ij += x_i x_j``, then ``a -> b`` iff
    ``w_ab* < min(tau clock, w_ab, w_a*b, w_a*b*)``, and ``a <-> b`` iff
    ``w_ab* = w_a*b = 0``. With no bit on and all rows dense it only derives.

    Args:
        bits: ``(N,)``, 0 or 1.
        joints: ``(N (N - 1) / 2,)``, each row as `lag` says; updated. Or as many as
            some rows have.
        marginals: ``(N,)``, updated.
        clock: The number of observations, this one included; at least 1.
        tick: What changes are dated with.
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: One a pair, updated.
        rows: As of `neurosnap.poc.learning.update_kernels.rewire`.
        since: One a pair, the tick at which its code last changed; updated.
        latest: As of `neurosnap.poc.learning.update_kernels.rewire`.
        lag: Updated.
        spells: ``(2, 2N)``, where thresholds choose themselves: as
            `neurosnap.poc.learning.automatic_threshold` has it, whose `SHARE` the
            threshold then is.
        turns: ``(N,)``, which sensors' pairs are tested now; goes with `spells`.
        first: The first row that there are numbers of.

    Returns:
        Whether any code changed.
    """
    count, auto = bits.shape[0], spells is not None
    window = TURNS if auto else WINDOW
    turn = np.empty(count, np.bool_)
    for i in range(count):
        turn[i] = turns[i] if turns is not None else (clock + i) % WINDOW == 0
    _read(bits, clock, marginals, lag)
    end = end_of(first, codes.shape[0])
    busy = _RARE * _list_changed(bits, clock, turn, lag, first, end) > count
    changed = _judge_listed(
        joints,
        marginals,
        clock,
        tick,
        threshold,
        auto,
        codes,
        rows,
        since,
        latest,
        turn,
        lag,
        first,
    )
    ticks = np.uint32(clock)
    limit = np.full(count, limit_of(threshold[0], clock, auto))
    high = np.full(count, limit_of(threshold[0], clock + window, auto))
    fresh = np.empty(count, np.uint8)
    squares = np.empty((4, count if auto else 0), np.uint32)
    for i in range(first, end):
        if lag.modes[i] != DENSE and not turn[i]:
            continue
        start = place_of(i, first)
        joint, now = joints[start : start + i], codes[start : start + i]
        if lag.upto[i] < clock - 1:
            settle(i, joint, clock, lag)
        else:
            lag.upto[i] = clock
            for j in range(i if bits[i] else 0):
                joint[j] = np.uint32(joint[j] + np.uint32(bits[j]))
        if threshold.shape[0] > 1:
            for j in range(i):
                limit[j] = limit_of(threshold[start + j], clock, auto)
        mine = marginals[i]
        judge(joint, marginals, mine, ticks, limit, spells, fresh)
        differ = difference(fresh, now)
        if spells is not None and differ & MARK:
            if turn[i]:
                fill(joint, marginals, mine, ticks, squares)
            withstand(i, turn[i], squares, spells, now, fresh)
        if differ:
            dates = since[start : start + i]
            changed |= rewire(i, fresh, now, rows, dates, latest, tick)
        if turn[i]:
            if threshold.shape[0] > 1:
                for j in range(i):
                    high[j] = limit_of(threshold[start + j], clock + window, auto)
            slack = lag.slack[start : start + i]
            _plan(
                i, bits, joint, marginals, ticks, limit, high, window, busy, slack, lag
            )
    return changed


@njit()
def limit_of(share: float, clock: int, auto: bool) -> np.uint32:
    """Return what a whole number must be below to be below the limit.

    The product is rounded once, as a double, and so does not fall as the clock rises.
    """
    bound = share * clock
    if auto:
        bound = max(bound - START, 1.0)
    return np.uint32(math.ceil(bound))


@njit()
def _read(
    bits: NDArray[np.uint8], clock: int, marginals: NDArray[np.uint32], lag: Lag
) -> None:
    """Take in the readings."""
    place = np.uint64(clock & 63)
    for j in range(bits.shape[0]):
        marginals[j] = np.uint32(marginals[j] + np.uint32(bits[j]))
        others = lag.readings[j] & ~(_ONE << place)
        lag.readings[j] = others | np.uint64(bits[j]) << place


@njit()
def _list_changed(
    bits: NDArray[np.uint8],
    clock: int,
    turn: NDArray[np.bool_],
    lag: Lag,
    first: int,
    end: int,
) -> int:
    """List the pairs in which a sensor changed, or let their row be dense.

    The rows are those from `first` to before `end`.

    Returns:
        How many sensors changed.
    """
    before = np.uint64((clock - 1) & 63)
    changes, found = np.empty(bits.shape[0], np.int64), 0
    for i in range(bits.shape[0]):
        differs = (lag.readings[i] >> before & _ONE) != bits[i]
        if first <= i < end and lag.modes[i] == CALM and not turn[i]:
            start = place_of(i, first)
            dense = differs or _RARE * found > i
            for j in changes[: 0 if dense else found]:
                if lag.slack[start + j] == CALM:
                    lag.slack[start + j] = LISTED
                    dense |= not _list(i, j, lag)
            if dense:
                lag.modes[i] = DENSE
        if differs:
            changes[found] = i
            found += 1
    return found


@njit()
def _judge_listed(
    joints: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    clock: int,
    tick: int,
    threshold: NDArray[np.float64],
    auto: bool,
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32],
    latest: NDArray[np.uint32],
    turn: NDArray[np.bool_],
    lag: Lag,
    first: int,
) -> bool:
    """Judge the listed pairs, none of which is at its turn; the calm leave the list.

    Returns:
        Whether any code changed.
    """
    window = TURNS if auto else WINDOW
    length, place = np.uint32(window), np.uint64(clock & 63)
    low = limit_of(threshold[0], clock, auto)
    high = limit_of(threshold[0], clock + window, auto)
    changed, kept = False, 0
    for entry in range(lag.length[0]):
        i, j = int(lag.listed[0, entry]), int(lag.listed[1, entry])
        if turn[i] or lag.modes[i] == DENSE:
            continue
        pair = place_of(i, first) + j
        if threshold.shape[0] > 1:
            low = limit_of(threshold[pair], clock, auto)
            high = limit_of(threshold[pair], clock + window, auto)
        mine, yours = marginals[i], marginals[j]
        both = population(_pending(i, clock, lag) & lag.readings[j])
        w11 = np.uint32(joints[pair] + np.uint32(both))
        w10, w01 = np.uint32(mine - w11), np.uint32(yours - w11)
        w00 = np.uint32(np.uint32(np.uint32(clock) - mine) - w01)
        code = np.uint8(pair_code(w11, w10, w01, w00, low, None)[0])
        was = codes[pair]
        if auto and code != was and min(min(w11, w10), min(w01, w00)) > 0:
            code = np.uint8(0)
        if code != was:
            flip(i, j, code ^ was, rows)
            codes[pair], since[pair], changed = code, np.uint32(tick), True
            latest[i] = np.uint32(tick)
        on = (lag.readings[i] >> place & _ONE) > 0
        also = (lag.readings[j] >> place & _ONE) > 0
        slack = _slack_of(on, also, w11, w10, w01, w00, low, high, length)
        lag.slack[pair] = slack
        if slack == LISTED:
            lag.listed[0, kept], lag.listed[1, kept] = np.uint32(i), np.uint32(j)
            kept += 1
    lag.length[0] = kept
    return changed


@njit()
def _pending(i: int, clock: int, lag: Lag) -> np.uint64:
    """Return at which of the last 64 observations, not yet counted, a sensor was on."""
    few = clock - lag.upto[i]
    if few >= WINDOW:
        return np.uint64(lag.readings[i])
    recent = (_ONE << np.uint64(few)) - _ONE
    place = np.uint64((lag.upto[i] + 1) & 63)
    back = np.uint64(-np.int64(place) & 63)
    around = recent >> back if place else recent
    return np.uint64(lag.readings[i] & (recent << place | around))


@njit()
def settle(i: int, joint: NDArray[np.uint32], clock: int, lag: Lag) -> None:
    """Bring the counts of one row up to date.

    Args:
        i: The row.
        joint: ``(i,)``, updated.
        clock: The clock.
        lag: Updated.
    """
    mine = _pending(i, clock, lag)
    lag.upto[i] = clock
    if mine == 0:
        return
    readings = lag.readings
    for j in range(joint.shape[0]):
        joint[j] = np.uint32(joint[j] + np.uint32(population(mine & readings[j])))


@njit()
def settle_all(
    joints: NDArray[np.uint32], clock: int, lag: Lag, first: int = 0
) -> None:
    """Bring the counts of all rows up to date, of which `first` is the first."""
    for i in range(first, end_of(first, joints.shape[0])):
        start = place_of(i, first)
        settle(i, joints[start : start + i], clock, lag)


@njit()
def _slack_of(
    on: bool,
    also: bool,
    w11: np.uint32,
    w10: np.uint32,
    w01: np.uint32,
    w00: np.uint32,
    low: np.uint32,
    high: np.uint32,
    window: np.uint32,
) -> np.uint8:
    """Return how long a code stays: `FREE`, `CALM` or `LISTED`.

    Args:
        on: What the one sensor reads.
        also: What the other one does.
        w11: The weights of the pair.
        w10: And so on.
        w01: And so on.
        w00: And so on.
        low: The limit now.
        high: The limit at the end of the window.
        window: How many observations it has.
    """
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
def _plan(
    i: int,
    bits: NDArray[np.uint8],
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    ticks: np.uint32,
    low: NDArray[np.uint32],
    high: NDArray[np.uint32],
    window: int,
    busy: bool,
    slack: NDArray[np.uint8],
    lag: Lag,
) -> None:
    """Find out which pairs of one row may change until its next turn."""
    mine = marginals[i]
    on = bits[i] > 0
    # Where much changes, a row that is not free becomes dense at once: a few of its
    # pairs tell.
    few = joint[: _SAMPLE if busy else 0]
    _slacks(on, bits, few, marginals, mine, ticks, low, high, window, slack)
    if _kinds(slack[: few.shape[0]]) & ~FREE:
        lag.modes[i] = DENSE
        return
    _slacks(on, bits, joint, marginals, mine, ticks, low, high, window, slack)
    kinds = _kinds(slack)
    listed = 0
    for j in range(i if kinds & LISTED else 0):
        listed += slack[j] == LISTED
    if kinds == FREE:
        lag.modes[i] = FREE
    elif _FEW * listed > i or lag.length[0] + listed > lag.listed.shape[1]:
        lag.modes[i] = DENSE
    else:
        lag.modes[i] = CALM
        for j in range(i if listed else 0):
            if slack[j] == LISTED:
                _list(i, j, lag)


@njit()
def _kinds(slack: NDArray[np.uint8]) -> np.uint8:
    """Return all the kinds of slack that there are."""
    kinds = np.uint8(0)
    for j in range(slack.shape[0]):
        kinds |= slack[j]
    return kinds


@njit()
def _slacks(
    on: bool,
    bits: NDArray[np.uint8],
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    mine: np.uint32,
    ticks: np.uint32,
    low: NDArray[np.uint32],
    high: NDArray[np.uint32],
    window: int,
    slack: NDArray[np.uint8],
) -> None:
    """Write the slack of one row's pairs; `on` and `mine` are of its sensor."""
    rest, length = np.uint32(ticks - mine), np.uint32(window)
    for j in range(joint.shape[0]):
        w11 = joint[j]
        w10 = np.uint32(mine - w11)
        w01 = np.uint32(marginals[j] - w11)
        w00 = np.uint32(rest - w01)
        also = bits[j] > 0
        slack[j] = _slack_of(on, also, w11, w10, w01, w00, low[j], high[j], length)


@njit()
def _list(i: int, j: int, lag: Lag) -> bool:
    """List a pair; return whether there was room."""
    length = lag.length[0]
    if length == lag.listed.shape[1]:
        return False
    lag.listed[0, length], lag.listed[1, length] = np.uint32(i), np.uint32(j)
    lag.length[0] = length + 1
    return True
