"""Graphs match a reference, the cells' wiring the learned relation."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.order.closure_and_reduction import order_of
from neurosnap.poc.order.graph import BEYOND_HEIGHT, PocGraph, WiringKind
from neurosnap.poc.order.literal_sets import Words, from_words, to_words
from neurosnap.protocol.wiring_and_waves import WaveControl
from tests.support import oracles
from tests.support.edges import edge_matrix, edges_of
from tests.support.oracles import Edges
from tests.support.strategies import as_set, graphs, subsets

KINDS: list[WiringKind] = ["hasse", "derived"]


@st.composite
def flips(draw: st.DrawFn, most: int = 5) -> tuple[int, list[Edges]]:
    """Draw a number of sensors, and relations that each differ a little from the last.

    Any edge may come and go with its contrapositive: classes appear and fall apart,
    those too that hold a literal and its complement.
    """
    sensors = draw(st.integers(1, most))
    literal = st.integers(0, 2 * sensors - 1)
    pair = st.tuples(literal, literal).filter(lambda edge: edge[0] != edge[1])
    edges: Edges = set()
    relations = []
    for chosen in draw(st.lists(st.sets(pair, max_size=6), max_size=10)):
        for a, b in chosen:
            edges = edges ^ {(a, b), (b ^ 1, a ^ 1)}
        relations.append(edges)
    return sensors, relations


def packed(sensors: int, edges: Edges) -> Words:
    return to_words(edge_matrix(2 * sensors, edges))


def pairs(words: Words) -> Edges:
    return edges_of(from_words(words, len(words)))


def heads_of(n: int, order: Edges) -> list[int]:
    return [
        min(b for b in range(n) if {(a, b), (b, a)} <= order or a == b)
        for a in range(n)
    ]


def covers_of(n: int, order: Edges) -> Edges:
    head = heads_of(n, order)
    strict = {(a, b) for a, b in order if (b, a) not in order}
    return {
        (a, b)
        for a, b in strict
        if head[a] == a
        and head[b] == b
        and not any((a, c) in strict and (c, b) in strict for c in range(n))
    }


def wiring_of(n: int, edges: Edges, kind: WiringKind) -> Edges:
    order = oracles.below_or_equal(n, edges)
    head = heads_of(n, order)
    between = covers_of(n, order)
    if kind == "derived":
        between = {(head[a], head[b]) for a, b in edges}
    spokes = {(head[a], a) for a in range(n)} | {(a, head[a]) for a in range(n)}
    wires = {(a, b) for a, b in between | spokes if a != b}
    return wires | {(b ^ 1, a ^ 1) for a, b in wires}


class Listener:
    """The cells' edges, as the messages tell them."""

    def __init__(self) -> None:
        self.edges: Edges = set()

    def hear(self, messages: list[wire.Message]) -> None:
        cells = []
        for message in messages:
            assert isinstance(message, wire.Wiring)
            cells.append(message.cell)
            changes = [
                (2 * message.cell, message.add, message.drop),
                (2 * message.cell + 1, message.add_complement, message.drop_complement),
            ]
            assert any(add or drop for _, add, drop in changes)
            for literal, add, drop in changes:
                assert list(add) == sorted(add)
                assert list(drop) == sorted(drop)
                gone = {(literal, b) for b in drop}
                come = {(literal, b) for b in add}
                assert gone <= self.edges
                assert not come & self.edges
                self.edges = self.edges - gone | come
        assert cells == sorted(set(cells))


@given(flips())
def test_an_order_is_what_follows_from_any_relation(
    run: tuple[int, list[Edges]],
) -> None:
    sensors, relations = run
    n = 2 * sensors
    for edges in relations:
        expected = oracles.below_or_equal(n, edges)
        order = order_of(packed(sensors, edges), np.arange(2 * sensors))
        assert pairs(order.closed) == expected
        assert order.representative.tolist() == heads_of(n, expected)
        assert pairs(order.covers) == covers_of(n, expected)
        chains = [oracles.chain(expected, a) for a in range(n)]
        assert order.heights.tolist() == chains


@pytest.mark.parametrize("kind", KINDS)
@given(run=flips())
def test_cells_follow_a_relation_that_changes(
    kind: WiringKind, run: tuple[int, list[Edges]]
) -> None:
    sensors, relations = run
    control = WaveControl(sensors)
    cells = Listener()
    for edges in relations:
        graph = PocGraph.of_rows(packed(sensors, edges))
        expected = wiring_of(2 * sensors, edges, kind)
        assert pairs(to_words(graph.wiring(kind))) == expected
        assert len(graph.wire_list(kind)) == len(expected)
        messages = control.rewire(graph.wire_list(kind))
        cells.hear(messages)
        assert cells.edges == expected


def walk(sensors: int, seed: int) -> Iterator[NDArray[np.bool_]]:
    """Yield what stretches of a line see of a walk along it."""
    rng = np.random.default_rng(seed)
    ends = np.sort(rng.integers(0, 30, (sensors, 2)), axis=1)
    place = 15
    while True:
        place = int(np.clip(place + rng.integers(-2, 3), 0, 29))
        yield (ends[:, 0] <= place) & (place < ends[:, 1])


@given(st.integers(30, 100), st.integers(0, 2**32 - 1))
def test_words_do_not_show_in_a_learned_order_with_classes(
    sensors: int, seed: int
) -> None:
    snapshot, seen = EmpiricalSnapshot(sensors, threshold=0.05), walk(sensors, seed)
    conductor, told = WaveControl(sensors), Listener()
    rng = np.random.default_rng(seed)
    for step in range(40):
        if not snapshot.learn(next(seen)) or step % 8:
            continue
        graph = snapshot.poc_graph()
        told.hear(conductor.rewire(graph.wire_list()))
        closed = graph.edges | np.eye(2 * sensors, dtype=np.bool_)
        for via in range(2 * sensors):
            closed |= closed[:, via, None] & closed[via]
        head = (closed & closed.T).argmax(axis=1)
        assert (graph.representative == head).all()
        start = rng.random(2 * sensors) < 0.1
        assert (graph.up(start) == closed[start].any(axis=0)).all()
        literals = np.arange(2 * sensors)
        heads = head == literals
        strict = closed & ~closed.T
        within = strict & heads & heads[:, None]
        wires = within & ~((within.astype(int) @ within.astype(int)) > 0)
        member = literals[~heads]
        wires[head[member], member] = wires[member, head[member]] = True
        assert (graph.hasse() == wires).all()
        assert told.edges == edges_of(wires)
        height = np.zeros(2 * sensors, int)
        for _ in range(sensors):
            height = np.where(within, height + 1, 0).max(axis=1)
        assert (graph.heights() == height[head]).all()


def test_an_order_cannot_be_changed() -> None:
    for array in order_of(packed(2, {(0, 2), (3, 1)}), np.arange(4)):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


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
