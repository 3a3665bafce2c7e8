"""Recovers the poc set from a median graph that is its dual.

The elements are the half-spaces: for an edge ``xy`` those vertices nearer to ``x`` than
to ``y``; in a median graph opposite edges of squares give the same ones, and nothing
else does. Whether a graph is median at all is decided by trying: it is iff it is the
dual of the half-spaces its edges give.
"""

import itertools
from collections.abc import Hashable

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.mask_dual import LISTABLE
from neurosnap.poc.order.fields import inclusions
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium, complete


def poc_of_median_graph(
    graph: nx.Graph,
) -> tuple[PocSet, dict[Hashable, NDArray[np.bool_]]]:
    """Return the poc set of a median graph, and each vertex as one of its dual's.

    [GK] thm:every median graph is a poc dual. O(V·(V + E)) time, and O(V³) to name
    what is wrong with a graph that is not median.

    Args:
        graph: Finite, simple, median. Its first vertex is where all half-spaces are
            off.

    Returns:
        A poc set on ``h0``, ``h1``, and so on, one a pair of half-spaces in the order
        of the edges that first give them, and for each vertex the ``(2N,)`` bool
        *-selection of half-spaces it is in.

    Raises:
        InvalidValueError: The graph is empty, not connected, not bipartite, or three
            of its vertices have no or several medians; they are named.

    Example:
        >>> poc, vertices = poc_of_median_graph(nx.path_graph(3))
        >>> poc, vertices[2].tolist()
        (PocSet.parse('h0, h1 : h1 < h0'), [True, False, True, False])
    """
    nodes = list(graph)
    if not nodes:
        raise InvalidValueError("graph", "must have a vertex", graph)
    distance = _distances(graph, nodes)
    number = {node: k for k, node in enumerate(nodes)}
    found: dict[bytes, NDArray[np.bool_]] = {}
    for x, y in graph.edges:
        near, far = distance[number[x]], distance[number[y]]
        if (near == far).any():
            raise InvalidValueError("graph", "must be bipartite at edge", (x, y))
        side = near < far
        side ^= side[0]
        found.setdefault(side.tobytes(), side)
    fields = np.array(list(found.values()), np.bool_).reshape(len(found), len(nodes))
    names = Sensorium(f"h{k}" for k in range(len(fields)))
    poc = PocSet.from_graph(PocGraph(inclusions(fields)), names)
    alike = np.array_equal((fields[:, :, None] != fields[:, None, :]).sum(0), distance)
    if not alike or Cubing(poc).count() != len(nodes):
        raise InvalidValueError("graph", *_why_not_median(distance, nodes))
    return poc, {node: complete(fields[:, k]) for node, k in number.items()}


def dual_graph(cubing: Cubing, limit: int | None = LISTABLE) -> nx.Graph:
    """Return the 1-skeleton of a dual ([GK] defn:dual), to be drawn or searched.

    Args:
        cubing: The dual.
        limit: As for `Cubing.vertices`.

    Returns:
        A graph on ``0``, ``1``, and so on in the order of `Cubing.vertices`, each
        vertex with its ``(2N,)`` bool array as ``literals``, each edge with the
        flipped element's positive literal as ``literal``.

    Example:
        >>> dual_graph(Cubing(PocSet.parse("a, b : a < b"))).number_of_edges()
        2
    """
    graph = nx.Graph()
    number: dict[bytes, int] = {}
    for k, vertex in enumerate(cubing.vertices(limit)):
        number[vertex.tobytes()] = k
        graph.add_node(k, literals=vertex)
    for corner, (literal,) in cubing.cubes(1, limit):
        other = cubing.flip(corner, [literal])
        ends = number[corner.tobytes()], number[other.tobytes()]
        graph.add_edge(*ends, literal=literal)
    return graph


def _distances(graph: nx.Graph, nodes: list[Hashable]) -> NDArray[np.int64]:
    """Return the hop distances ``(V, V)``."""
    hops = dict(nx.all_pairs_shortest_path_length(graph))
    for node in nodes:
        if node not in hops[nodes[0]]:
            raise InvalidValueError("graph", "must be connected, and reach", node)
    return np.array([[hops[x][y] for y in nodes] for x in nodes], np.int64)


def _why_not_median(
    distance: NDArray[np.int64], nodes: list[Hashable]
) -> tuple[str, tuple[Hashable, ...]]:
    """Return the rule that three vertices break, and the three."""
    among = range(len(nodes))
    between = {
        (x, y): distance[x] + distance[y] == distance[x, y]
        for x, y in itertools.combinations(among, 2)
    }
    for x, y, z in itertools.combinations(among, 3):
        medians = int((between[x, y] & between[y, z] & between[x, z]).sum())
        if medians != 1:
            rule = f"must have one median for any three vertices, not {medians}"
            return rule, (nodes[x], nodes[y], nodes[z])
    return "must be simple", tuple(nodes)
