"""Counts of all pairs of sensors in readings that are there as a whole.

An *occasion* is a maximal run of consecutive ticks at which two sensors, both known,
have the same two readings. A door that stays open for a night is one occasion, however
often it was read. The four joint readings of a pair are in the order of
`neurosnap.poc.learning.pairs`: both on, only the first, only the second,
neither; pairs are in that of `neurosnap.poc.learning.pairs`.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.update_kernels import Pairs, pair_code
from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit

_ONE, _TWO, _FOUR = np.uint64(1), np.uint64(2), np.uint64(4)
_TOP, _HIGH = np.uint64(63), np.uint64(56)
_PAIRS, _QUADS = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333)
_NIBBLES, _OCTETS = np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(0x0101010101010101)
_BLOCK = 16
_WORK = 1 << 26
"""Words that are gone through between two reports of progress, about."""

_Whole: TypeAlias = np.int64
_Four: TypeAlias = tuple[_Whole, _Whole, _Whole, _Whole]
OnProgress: TypeAlias = Callable[[int, int], object]
"""Told how many pairs are done, and of how many."""


class PairCounts(NamedTuple):
    """How often each pair of sensors had each of its four joint readings."""

    ticks: NDArray[np.uint32]
    """``(4, P)``: at how many ticks."""
    occasions: NDArray[np.uint32]
    """``(4, P)``: on how many occasions."""


def count_pairs(columns: Columns, on_progress: OnProgress | None = None) -> PairCounts:
    """Count the joint readings of all pairs. O(N² T / 64) time, O(N²) space.

    Args:
        columns: ``T`` ticks of ``N`` sensors, ``T`` below ``2**32``.
        on_progress: Told now and then.
    """
    count, words = columns.on.shape
    pairs = count * (count - 1) // 2
    counts = PairCounts(
        np.zeros((4, pairs), np.uint32), np.zeros((4, pairs), np.uint32)
    )
    for first, last in _stretches(count, words):
        count_rows(columns.on, columns.off, first, last, *counts)
        if on_progress is not None:
            on_progress(last * (last - 1) // 2, pairs)
    return counts


def last_changes(
    columns: Columns,
    ticks: NDArray[np.uint32],
    pairs: Pairs,
    on_progress: OnProgress | None = None,
) -> None:
    """Date the code of each pair, as learning the rows one after the other would have.

    Args:
        columns: The readings.
        ticks: ``(4, P)``: their counts.
        pairs: The codes that follow from these; `Pairs.since` is overwritten.
        on_progress: Told now and then.
    """
    on, off = columns.on, columns.off
    for first, last in _stretches(*on.shape):
        date_rows(on, off, columns.ticks, first, last, ticks, pairs)
        if on_progress is not None:
            on_progress(last * (last - 1) // 2, pairs.codes.size)


def _stretches(count: int, words: int) -> list[tuple[int, int]]:
    """Return stretches of rows that take about the same work each."""
    stretches, first, work = [], 0, 0
    for row in range(count):
        work += row * words
        if work >= _WORK or row == count - 1:
            stretches.append((first, row + 1))
            first, work = row + 1, 0
    return stretches


@njit()
def population(word: np.uint64) -> np.uint64:
    """Return how many bits of a word are set; LLVM makes one instruction of it."""
    word -= word >> _ONE & _PAIRS
    word = (word & _QUADS) + (word >> _TWO & _QUADS)
    word = word + (word >> _FOUR) & _NIBBLES
    return np.uint64(word * _OCTETS >> _HIGH)


@njit()
def count_rows(
    on: Words,
    off: Words,
    first: int,
    last: int,
    ticks: NDArray[np.uint32],
    occasions: NDArray[np.uint32],
) -> None:
    """Count the pairs of sensors `first` to before `last` with those before each.

    Args:
        on: ``(N, W)``.
        off: ``(N, W)``.
        first: A sensor.
        last: Behind the last.
        ticks: ``(4, P)``, overwritten for these.
        occasions: ``(4, P)``, overwritten for these.
    """
    zero = np.uint64(0)
    for i in range(first, last):
        for j in range(i):
            n11 = n10 = n01 = n00 = zero
            r11 = r10 = r01 = r00 = zero
            p = q = s = t = zero  # the last readings of the word before
            for w in range(on.shape[1]):
                x, y, u, v = on[i, w], off[i, w], on[j, w], off[j, w]
                joint = x & u
                n11 += population(joint)
                r11 += population(joint & ~(joint << _ONE | p & s))
                joint = x & v
                n10 += population(joint)
                r10 += population(joint & ~(joint << _ONE | p & t))
                joint = y & u
                n01 += population(joint)
                r01 += population(joint & ~(joint << _ONE | q & s))
                joint = y & v
                n00 += population(joint)
                r00 += population(joint & ~(joint << _ONE | q & t))
                p, q, s, t = x >> _TOP, y >> _TOP, u >> _TOP, v >> _TOP
            pair = i * (i - 1) // 2 + j
            ticks[0, pair], ticks[1, pair] = np.uint32(n11), np.uint32(n10)
            ticks[2, pair], ticks[3, pair] = np.uint32(n01), np.uint32(n00)
            occasions[0, pair], occasions[1, pair] = np.uint32(r11), np.uint32(r10)
            occasions[2, pair], occasions[3, pair] = np.uint32(r01), np.uint32(r00)


@njit()
def date_rows(
    on: Words,
    off: Words,
    length: int,
    first: int,
    last: int,
    ticks: NDArray[np.uint32],
    pairs: Pairs,
) -> None:
    """Find the last change of the pairs of sensors `first` to before `last`.

    Args:
        on: ``(N, W)``.
        off: ``(N, W)``.
        length: How many ticks there are.
        first: A sensor.
        last: Behind the last.
        ticks: ``(4, P)``: the counts at the end.
        pairs: The codes that follow from them; `Pairs.since` is overwritten.
    """
    for i in range(first, last):
        for j in range(i):
            pair = i * (i - 1) // 2 + j
            share = pairs.threshold[pair if pairs.threshold.shape[0] > 1 else 0]
            joint = on[i], off[i], on[j], off[j]
            counts = (
                np.int64(ticks[0, pair]),
                np.int64(ticks[1, pair]),
                np.int64(ticks[2, pair]),
                np.int64(ticks[3, pair]),
            )
            since = _last_change(joint, length, counts, pairs.codes[pair], share)
            pairs.since[pair] = np.uint32(since)


@njit()
def _last_change(
    joint: tuple[Words, Words, Words, Words],
    length: int,
    counts: _Four,
    code: np.uint8,
    share: float,
) -> int:
    """Return the tick from which on the counts of a pair gave its code; 0: from ever.

    From the end back: a stretch at whose both ends the counts allow for no other code
    is passed as a whole, for counts only grow.

    Args:
        joint: ``(W,)`` each: when the one sensor was on, and off; then the other.
        length: How many ticks there are.
        counts: At the end.
        code: What follows from them.
        share: The threshold.
    """
    clock, stop, step = length, joint[0].shape[0], _BLOCK
    while stop > 0:
        start = max(0, stop - step)
        before = _before(joint, start, stop, counts)
        if _keeps(code, before, counts, 64 * start, clock, share):
            counts, clock, stop, step = before, 64 * start, start, _BLOCK
            continue
        if step > 1:
            step = 1
            continue
        while clock > 64 * start:
            counts = _one_before(
                joint, start, np.uint64(clock - 1 - 64 * start), counts
            )
            clock -= 1
            if _code_of(counts, float(clock), share) != code:
                return clock + 1
        stop, step = start, _BLOCK
    return 0


@njit()
def _before(
    joint: tuple[Words, Words, Words, Words], start: int, stop: int, counts: _Four
) -> _Four:
    """Return the counts less those of some words of readings."""
    on_i, off_i, on_j, off_j = joint
    n11 = n10 = n01 = n00 = np.uint64(0)
    for w in range(start, stop):
        x, y, u, v = on_i[w], off_i[w], on_j[w], off_j[w]
        n11 += population(x & u)
        n10 += population(x & v)
        n01 += population(y & u)
        n00 += population(y & v)
    h11, h10, h01, h00 = counts
    return (
        h11 - np.int64(n11),
        h10 - np.int64(n10),
        h01 - np.int64(n01),
        h00 - np.int64(n00),
    )


@njit()
def _one_before(
    joint: tuple[Words, Words, Words, Words], w: int, place: np.uint64, counts: _Four
) -> _Four:
    """Return the counts less one tick: bit `place` of word `w`."""
    x, y = joint[0][w] >> place & _ONE, joint[1][w] >> place & _ONE
    u, v = joint[2][w] >> place & _ONE, joint[3][w] >> place & _ONE
    h11, h10, h01, h00 = counts
    return (
        h11 - np.int64(x & u),
        h10 - np.int64(x & v),
        h01 - np.int64(y & u),
        h00 - np.int64(y & v),
    )


@njit()
def _code_of(counts: _Four, age: float, share: float) -> np.uint8:
    """Return what follows from four counts, as `count_squares` has it."""
    w11, w10, w01, w00 = counts
    whole = float(w11 + w10 + w01 + w00)
    limit = share * whole
    if whole == 0.0 or not (2.0 * whole >= age or limit >= 1.0):
        return np.uint8(0)
    return pair_code(w11, w10, w01, w00, limit, None, np.uint8)[0]


@njit()
def _keeps(
    code: np.uint8, low: _Four, high: _Four, begin: int, end: int, share: float
) -> bool:
    """Return whether nothing but `code` can follow between two ticks.

    Args:
        code: What follows at the end.
        low: The four counts at the beginning.
        high: Those at the end.
        begin: The clock at the beginning.
        end: The clock at the end.
        share: The threshold.
    """
    l11, l10, l01, l00 = low
    h11, h10, h01, h00 = high
    least, whole = float(l11 + l10 + l01 + l00), float(h11 + h10 + h01 + h00)
    below, above = share * least, share * whole
    if 2.0 * whole < float(begin) and above < 1.0:
        return bool(code == 0)
    if least == 0.0 or not (2.0 * least >= float(end) or below >= 1.0):
        return False
    if code == 0:
        if max(l10, l01) == 0 or max(l11, l00) == 0:
            return False
        mixed, like = min(l10, l01), min(l11, l00)
        if mixed < min(h11, h00) and float(mixed) < above:
            return False
        return bool(like >= min(h10, h01) or float(like) >= above)
    if code == 3:
        return bool(max(h10, h01) == 0 and max(l11, l00) > 0)
    if code == 12:
        return bool(max(h11, h00) == 0)
    if code == 1:
        return bool(h10 < min(l01, min(l11, l00)) and float(h10) < below)
    if code == 2:
        return bool(h01 < min(l10, min(l11, l00)) and float(h01) < below)
    if code == 4:
        return bool(h11 < min(l00, min(l10, l01)) and float(h11) < below)
    return bool(h00 < min(l11, min(l10, l01)) and float(h00) < below)
