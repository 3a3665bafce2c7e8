"""Counts how often each pair of sensors reads each pair of values, in a whole table.

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
from neurosnap.poc.order.literal_set_kernels import population
from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

_ONE, _TOP = np.uint64(1), np.uint64(63)
OnProgress: TypeAlias = Callable[[int, int], object]
"""Told how many pairs are done, and of how many."""


class PairCounts(NamedTuple):
    """How often each pair of sensors had each of its four joint readings."""

    ticks: NDArray[np.uint32]
    """``(4, P)``: at how many ticks."""
    occasions: NDArray[np.uint32]
    """``(4, P)``: on how many occasions."""


def count_pairs(
    columns: Columns,
    on_progress: OnProgress | None = None,
    first: tuple[int, PairCounts] | None = None,
) -> PairCounts:
    """Count the joint readings of all pairs. O(N² T / 64) time, O(N²) space.

    Args:
        columns: ``T`` ticks of ``N`` sensors, ``T`` below ``2**32``.
        on_progress: Told now and then.
        first: So many words of 64 ticks are counted already; these counts grow.
    """
    count = len(columns.on)
    pairs = count * (count - 1) // 2
    none = np.zeros((2, 4, pairs), np.uint32)
    start, counts = first or (0, PairCounts(*none))
    for row in range(count):
        count_row(columns.on, columns.off, row, start, *counts)
        if on_progress is not None:
            on_progress(row * (row + 1) // 2, pairs)
    return counts


@njit()
def count_row(
    on: Words,
    off: Words,
    i: int,
    start: int,
    ticks: NDArray[np.uint32],
    occasions: NDArray[np.uint32],
) -> None:
    """Count the pairs of a sensor with those before it.

    Args:
        on: ``(N, W)``.
        off: ``(N, W)``.
        i: The sensor.
        start: The first word that counts. A run that began before is no new occasion.
        ticks: ``(4, P)``, added to for these.
        occasions: ``(4, P)``, added to for these.
    """
    zero = np.uint64(0)
    own_on, own_off = on[i, start:], off[i, start:]
    for j in range(i):
        other_on, other_off = on[j, start:], off[j, start:]
        n11 = n10 = n01 = n00 = zero
        r11 = r10 = r01 = r00 = zero
        p = q = s = t = zero  # the last readings of the word before
        if start:
            p, q = on[i, start - 1] >> _TOP, off[i, start - 1] >> _TOP
            s, t = on[j, start - 1] >> _TOP, off[j, start - 1] >> _TOP
        for w in range(len(own_on)):
            x, y, u, v = own_on[w], own_off[w], other_on[w], other_off[w]
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
        ticks[0, pair] += np.uint32(n11)
        ticks[1, pair] += np.uint32(n10)
        ticks[2, pair] += np.uint32(n01)
        ticks[3, pair] += np.uint32(n00)
        occasions[0, pair] += np.uint32(r11)
        occasions[1, pair] += np.uint32(r10)
        occasions[2, pair] += np.uint32(r01)
        occasions[3, pair] += np.uint32(r00)
