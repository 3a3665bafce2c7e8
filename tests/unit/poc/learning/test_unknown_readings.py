"""What unknown readings do to a snapshot, and what no longer holds with them."""

from typing import TypeAlias

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.poc.order.pocset import PocSet

Kind: TypeAlias = type[EmpiricalSnapshot] | type[DiscountedSnapshot]
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])

BELOW = [(1, 1), (0, 1), (0, 0)]
SAME = [(1, 1), (0, 0)]
OPPOSITE = [(1, 0), (0, 1)]


def see(
    snapshot: EmpiricalSnapshot, i: int, j: int, pairs: list[tuple[int, int]]
) -> None:
    """Observe two sensors, and no other."""
    for pair in pairs:
        bits, known = np.zeros((2, len(snapshot.sensorium)), np.bool_)
        bits[[i, j]] = pair
        known[[i, j]] = True
        snapshot.observe(bits, known)


@KINDS
def test_an_unknown_sensor_is_in_the_state_as_what_the_known_imply(kind: Kind) -> None:
    snapshot = kind(3, 0.1)
    for first, second in BELOW * 40:
        snapshot.observe([first, second, 0])
        snapshot.observe([first, second, 1])
    assert snapshot.poc_graph().implications(snapshot.sensorium) == [("s0", "s1")]
    state = snapshot.observe([1, 0, 0], known=[True, False, False])
    assert state.nonzero()[0].tolist() == [0, 2]
    assert (snapshot.state == state).all()
    state = snapshot.observe([0, 0, 0], known=[True, False, False])
    assert state.nonzero()[0].tolist() == [1]


@KINDS
def test_only_the_clock_grows_when_nothing_is_known(kind: Kind) -> None:
    snapshot = kind(3, 0.25)
    for bits in [(0, 0, 0), (0, 1, 1), (1, 1, 0)] * 9:
        snapshot.observe(bits)
    graph = snapshot.poc_graph()
    before = [snapshot.weight(a, b) for a, b in [(0, 2), (0, 3), (1, 2), (1, 3)]]
    assert not snapshot.learn([1, 1, 1], known=[False] * 3)
    assert snapshot.clock == 28
    assert snapshot.poc_graph() is graph
    after = [snapshot.weight(a, b) for a, b in [(0, 2), (0, 3), (1, 2), (1, 3)]]
    assert after == before
    assert not snapshot.observe([1, 1, 1], known=[False] * 3).any()


@KINDS
def test_a_snapshot_takes_more_room_from_the_first_unknown_reading_on(
    kind: Kind,
) -> None:
    snapshot = kind(3)
    snapshot.learn([1, 0, 1], known=[True] * 3)
    assert "joints" in snapshot.arrays()
    snapshot.learn([1, 0, 1], known=[True, False, True])
    snapshot.learn([1, 0, 1])
    assert snapshot.arrays()["squares"].shape == (4, 3)
    assert "joints" not in snapshot.arrays()


@KINDS
@pytest.mark.parametrize("sensors", [0, 1])
def test_few_sensors_may_be_unknown_too(kind: Kind, sensors: int) -> None:
    snapshot = kind(sensors, np.full((sensors, sensors), 0.1))
    state = snapshot.observe([True] * sensors, [False] * sensors)
    assert state.tolist() == [False, False] * sensors
    assert kind.from_bytes(snapshot.to_bytes()).to_bytes() == snapshot.to_bytes()
    assert snapshot.clock == 1


@KINDS
def test_a_bad_mask_changes_nothing(kind: Kind) -> None:
    snapshot = kind(2)
    snapshot.observe([1, 0])
    before = snapshot.to_bytes()
    rule = r"^known: must hold 2 flags, one a sensor, got \(3,\)$"
    with pytest.raises(ShapeError, match=rule):
        snapshot.observe([1, 0], [True] * 3)
    with pytest.raises(InvalidValueError, match=r"^known: must be bool, got dtype"):
        snapshot.learn([1, 0], [1, 0])
    with pytest.raises(InvalidValueError, match=r"^observation: must be 0 or 1"):
        snapshot.learn([1, np.nan], [True, False])
    assert snapshot.to_bytes() == before


def test_as_many_against_as_the_threshold_are_too_many() -> None:
    snapshot = EmpiricalSnapshot(3, 1 / 8)
    see(snapshot, 0, 1, [(1, 1)] * 3 + [(0, 1)] * 2 + [(0, 0)] * 2 + [(1, 0)])
    found = snapshot.evidence(0, 2)
    assert found.against == found.limit == 1
    assert not found.holds
    see(snapshot, 0, 1, [(1, 1)])
    assert snapshot.evidence(0, 2).holds


@pytest.mark.parametrize(
    "square", [(0.4, 0.1, 0.3, 0.2), (0.5, -1e-17, 0.25, 0.25), (0.5, 1e-310, 0, 0.5)]
)
def test_what_is_not_touched_is_not_judged_anew(square: tuple[float, ...]) -> None:
    snapshot = DiscountedSnapshot(3, 0.25)
    snapshot.learn([1, 1, 1], known=[True, False, True])
    arrays = unpack_arrays(snapshot.to_bytes())
    # As rounding might leave it: by these weights there would be a relation.
    arrays["squares"] = np.tile(square, (3, 1)).T
    whole = DiscountedSnapshot.from_bytes(pack_arrays(arrays))
    for unknown in range(3):
        snapshot = DiscountedSnapshot.from_bytes(whole.to_bytes())
        j, i = (s for s in range(3) if s != unknown)
        assert snapshot.learn([1, 1, 1], known=[s != unknown for s in range(3)])
        edges = snapshot.poc_graph().edges
        assert edges[2 * i, 2 * j]
        for s in (i, j):
            low, high = 2 * min(s, unknown), 2 * max(s, unknown)
            around = [
                snapshot.weight(high + t, low + u) for t in (0, 1) for u in (0, 1)
            ]
            assert around == list(square)
            assert not edges[low : low + 2, high : high + 2].any()
            assert not edges[high : high + 2, low : low + 2].any()


@pytest.mark.parametrize("count", [2**31 - 2, 2**32 - 8])
def test_wide_counts_are_right_beyond_31_bits(count: int) -> None:
    snapshot = EmpiricalSnapshot(2, 0.25)
    snapshot.learn([0, 0], [False, False])
    squares = snapshot._weights.squares
    assert squares is not None
    third = count // 3
    squares[:, 0] = third, third - 1, third + 1, count - 3 * third
    snapshot._clock = count
    # s1* -> s0 with less against it than the rest and the threshold.
    assert snapshot.learn([1, 1])
    assert snapshot.evidence(3, 0).total == count + 1
    assert snapshot.evidence(3, 0).against == count - 3 * third
    assert snapshot.evidence(3, 0).holds
    twin = EmpiricalSnapshot.from_bytes(snapshot.to_bytes())
    assert twin.evidence(3, 0).holds


def test_weights_that_fade_become_nothing_in_the_end() -> None:
    snapshot = DiscountedSnapshot(2, 0.25, decay=0.75)
    snapshot.learn([0, 0], [False, False])
    for tick in range(2600):
        snapshot.learn([tick % 2] * 2)
    assert snapshot.poc_graph().classes() == [(0, 2), (1, 3)]
    assert snapshot.weight(0, 3) == snapshot.weight(1, 2) == 0.0


def test_a_long_memory_is_read_back_all_the_same() -> None:
    snapshot = DiscountedSnapshot(2, decay=1 - 2**-40)
    snapshot.learn([1, 0], [True, False])
    squares = snapshot._weights.squares
    assert squares is not None
    # Where what is gained is lost to rounding, a weight stays off by so much.
    squares[:, 0] = 1 - 2**-14, 0, 0, 0
    for _ in range(9):
        snapshot.learn([1, 1])
    assert snapshot.weight(0, 2) == 1 - 2**-14
    twin = DiscountedSnapshot.from_bytes(snapshot.to_bytes())
    assert twin.weight(0, 2) == 1 - 2**-14


def test_a_sensor_read_once_says_nothing_of_those_read_often() -> None:
    snapshot = EmpiricalSnapshot(3, 0.1)
    for first, second in BELOW * 10:
        snapshot.learn([first, second, 0], known=[True, True, False])
    snapshot.learn([1, 0, 1])  # an exception, of one in thirty-one
    graph = snapshot.poc_graph()
    assert graph.implications(snapshot.sensorium) == [("s0", "s1")]
    for seen, (first, second) in enumerate(BELOW * 3, 2):
        assert snapshot.evidence(2, 4).holds == (seen > 10)
        snapshot.learn([first, second, second])
    assert snapshot.evidence(2, 4).total == 10
    assert snapshot.evidence(2, 4).holds


def test_pairs_known_apart_may_form_a_cycle() -> None:
    snapshot = EmpiricalSnapshot(3, 0.25)
    for i, j in [(0, 1), (1, 2), (2, 0)]:
        see(snapshot, i, j, BELOW * 2)
    graph = snapshot.poc_graph(equivalences=False)
    assert graph.edges[[0, 2, 4], [2, 4, 0]].all()
    assert graph.classes() == [(0, 2, 4), (1, 3, 5)]
    assert graph.height() == 0
    # What a sensor weighs depends on which other it is weighed with.
    assert snapshot.weight(0, 2) + snapshot.weight(0, 3) == 2
    assert snapshot.weight(0, 4) + snapshot.weight(0, 5) == 4


def test_a_literal_may_be_equivalent_to_its_own_complement() -> None:
    snapshot = EmpiricalSnapshot(4, 0.25)
    see(snapshot, 0, 1, SAME * 2)
    see(snapshot, 1, 2, SAME * 2)
    see(snapshot, 0, 2, OPPOSITE * 2)
    see(snapshot, 0, 3, [(1, 1), (1, 0), (0, 1), (0, 0)])
    graph = snapshot.poc_graph()
    assert graph.classes() == [(0, 1, 2, 3, 4, 5)]
    assert not graph.is_coherent([0])
    state = snapshot.observe([1, 1, 1, 1], known=[True, False, False, True])
    assert state.nonzero()[0].tolist() == [6]
    rule = "^literal: must not be equivalent to its own complement, got 0$"
    with pytest.raises(InvalidValueError, match=rule):
        PocSet.from_graph(graph)
