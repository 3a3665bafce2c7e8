"""Small example graphs, and invalid input."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import to_words
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium

CHAIN = PocGraph.from_implications(3, [(0, 2), (2, 4), (0, 4)])


def test_implications_name_one_of_each_contrapositive_pair() -> None:
    sensorium = Sensorium(["a", "b", "c"])
    assert CHAIN.implications(sensorium) == [("a", "b"), ("b", "c")]
    equal = PocGraph.from_implications(3, [(2, 5), (5, 2), (0, 1)])
    assert equal.implications(sensorium) == [("a", "a*"), ("b", "c*"), ("b*", "c")]
    with pytest.raises(ShapeError, match=r"^sensorium: must have 3 sensors, got 1$"):
        CHAIN.implications(Sensorium(["a"]))


def test_no_sensors_and_no_edges_are_graphs_too() -> None:
    nothing = PocGraph(np.zeros((0, 0), np.bool_))
    assert nothing.height() == 0
    assert nothing.up([]).shape == (0,)
    assert nothing.hasse().shape == nothing.wiring("derived").shape == (0, 0)
    assert nothing.classes() == []
    assert nothing.implications(Sensorium([])) == []
    assert nothing.depth([]) == 0
    assert PocGraph.from_implications(2, []).height() == 0


def test_what_a_graph_hands_out_cannot_change_it() -> None:
    for array in (CHAIN.edges, CHAIN.hasse(), CHAIN.heights(), CHAIN.representative):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


PAIR = "implication: must be a pair of literals, got"
RANGE = "must be a literal, a whole number in"
RELATED = PocGraph.from_implications


@pytest.mark.parametrize(
    ("make", "given", "rule"),
    [
        *(
            (PocGraph, (np.zeros(shape, np.bool_),), "edges: must be (2N, 2N), got (")
            for shape in [(4,), (2, 4), (3, 3), (2, 2, 2)]
        ),
        (PocGraph, (np.zeros((2, 2)),), "edges: must be bool, got dtype"),
        *(
            (RELATED, (2, [pair]), f"implication: {RANGE} [0, 4)")
            for pair in [(0, 4), (-1, 0), (0.0, 1), (True, 0)]
        ),
        (RELATED, (2, [3]), f"{PAIR} 3"),
        (RELATED, (2, [(0, 1, 2)]), f"{PAIR} (0, 1, 2)"),
        (RELATED, (-1, [(0, 1)]), "sensors: must be 0 or more, got -1"),
        (RELATED, (1.5, [(0, 1)]), "sensors: must be a whole number"),
        (CHAIN.up, (np.zeros(4, np.bool_),), "literals: must be (6,), got (4,)"),
        (CHAIN.up, ([6],), f"literals: {RANGE} [0, 6), got 6"),
        (CHAIN.up, ([True, False],), f"literals: {RANGE} [0, 6), got T"),
        (CHAIN.up, (0,), "literals: must be (6,) bool or "),
        (CHAIN.wiring, ("all",), 'kind: must be "hasse" or "derived", got \'all\''),
    ],
)
def test_what_is_no_graph_or_none_of_its_literals_is_refused(
    make: Any, given: tuple[Any, ...], rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(rule)}"):
        make(*given)


def test_an_edge_without_its_contrapositive_is_named() -> None:
    edges = np.zeros((4, 4), np.bool_)
    edges[0, 2] = True
    rule = r"^edge: must have its contrapositive \(3, 1\), got \(0, 2\)$"
    with pytest.raises(InvalidValueError, match=rule):
        PocGraph(edges)


def test_a_literal_may_be_negligible() -> None:
    negligible = PocGraph.from_implications(1, [(0, 1)])
    assert not negligible.is_coherent([0])
    assert not negligible.coherent_projection([0])[0]


def test_a_derived_class_that_is_its_own_complement_breaks_nothing() -> None:
    edges = np.zeros((6, 6), np.bool_)
    for a, b in [(0, 2), (2, 1), (1, 0), (4, 0)]:
        edges[a, b] = edges[b ^ 1, a ^ 1] = True
    graph = PocGraph.of_rows(to_words(edges))
    assert graph.classes() == [(0, 1, 2, 3)]
    assert not graph.coherent_projection([0, 4]).any()
    rule = r"^literal: must not be equivalent to its own complement, got 0$"
    with pytest.raises(InvalidValueError, match=rule):
        PocSet.from_graph(graph)
    for kind in ("hasse", "derived"):
        wiring = graph.wiring(kind)
        again = PocGraph.of_rows(to_words(wiring))
        for a in range(6):
            assert (graph.up([a]) == again.up([a])).all()
            assert graph.depth([a], kind) <= graph.height() + 2
            for b in range(6):
                assert wiring[a, b] == wiring[b ^ 1, a ^ 1]
