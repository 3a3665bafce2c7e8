"""Relations among literals and what a snapshot learned, as matrices and sets."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.pairs import rows_of, strict
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.literal_sets import from_words
from tests.support.oracles import Edges, proper_pairs


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


def learned_edges(snapshot: Snapshot, equivalences: bool = True) -> Edges:
    """Return the edges of its graph, with or without those of equivalent literals."""
    if equivalences:
        return edges_of(snapshot.poc_graph().edges)
    count = len(snapshot.sensorium)
    return edges_of(from_words(rows_of(strict(snapshot.codes), count), 2 * count))


def weights_of(snapshot: Snapshot) -> dict[tuple[int, int], float]:
    """Return its weights of pairs of literals of different sensors."""
    pairs = proper_pairs(2 * len(snapshot.sensorium))
    return {(a, b): snapshot.weight(a, b) for a, b in pairs}
