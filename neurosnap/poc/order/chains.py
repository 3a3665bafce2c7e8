"""Chains and antichains of an order: covers and width.

The width is found as a largest matching, breadth-first and on whole numbers as sets:
each search looks at a vertex once, and no recursion goes as deep as a path is long.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.masks import members, to_mask


def covers(strict: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pairs of neighbours in a strict order.

    Args:
        strict: ``(n, n)`` bool, transitive and without cycles.

    Returns:
        ``(n, n)`` bool; the pairs with nothing between them.
    """
    # Counts below 2**24 are exact in single precision.
    two = strict.astype(np.float32) @ strict.astype(np.float32)
    return strict & ~(two > 0)


def width(strict: NDArray[np.bool_]) -> int:
    """Return the size of the largest antichain of a strict order.

    By Dilworth's theorem that is the least number of chains that hold everything, and
    ``n`` less the largest matching between elements and elements above them. O(n³)
    time at worst.

    Example:
        >>> width(np.array([[False, True], [False, False]])), width(np.eye(3) > 1)
        (1, 3)
    """
    return len(strict) - _largest_matching([to_mask(row) for row in strict])


def _largest_matching(choices: list[int]) -> int:
    """Return how many rows can have a column each, of those they may choose."""
    held: dict[int, int] = {}
    mate: dict[int, int] = {}
    return sum(_augment(row, choices, held, mate) for row in range(len(choices)))


def _augment(
    row: int, choices: list[int], held: dict[int, int], mate: dict[int, int]
) -> bool:
    """Match one more row, if a path of swaps leads to a free column.

    Args:
        row: The row, not matched yet.
        choices: The columns each row may have.
        held: The row that holds a column; changed.
        mate: The column that a row holds; changed.
    """
    unseen = -1
    came: dict[int, int] = {}
    ring = [row]
    while ring:
        above, ring = ring, []
        for source in above:
            for column in members(choices[source] & unseen):
                unseen &= ~(1 << column)
                came[column] = source
                if column in held:
                    ring.append(held[column])
                else:
                    _swap(column, came, held, mate)
                    return True
    return False


def _swap(
    column: int, came: dict[int, int], held: dict[int, int], mate: dict[int, int]
) -> None:
    """Give each row of a path the column it was left by, back to its beginning."""
    given: int | None = column
    while given is not None:
        source = came[given]
        before = mate.get(source)
        held[given], mate[source] = source, given
        given = before
