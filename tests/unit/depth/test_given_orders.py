"""Orders from edge lists equal those computed by another method."""

import numpy as np
import pytest

from neurosnap.depth.probe import GivenOrder, chain, check_layers, layered
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph, WiringKind


def pairs(order: GivenOrder) -> list[tuple[int, int]]:
    return [divmod(edge, 1 << 32) for edge in order.edges.tolist()]


def graph(order: GivenOrder) -> PocGraph:
    return PocGraph.from_implications(order.sensors, pairs(order))


@pytest.mark.parametrize("wiring", ["hasse", "derived"])
@pytest.mark.parametrize(
    ("sensors", "height"), [(1, 0), (4, 0), (2, 1), (6, 3), (6, 5)]
)
def test_a_chain_is_wired_as_its_graph_says(
    sensors: int, height: int, wiring: WiringKind
) -> None:
    order = chain(sensors, height, wiring)
    whole = graph(chain(sensors, height, "derived"))
    assert pairs(order) == [
        tuple(e) for e in np.argwhere(whole.wiring(wiring)).tolist()
    ]
    assert order.height == whole.height()
    assert order.reach().nonzero()[0].tolist() == list(range(0, 2 * height + 2, 2))


@pytest.mark.parametrize(
    ("sensors", "height", "edges"), [(2, 1, 2), (9, 2, 36), (9, 2, 12), (40, 7, 150)]
)
@pytest.mark.parametrize("seed", range(3))
def test_a_random_order_has_the_height_and_the_covers_asked_for(
    sensors: int, height: int, edges: int, seed: int
) -> None:
    order = layered(sensors, height, edges, seed)
    found = graph(order)
    assert len(order.edges) == len(set(order.edges.tolist())) == edges
    assert (np.diff(order.edges) > 0).all()
    # Nothing but covers: taking out what follows from others takes nothing out.
    assert pairs(order) == [tuple(edge) for edge in np.argwhere(found.hasse()).tolist()]
    assert found.height() == order.height == height
    assert found.heights()[list(order.signal)].max() == height
    assert np.array_equal(order.reach(), found.up(order.signal))
    assert order.reach().nonzero()[0].tolist() == list(range(0, 2 * sensors, 2))


@pytest.mark.parametrize(
    ("sensors", "height", "edges", "text"),
    [
        (4, 0, 2, "height: must be at least 1 and below the sensors, 4, got 0"),
        (4, 4, 2, "height: must be at least 1 and below the sensors, 4, got 4"),
        (9, 2, 10, "edges: must be even, 12 to 36, got 10"),
        (9, 2, 38, "edges: must be even, 12 to 36, got 38"),
        (9, 2, 13, "edges: must be even, 12 to 36, got 13"),
    ],
)
def test_an_order_that_cannot_be_is_refused(
    sensors: int, height: int, edges: int, text: str
) -> None:
    with pytest.raises(InvalidValueError) as caught:
        check_layers(sensors, height, edges)
    assert str(caught.value) == text
