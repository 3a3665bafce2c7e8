"""Sets of literals as whole numbers: bit k is literal k.

A Python int is a set of any size with fast union, intersection and hashing, which is
what walking a dual takes: one set in hand at a time, never a matrix of them. Where
many sets are worked on at once, `neurosnap.poc.order.literals` has rows of words.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def to_mask(literals: NDArray[np.bool_]) -> int:
    """Return a set of literals, ``(n,)`` bool, as a number.

    Examples:
        >>> to_mask(np.array([True, False, True]))
        5
    """
    return int.from_bytes(np.packbits(literals, bitorder="little").tobytes(), "little")


def from_mask(mask: int, total: int) -> NDArray[np.bool_]:
    """Return a number as a set of literals: ``(total,)`` bool, a new array.

    Examples:
        >>> from_mask(5, 4)
        array([ True, False,  True, False])
    """
    if not total:
        return np.zeros(0, np.bool_)
    octets = np.frombuffer(mask.to_bytes((total + 7) // 8, "little"), np.uint8)
    return np.unpackbits(octets, count=total, bitorder="little").view(np.bool_)


def positive(total: int) -> int:
    """Return the literals that are no complements, of `total`: bits 0, 2, 4, and on.

    Examples:
        >>> positive(6)
        21
    """
    return ((1 << total + total % 2) - 1) // 3


def starred(mask: int, even: int) -> int:
    """Return the complements of a set: neighbouring bits change places.

    `even` is `positive` of the number of literals.

    Examples:
        >>> starred(0b0110, positive(4))
        9
    """
    return (mask & even) << 1 | (mask >> 1) & even


def members(mask: int) -> Iterator[int]:
    """Yield the literals of a set, the lowest first.

    Examples:
        >>> list(members(0b1010))
        [1, 3]
    """
    while mask:
        lowest = mask & -mask
        yield lowest.bit_length() - 1
        mask ^= lowest
