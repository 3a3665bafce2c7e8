"""Graphs match a reference implementation on random implications."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import BEYOND_HEIGHT, PocGraph, WiringKind
from tests.support import oracles
from tests.support.edges import edges_of
from tests.support.strategies import as_set, graphs, subsets

KINDS: list[WiringKind] = ["hasse", "derived"]


@given(graphs(), st.data())
def test_sets_above(graph: PocGraph, data: st.DataObject) -> None:
    edges, chosen = edges_of(graph.edges), data.draw(subsets(graph))
    order = oracles.below_or_equal(len(graph), edges)
    assert as_set(graph.up(chosen)) == {b for a, b in order if a in chosen}
    for a in range(len(graph)):
        for b in range(len(graph)):
            assert graph.leq(a, b) == ((a, b) in order)


@given(graphs())
def test_classes_and_representatives(graph: PocGraph) -> None:
    order = oracles.below_or_equal(len(graph), edges_of(graph.edges))
    classes = {
        tuple(b for b in range(len(graph)) if {(a, b), (b, a)} <= order)
        for a in range(len(graph))
    }
    assert graph.classes() == sorted(group for group in classes if len(group) > 1)
    for group in classes:
        for a in group:
            assert graph.representative[a] == min(group)
            assert graph.representative[a ^ 1] == min(group) ^ 1


@pytest.mark.parametrize("kind", KINDS)
@given(graph=graphs(), data=st.data())
def test_depth_counts_hops_and_stays_within_height_and_two(
    graph: PocGraph, kind: WiringKind, data: st.DataObject
) -> None:
    wires, signal = edges_of(graph.wiring(kind)), data.draw(subsets(graph))
    assert graph.depth(signal, kind) == oracles.hops(wires, signal)
    assert graph.depth(signal, kind) <= graph.height() + BEYOND_HEIGHT
    for a in range(len(graph)):
        assert graph.depth([a], kind) <= graph.height() + BEYOND_HEIGHT


@given(
    st.integers(1, 4).flatmap(
        lambda sensors: st.tuples(
            st.just(sensors),
            st.lists(
                st.tuples(
                    st.integers(0, 2 * sensors - 1), st.integers(0, 2 * sensors - 1)
                ),
                max_size=8,
            ),
        )
    )
)
def test_a_literal_equivalent_to_its_complement_is_refused(
    relation: tuple[int, list[tuple[int, int]]],
) -> None:
    sensors, given_pairs = relation
    n = 2 * sensors
    edges = set(given_pairs) | {(b ^ 1, a ^ 1) for a, b in given_pairs}
    order = oracles.below_or_equal(n, edges)
    if any({(a, a ^ 1), (a ^ 1, a)} <= order for a in range(n)):
        with pytest.raises(
            InvalidValueError, match=r"^literal: must not be equivalent"
        ):
            PocGraph.from_implications(sensors, given_pairs)
    else:
        graph = PocGraph.from_implications(sensors, given_pairs)
        assert edges_of(graph.edges) == {(a, b) for a, b in edges if a != b}
        assert (PocGraph(graph.edges).edges == graph.edges).all()
