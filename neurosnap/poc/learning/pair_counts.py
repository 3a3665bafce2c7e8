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
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    on_progress: OnProgress | None = None,
) -> NDArray[np.uint32]:
    """Return when what follows from each pair's counts last became what it is.

    Args:
        columns: The readings.
        ticks: ``(4, P)``: their counts.
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: ``(P,)``: what follows from these.
        on_progress: Told now and then.

    Returns:
        ``(P,)``, ticks from 1; 0 where it never was otherwise.
    """
    count, words = columns.on.shape
    since = np.zeros(codes.size, np.uint32)
    for first, last in _stretches(count, words):
        date_rows(
            columns.on,
            columns.off,
            columns.ticks,
            first,
            last,
            ticks,
            threshold,
            codes,
            since,
        )
        if on_progress is not None:
            on_progress(last * (last - 1) // 2, codes.size)
    return since


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
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    since: NDArray[np.uint32],
) -> None:
    """Find the last change of the pairs of sensors `first` to before `last`.

    From the end back: a stretch at whose both ends the counts allow for no other code
    is passed as a whole, for counts only grow.

    Args:
        on: ``(N, W)``.
        off: ``(N, W)``.
        length: How many ticks there are.
        first: A sensor.
        last: Behind the last.
        ticks: ``(4, P)``: the counts at the end.
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: ``(P,)``: what follows from them.
        since: ``(P,)``, overwritten for these.
    """
    words = on.shape[1]
    one = np.uint64(1)
    for i in range(first, last):
        for j in range(i):
            pair = i * (i - 1) // 2 + j
            share = threshold[pair] if threshold.shape[0] > 1 else threshold[0]
            code = codes[pair]
            h11, h10 = np.int64(ticks[0, pair]), np.int64(ticks[1, pair])
            h01, h00 = np.int64(ticks[2, pair]), np.int64(ticks[3, pair])
            clock, stop, step = length, words, _BLOCK
            found = 0
            while stop > 0:
                start = max(0, stop - step)
                n11 = n10 = n01 = n00 = np.uint64(0)
                for w in range(start, stop):
                    x, y, u, v = on[i, w], off[i, w], on[j, w], off[j, w]
                    n11 += population(x & u)
                    n10 += population(x & v)
                    n01 += population(y & u)
                    n00 += population(y & v)
                l11, l10 = h11 - np.int64(n11), h10 - np.int64(n10)
                l01, l00 = h01 - np.int64(n01), h00 - np.int64(n00)
                if _keeps(
                    code,
                    (l11, l10, l01, l00),
                    (h11, h10, h01, h00),
                    64 * start,
                    clock,
                    share,
                ):
                    h11, h10, h01, h00 = l11, l10, l01, l00
                    clock, stop, step = 64 * start, start, _BLOCK
                    continue
                if step > 1:
                    step = 1
                    continue
                x, y, u, v = on[i, start], off[i, start], on[j, start], off[j, start]
                while clock > 64 * start:
                    place = np.uint64(clock - 1 - 64 * start)
                    h11 -= np.int64((x & u) >> place & one)
                    h10 -= np.int64((x & v) >> place & one)
                    h01 -= np.int64((y & u) >> place & one)
                    h00 -= np.int64((y & v) >> place & one)
                    clock -= 1
                    if code_of(h11, h10, h01, h00, float(clock), share) != code:
                        found = clock + 1
                        break
                if found:
                    break
                stop, step = start, _BLOCK
            since[pair] = np.uint32(found)


@njit()
def code_of(
    w11: _Whole, w10: _Whole, w01: _Whole, w00: _Whole, age: float, share: float
) -> np.uint8:
    """Return what follows from four counts, as `update_kernels_partial` has it."""
    mixed, like = min(w10, w01), min(w11, w00)
    more, most = max(w10, w01), max(w11, w00)
    whole = float(w11 + w10 + w01 + w00)
    limit = share * whole
    if whole == 0.0 or not (2.0 * whole >= age or limit >= 1.0):
        return np.uint8(0)
    if most == 0:
        return np.uint8(12)
    if more == 0:
        return np.uint8(3)
    if like < min(most, mixed) and float(like) < limit:
        return np.uint8(4) if w11 < w00 else np.uint8(8)
    if mixed < min(more, like) and float(mixed) < limit:
        return np.uint8(1) if w10 < w01 else np.uint8(2)
    return np.uint8(0)


@njit()
def _keeps(
    code: np.uint8,
    low: _Four,
    high: _Four,
    begin: int,
    end: int,
    share: float,
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
