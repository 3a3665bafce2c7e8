"""Compiled loops over packed sets; their docstrings give the equivalent plain lines."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit

_ONE = np.uint64(1)


@njit()
def lowest(word: np.uint64) -> int:
    """Return the place of the lowest bit of a word that is not 0."""
    place = 0
    for size in (32, 16, 8, 4, 2, 1):
        if not word & ((_ONE << np.uint64(size)) - _ONE):
            word >>= np.uint64(size)
            place += size
    return place


@njit()
def pairs(rows: Words, count: int) -> NDArray[np.int64]:
    """Return ``row << 32 | literal`` for each literal in a row, ascending.

    Args:
        rows: ``(n, w)``, packed sets.
        count: How many literals there are in all of them.

    Returns:
        ``(count,)``. O(n w + count) time.
    """
    found = np.empty(count, np.int64)
    place = 0
    for row in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            word = rows[row, k]
            while word:
                found[place] = row << 32 | (64 * k + lowest(word))
                place += 1
                word &= word - _ONE
    return found


@njit()
def spread(rows: Words, reached: Words) -> int:
    """Grow `reached` by everything above it; return the hops the last of it took.

    Breadth first: what hop ``k`` finds is what edges lead to from hop ``k - 1``.

    Args:
        rows: ``(n, w)``, the out-edges of every literal.
        reached: ``(w,)``, updated.

    Returns:
        The number of hops; 0 if nothing is added. O(n w) time.
    """
    width = reached.shape[0]
    frontier = reached.copy()
    found = np.empty(width, np.uint64)
    hops = 0
    while True:
        found[:] = 0
        for word in range(width):
            pending = frontier[word]
            literal = 64 * word
            while pending:
                if pending & _ONE:
                    for k in range(width):
                        found[k] |= rows[literal, k]
                pending >>= _ONE
                literal += 1
        more = False
        for k in range(width):
            frontier[k] = found[k] & ~reached[k]
            reached[k] |= found[k]
            more |= frontier[k] != 0
        if not more:
            return hops
        hops += 1
