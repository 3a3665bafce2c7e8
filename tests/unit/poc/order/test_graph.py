"""What a graph refuses, and small graphs known by heart."""

import re
from typing import Any

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import to_words
from neurosnap.sensorium import Sensorium

SHAPES = [(4,), (2, 4), (3, 3), (2, 2, 2)]
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


@pytest.mark.parametrize(
    ("edges", "rule"),
    [
        *(
            (np.zeros(shape, np.bool_), r"must be \(2N, 2N\), got \(")
            for shape in SHAPES
        ),
        (np.zeros((2, 2)), "must be bool, got dtype"),
    ],
)
def test_edges_that_are_none_are_refused(edges: Any, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^edges: {rule}"):
        PocGraph(edges)


def test_an_edge_without_its_contrapositive_is_named() -> None:
    edges = np.zeros((4, 4), np.bool_)
    edges[0, 2] = True
    rule = r"^edge: must have its contrapositive \(3, 1\), got \(0, 2\)$"
    with pytest.raises(InvalidValueError, match=rule):
        PocGraph(edges)


def test_a_literal_may_be_negligible_but_not_its_own_complement() -> None:
    negligible = PocGraph.from_implications(1, [(0, 1)])
    assert not negligible.is_coherent([0])
    assert not negligible.coherent_projection([0])[0]
    with pytest.raises(
        InvalidValueError, match=r"^literal: must not be equiv.* got 0$"
    ):
        PocGraph.from_implications(2, [(0, 2), (2, 1), (1, 0)])


@pytest.mark.parametrize(
    ("sensors", "pair", "rule"),
    [
        *(
            (2, pair, "implication: must be a literal, a whole number in [0, 4), got")
            for pair in [(0, 4), (-1, 0), (0.0, 1), (True, 0)]
        ),
        (2, 3, "implication: must be a pair of literals, got 3"),
        (2, (0, 1, 2), "implication: must be a pair of literals, got (0, 1, 2)"),
        (-1, (0, 1), "sensors: must be 0 or more, got -1"),
        (1.5, (0, 1), "sensors: must be a whole number"),
    ],
)
def test_an_implication_is_a_pair_of_literals(
    sensors: Any, pair: Any, rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(rule)}"):
        PocGraph.from_implications(sensors, [pair])


@pytest.mark.parametrize(
    ("given", "rule"),
    [
        (np.zeros(4, np.bool_), "literals: must be (6,), got (4,)"),
        ([6], "literals: must be a literal, a whole number in [0, 6), got 6"),
        ([True, False], "literals: must be a literal, a whole number in [0, 6), got T"),
        (0, "literals: must be (6,) bool or "),
    ],
)
def test_a_set_is_of_literals(given: Any, rule: str) -> None:
    for closure in (CHAIN.up, CHAIN.down):
        with pytest.raises(InvalidValueError, match=f"^{re.escape(rule)}"):
            closure(given)


def test_an_unknown_kind_of_wiring_is_refused() -> None:
    rule = r'^kind: must be "hasse" or "derived", got \'all\'$'
    with pytest.raises(InvalidValueError, match=rule):
        CHAIN.wiring("all")  # type: ignore[arg-type]


def test_a_derived_class_that_is_its_own_complement_breaks_nothing() -> None:
    edges = np.zeros((6, 6), np.bool_)
    for a, b in [(0, 2), (2, 1), (1, 0), (4, 0)]:
        edges[a, b] = edges[b ^ 1, a ^ 1] = True
    graph = PocGraph.of_rows(to_words(edges))
    assert graph.classes() == [(0, 1, 2, 3)]
    assert not graph.coherent_projection([0, 4]).any()
    for kind in ("hasse", "derived"):
        wiring = graph.wiring(kind)
        again = PocGraph.of_rows(to_words(wiring))
        for a in range(6):
            assert (graph.up([a]) == again.up([a])).all()
            assert graph.depth([a], kind) <= graph.height() + 2
            for b in range(6):
                assert wiring[a, b] == wiring[b ^ 1, a ^ 1]
