"""Compiled loops over sets of literals, packed 64 per machine word."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

_ONE, _TWO, _FOUR, _HIGH = np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(56)
_PAIRS, _QUADS = np.uint64(0x5555555555555555), np.uint64(0x3333333333333333)
_NIBBLES, _OCTETS = np.uint64(0x0F0F0F0F0F0F0F0F), np.uint64(0x0101010101010101)


@njit(plain=np.bitwise_count)
def population(word: np.uint64) -> np.uint64:
    """Return how many bits of a word are set; LLVM makes one instruction of it."""
    word -= word >> _ONE & _PAIRS
    word = (word & _QUADS) + (word >> _TWO & _QUADS)
    word = word + (word >> _FOUR) & _NIBBLES
    return np.uint64(word * _OCTETS >> _HIGH)


@njit()
def lowest(word: np.uint64) -> int:
    """Return the place of the lowest bit of a word that is not 0."""
    return int(population(~word & (word - _ONE)))


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
            while pending:
                literal = 64 * word + lowest(pending)
                for k in range(width):
                    found[k] |= rows[literal, k]
                pending &= pending - _ONE
        more = False
        for k in range(width):
            frontier[k] = found[k] & ~reached[k]
            reached[k] |= found[k]
            more |= frontier[k] != 0
        if not more:
            return hops
        hops += 1
