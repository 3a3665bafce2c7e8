"""Differences of orders, against implications asked for one by one."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.apps.viewer.order_difference import (
    is_same,
    literals_of,
    only_equal,
    only_in,
    restricted,
)
from neurosnap.poc.order.graph import PocGraph
from tests.support.strategies import graphs


@st.composite
def pairs_of_graphs(draw: st.DrawFn) -> tuple[PocGraph, PocGraph]:
    one, other = draw(graphs()), draw(graphs())
    least = min(len(one), len(other)) // 2
    own = literals_of(range(least))
    return restricted(one, own), restricted(other, own)


def is_equal(graph: PocGraph, a: int, b: int) -> bool:
    return graph.leq(a, b) and graph.leq(b, a)


@given(pairs_of_graphs())
def test_what_only_one_implies_is_found_and_nothing_else(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    literals = range(len(one))
    covers = {
        (a, b)
        for a in literals
        for b in literals
        if one.leq(a, b)
        and not one.leq(b, a)
        and one.representative[a] == a
        and one.representative[b] == b
        and not any(
            one.leq(a, c) and one.leq(c, b)
            for c in literals
            if not is_equal(one, a, c) and not is_equal(one, c, b)
        )
    }
    expected = {(a, b) for a, b in covers if not other.leq(a, b) and a <= b ^ 1}
    found = only_in(one, other)
    assert len(found) == len(set(found))
    assert set(found) == expected


@given(pairs_of_graphs())
def test_classes_that_are_none_in_the_other_are_found(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    found = only_equal(one, other)
    for members in one.classes():
        whole = all(is_equal(other, members[0], b) for b in members)
        if members[0] % 2 == 0:
            assert (members in found) is not whole
    assert all(members[0] % 2 == 0 for members in found)


@given(pairs_of_graphs())
def test_orders_are_the_same_where_nothing_differs(
    pair: tuple[PocGraph, PocGraph],
) -> None:
    one, other = pair
    differs = any(only_in(*two) or only_equal(*two) for two in (pair, pair[::-1]))
    assert is_same(one, other) is not differs
    assert is_same(one, one)


@given(graphs(), st.data())
def test_what_is_left_out_still_carries_implications(
    graph: PocGraph, data: st.DataObject
) -> None:
    sensors = data.draw(st.permutations(range(graph.sensors)))
    some = sensors[: data.draw(st.integers(0, len(sensors)))]
    own = literals_of(some)
    part = restricted(graph, own)
    for a, whole_a in enumerate(own.tolist()):
        for b, whole_b in enumerate(own.tolist()):
            assert part.leq(a, b) == graph.leq(whole_a, whole_b)


def test_a_chain_that_lost_its_middle() -> None:
    whole = PocGraph.from_implications(3, [(0, 2), (2, 4)])
    part = PocGraph.from_implications(3, [(0, 4)])
    assert only_in(whole, part) == [(0, 2), (2, 4)]
    assert only_in(part, whole) == []
    assert np.array_equal(literals_of([2, 0]), [4, 5, 0, 1])
