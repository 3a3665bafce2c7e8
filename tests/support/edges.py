"""Relations among literals, as matrices and as sets of pairs."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from tests.support.oracles import Edges


def edge_matrix(literals: int, pairs: Iterable[tuple[int, int]]) -> NDArray[np.bool_]:
    """Return the matrix that has each pair of literals as an edge."""
    matrix = np.zeros((literals, literals), np.bool_)
    for a, b in pairs:
        matrix[a, b] = True
    return matrix


def edge_list(pairs: Iterable[tuple[int, int]]) -> NDArray[np.int64]:
    """Return pairs of literals as a list of edges, as a wiring takes it."""
    return np.array(sorted(a << 32 | b for a, b in pairs), np.int64)


def edges_of(matrix: NDArray[np.bool_]) -> Edges:
    """Return the edges of a matrix as a set."""
    return {(a, b) for a, b in np.argwhere(matrix).tolist()}
