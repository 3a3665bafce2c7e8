"""Graphs match a reference implementation on random implications."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph, WiringKind
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


@given(graphs(), st.data())
def test_coherence_and_its_projection(graph: PocGraph, data: st.DataObject) -> None:
    edges, chosen = edges_of(graph.edges), data.draw(subsets(graph))
    order = oracles.below_or_equal(len(graph), edges)
    projection = graph.coherent_projection(chosen)
    assert as_set(projection) == oracles.projected(edges, chosen)
    assert oracles.coherent(order, as_set(projection))
    assert graph.is_coherent(projection)
    assert (graph.coherent_projection(projection) == projection).all()
    assert graph.is_coherent(chosen) == oracles.coherent(order, chosen)
    if graph.is_coherent(chosen):
        assert (projection == graph.up(chosen)).all()


@given(graphs(), st.data())
def test_propagation_takes_paths_from_and_no_path_against(
    graph: PocGraph, data: st.DataObject
) -> None:
    edges = edges_of(graph.edges)
    load = as_set(graph.coherent_projection(data.draw(subsets(graph))))
    signal = data.draw(subsets(graph))
    against = oracles.stars(signal)
    assert as_set(graph.propagate(load, signal)) == {
        a
        for a in oracles.reach(edges, load | signal)
        if not oracles.reach(edges, [a]) & against
    }


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
    assert graph.depth(signal, kind) <= graph.height() + 2
    for a in range(len(graph)):
        assert graph.depth([a], kind) <= graph.height() + 2


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


@given(st.integers(30, 70), st.integers(0, 2**32 - 1))
def test_words_do_not_show_in_larger_graphs(sensors: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    level = rng.permutation(np.arange(1, sensors + 1))
    pool = rng.integers(0, sensors, (sensors, 2))
    chosen = [(2 * int(a), 2 * int(b)) for a, b in pool if level[a] < level[b]]
    graph = PocGraph.from_implications(sensors, chosen)
    closed = graph.edges | np.eye(2 * sensors, dtype=np.bool_)
    for via in range(2 * sensors):
        closed |= closed[:, via, None] & closed[via]
    starts = rng.random(2 * sensors) < 0.1
    assert (graph.up(starts) == closed[starts].any(axis=0)).all()
    strict = closed & ~closed.T
    between = (strict.astype(int) @ strict.astype(int)) > 0
    assert (graph.hasse() == (strict & ~between)).all()
    height = np.zeros(2 * sensors, int)
    for _ in range(sensors):
        height = np.where(strict, height + 1, 0).max(axis=1)
    assert (graph.heights() == height).all()
