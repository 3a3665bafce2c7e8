"""Compiled loops that count pairs of sensors where readings may be unknown.

What `neurosnap.poc.learning.counting_kernels` does with one joint weight a pair
takes every reading at every tick. Here the pairs of an unknown reading are not touched,
and so each pair has a total of its own.

The loops over a row are written for vector instructions, as those of
`neurosnap.poc.learning.graph_kernels`.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import MARK, START, Spells, withstand
from neurosnap.poc.learning.graph_kernels import (
    Pairs,
    Row,
    code_of,
    difference,
    end_of,
    place_of,
    rewire,
    row_of,
)
from neurosnap.system.compiled import njit


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
        _judge(row, float(clock - int(born[i])), kept.threshold, spells, fresh)
        if spells is not None:
            withstand(i, spells[1][i], row, spells, now, fresh)
        if difference(fresh, now):
            rewire(i, fresh, kept, clock)
            changed = True
    return changed


@njit()
def _judge(
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


@njit()
def count_newborn(
    squares: NDArray[np.uint32],
    age: int,
    share: float,
    codes: NDArray[np.uint8],
    spells: Spells | None,
) -> None:
    """Write what the counts of a newborn sensor say of its pairs.

    Args:
        squares: ``(4, N)``, of its pairs with all others.
        age: Observations in them.
        share: The threshold.
        codes: ``(N,)``, overwritten.
        spells: As of `count_squares`: nothing that was broken stands before it is the
            sensor's turn to be tested.
    """
    row = row_of(squares, 0, codes.shape[0])
    _judge(row, float(age), share, spells, codes)
    for j in range(codes.shape[0]):
        codes[j] = codes[j] if codes[j] < MARK else np.uint8(0)
