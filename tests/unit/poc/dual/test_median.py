"""Median graphs and back: what their poc sets are, and which graphs are refused."""

import networkx as nx
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.median import dual_graph, poc_of_median_graph
from neurosnap.poc.order.pocset import PocSet


@pytest.mark.parametrize(
    ("graph", "sensors", "width"),
    [
        (nx.path_graph(5), 4, 2),
        (nx.star_graph(4), 4, 4),
        (nx.hypercube_graph(3), 3, 6),
        (nx.grid_2d_graph(3, 4), 5, 4),
        (nx.path_graph(1), 0, 0),
    ],
)
def test_median_graphs_come_back(graph: nx.Graph, sensors: int, width: int) -> None:
    poc, places = poc_of_median_graph(graph)
    assert len(poc) == sensors
    assert poc.width() == width
    assert nx.is_isomorphic(dual_graph(Cubing(poc)), graph)
    first = next(iter(graph))
    assert not places[first][::2].any()


@pytest.mark.parametrize(
    ("graph", "message"),
    [
        (nx.Graph(), r"^graph: must have a vertex"),
        (nx.empty_graph(2), r"^graph: must be connected, and reach, got 1"),
        (nx.cycle_graph(5), r"^graph: must be bipartite at edge, got \("),
        (nx.cycle_graph(6), r"^graph: must have one median .*, not 0, got \(0, 2, 4\)"),
        (nx.complete_bipartite_graph(2, 3), r"^graph: must have one median .*, not 2"),
    ],
)
def test_other_graphs_are_refused(graph: nx.Graph, message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        poc_of_median_graph(graph)


def test_a_dual_as_a_graph_tells_which_literal_each_edge_flips() -> None:
    graph = dual_graph(Cubing(PocSet.parse("a, b, c : a < b, b = c")))
    assert sorted(d["literal"] for _, _, d in graph.edges(data=True)) == [0, 2]
    assert graph.nodes[0]["literals"].nonzero()[0].tolist() == [0, 2, 4]
    with pytest.raises(InvalidValueError, match=r"^dual: must have at most 7"):
        dual_graph(Cubing(PocSet(3)), limit=7)
