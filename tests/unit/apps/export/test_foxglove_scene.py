"""Where literals and edges stand in the scene of an order, and their colours."""

import numpy as np
import pytest
from hypothesis import given

from neurosnap.apps.export.foxglove_scene import order_scene
from neurosnap.apps.export.hasse_layout_3d import arranged, reach
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support.strategies import graphs


@given(graph=graphs())
def test_edges_lead_up_and_complements_stand_opposite(graph: PocGraph) -> None:
    places = arranged(graph)
    literals = np.arange(len(graph))
    np.testing.assert_allclose(places[literals ^ 1], -places, atol=1e-12)
    standing = graph.representative
    for a, b in np.argwhere(graph.hasse()).tolist():
        if standing[a] == standing[b]:
            assert places[a, 2] == places[b, 2]
        else:
            assert places[b, 2] >= places[a, 2] + 1
    farthest = np.linalg.norm(places, axis=1).max(initial=0)
    assert farthest <= reach(graph.sensors, graph.height()) + 1e-9


@pytest.mark.parametrize("sensors", [1, 2, 3, 10, 100])
def test_no_literal_stands_in_anothers_way(sensors: int) -> None:
    places = arranged(PocGraph.from_implications(sensors, []))[:, :2]
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    assert (apart + np.eye(2 * sensors) * 9 > 0.7).all()


def test_edges_are_coloured_by_what_they_do() -> None:
    # a excludes b; c and d are equal, and so are their complements.
    graph = PocGraph.from_implications(4, [(0, 3), (4, 6), (6, 4)])
    scene = order_scene(graph, Sensorium(["a", "b", "c", "d"]), 0)
    excites, inhibits, same = scene["entities"][0]["lines"]
    assert [len(excites["points"]), len(inhibits["points"]), len(same["points"])] == [
        0,
        4,
        4,
    ]
    assert excites["color"] != inhibits["color"]
    # In pixels: as thick however far away.
    assert all(line["scale_invariant"] for line in (excites, inhibits, same))


def test_many_edges_are_fainter_than_few_and_never_gone() -> None:
    alphas = []
    for sensors in (3, 40, 150):
        chosen = np.random.default_rng(sensors).random((sensors, sensors)) < 0.5
        below, above = np.nonzero(np.triu(chosen, sensors // 2))
        pairs = list(zip((2 * below).tolist(), (2 * above).tolist(), strict=True))
        graph = PocGraph.from_implications(sensors, pairs)
        names = Sensorium([f"s{k}" for k in range(sensors)])
        (entity,) = order_scene(graph, names, 0)["entities"]
        assert len({line["color"]["a"] for line in entity["lines"]}) == 1
        alphas.append(entity["lines"][0]["color"]["a"])
    few, some, many = alphas
    assert few == 0.8
    assert few > some > many > 0.03
