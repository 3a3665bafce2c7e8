"""What one learned order has that another lacks, over the same sensors."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import from_words


def restricted(graph: PocGraph, literals: NDArray[np.intp]) -> PocGraph:
    """Return the order among some literals of a graph, in their order.

    Args:
        graph: Over ``2N`` literals.
        literals: ``(2M,)``, each literal beside its complement. O(N²) time.
    """
    if np.array_equal(literals, np.arange(len(graph))):
        return graph
    closed = from_words(graph.closed, len(graph))
    return PocGraph(closed[np.ix_(literals, literals)])


def literals_of(sensors: Sequence[int]) -> NDArray[np.intp]:
    """Return the literals of some sensors: ``(2M,)``, each beside its complement."""
    own = 2 * np.asarray(sensors, np.intp)
    return np.stack([own, own + 1], axis=1).ravel()


def only_in(graph: PocGraph, other: PocGraph) -> list[tuple[int, int]]:
    """Return the covering edges of one order that the other does not imply.

    Args:
        graph: The one.
        other: Over the same sensors.

    Returns:
        Pairs of literals, of an edge and its contrapositive the one with the smaller
        source. What is implied by way of others is no difference, and what equivalent
        literals share is in `only_equal`. O(N³/64) time where the orders are new.
    """
    below, above = np.nonzero(graph.hasse())
    standing = graph.representative
    chosen = (below <= above ^ 1) & (standing[below] != standing[above])
    below, above = below[chosen], above[chosen]
    bits = other.closed[below, above >> 6] >> (above & 63).astype(np.uint64)
    lacking = (bits & np.uint64(1)) == 0
    return list(zip(below[lacking].tolist(), above[lacking].tolist(), strict=True))


def only_equal(graph: PocGraph, other: PocGraph) -> list[tuple[int, ...]]:
    """Return the classes of one order that are not equivalent in the other.

    Args:
        graph: The one.
        other: Over the same sensors.

    Returns:
        Classes of two literals and more, each once with its complement.
    """
    standing = other.representative
    return [
        members
        for members in graph.classes()
        if members[0] % 2 == 0 and len(set(standing[list(members)].tolist())) > 1
    ]


def is_same(graph: PocGraph, other: PocGraph) -> bool:
    """Return whether two graphs over the same sensors have the same order."""
    return np.array_equal(graph.closed, other.closed)
