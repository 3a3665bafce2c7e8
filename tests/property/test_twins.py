"""Sensors that read the same are weighed once, as each by itself would be."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.order.contradiction import contradiction
from neurosnap.poc.order.graph import PocGraph, WiringKind

Bits = NDArray[np.uint8]
KINDS: tuple[WiringKind, ...] = ("hasse", "derived")
# Nothing; an implication; that two are opposite, which twins cannot be.
ASSUMED = (), ((0, 2), (3, 1)), ((0, 3), (2, 1), (1, 2), (3, 0))
THRESHOLDS: st.SearchStrategy[float | str] = st.sampled_from(["auto", 0.25, 0.01])


@st.composite
def readings(draw: st.DrawFn) -> Bits:
    """Draw ``(ticks, sensors)`` readings, of which some are copies for a while."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sensors, ticks = draw(st.integers(1, 12)), draw(st.integers(0, 90))
    flips = rng.random((ticks, sensors)) < draw(st.sampled_from([0.01, 0.1, 0.5]))
    bits = flips.cumsum(axis=0) % 2
    for k in range(1, sensors):
        if rng.random() < 0.6:
            until = rng.integers(ticks + 1)
            bits[:until, k] = bits[:until, rng.integers(k)]
    return bits.astype(np.uint8)


@given(readings(), THRESHOLDS, st.data())
def test_it_is_as_if_each_sensor_had_its_own_weights(
    rows: Bits, threshold: float | str, data: st.DataObject
) -> None:
    count = rows.shape[1]
    single = EmpiricalSnapshot(count, threshold)
    single.stand_apart()
    twins = EmpiricalSnapshot(count, threshold)
    assumed = data.draw(st.sampled_from(ASSUMED)) if count > 1 else ()
    saved = data.draw(st.integers(0, len(rows)))
    for tick, bits in enumerate(rows):
        if tick == saved:
            twins = EmpiricalSnapshot.from_bytes(twins.to_bytes())
        for each in (single, twins):
            each.assume(assumed)
        assert_same_conflicts(twins.poc_graph(), single.poc_graph(), bits)
        assert twins.observe(bits).tolist() == single.observe(bits).tolist()
        assert_same_order(twins.poc_graph(), single.poc_graph())
        # What is assumed of one sensor of a group is so of all of them.
        same = np.array_equal(twins.poc_graph().edges, single.poc_graph().edges)
        assert same or assumed
    assert twins.pairs <= single.pairs
    assert twins.codes.tolist() == single.codes.tolist()
    for a, b in product(range(2 * count), repeat=2):
        if a >> 1 != b >> 1:
            assert twins.evidence(a, b) == single.evidence(a, b)
            assert twins.weight(a, b) == single.weight(a, b)


def assert_same_conflicts(graph: PocGraph, other: PocGraph, bits: Bits) -> None:
    """Assert that an observation contradicts two orders in the same way."""
    seen = (2 * np.arange(len(bits)) + 1 - bits).tolist()

    def suspicion(sensors: NDArray[np.int64]) -> NDArray[np.float64]:
        return (7 * sensors % 5).astype(np.float64)

    found = [contradiction(each, seen, suspicion) for each in (graph, other)]
    assert found[0] == found[1]


def assert_same_order(graph: PocGraph, other: PocGraph) -> None:
    assert np.array_equal(graph.closed, other.closed)
    assert np.array_equal(graph.representative, other.representative)
    assert np.array_equal(graph.heights(), other.heights())
    for kind in KINDS:
        assert np.array_equal(graph.wire_list(kind), other.wire_list(kind))


@given(readings(), THRESHOLDS)
def test_an_unknown_reading_finds_the_weights_of_each(
    rows: Bits, threshold: float | str
) -> None:
    count = rows.shape[1]
    single = EmpiricalSnapshot(count, threshold)
    single.stand_apart()
    twins = EmpiricalSnapshot(count, threshold)
    known = np.arange(count) % 3 > 0
    for each in (single, twins):
        for bits in rows:
            each.observe(bits)
        each.observe(np.zeros(count), known)
    assert twins.to_bytes() == single.to_bytes()


def test_groups_part_where_readings_differ_and_never_join_again() -> None:
    snapshot = EmpiricalSnapshot(4, 0.25)
    assert snapshot.pairs == 0
    snapshot.observe([1, 1, 0, 0])
    assert snapshot.pairs == 1
    snapshot.observe([1, 0, 0, 0])
    snapshot.observe([1, 1, 0, 0])
    assert snapshot.pairs == 3


def test_of_many_sensors_a_few_pairs_are_weighed() -> None:
    """And no array has as many numbers as there are pairs of sensors: 40 GB of bits."""
    snapshot, sensors = EmpiricalSnapshot(100_000, 0.25), np.arange(100_000)
    for place in (50_000, 50_001, 49_999):
        snapshot.learn(sensors < place)
    state = snapshot.observe(sensors < 50_000)
    assert snapshot.pairs == 6
    assert np.flatnonzero(state[::2]).tolist() == [*range(50_000)]
    graph = snapshot.poc_graph()
    assert graph.height() == 1
    assert len(graph.wire_list()) == 399_990


@pytest.mark.parametrize(
    ("name", "value", "match"),
    [
        (
            "twins",
            np.array([0, 2, 2], np.int32),
            "twins: must be numbered by the first",
        ),
        ("twins", np.array([0, 0], np.int32), "twins: must be int32"),
        ("marginals", np.array([1, 0, 0], np.uint32), "marginals: must be the same"),
    ],
)
def test_what_cannot_be_of_twins_is_refused(
    name: str, value: NDArray[np.generic], match: str
) -> None:
    snapshot = EmpiricalSnapshot(3, 0.25)
    snapshot.observe([1, 1, 0])
    arrays = snapshot.arrays() | {name: value}
    with pytest.raises(InvalidValueError, match=match):
        EmpiricalSnapshot.from_bytes(EmpiricalSnapshot.packed(arrays))
