"""A largest matching, and with it the width of an order, by augmenting paths.

Breadth-first and on whole numbers as sets: each search looks at a vertex on the right
once, and no recursion goes as deep as a path is long.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.masks import members, to_mask


def largest_matching(joined: NDArray[np.bool_]) -> int:
    """Return the size of the largest matching between rows and columns.

    Args:
        joined: ``(rows, columns)`` bool; which pairs may be matched.

    Returns:
        How many pairs. O(rows · columns) set operations.

    Example:
        >>> largest_matching(np.array([[True, True], [True, False]]))
        2
    """
    choices = [to_mask(row) for row in joined]
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
                    continue
                while True:
                    source = came[column]
                    before = mate.get(source)
                    held[column], mate[source] = source, column
                    if before is None:
                        return True
                    column = before
    return False
