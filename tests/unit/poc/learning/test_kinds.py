"""What a snapshot refuses, where it starts, and how far it counts."""

from typing import TypeAlias

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.sensorium import Sensorium

Kind: TypeAlias = type[EmpiricalSnapshot] | type[DiscountedSnapshot]
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


@KINDS
def test_nothing_seen_means_no_edges_and_no_state(kind: Kind) -> None:
    snapshot = kind(3)
    assert snapshot.clock == 0
    assert snapshot.sensorium == Sensorium.of(3)
    assert not snapshot.state.any()
    assert not snapshot.poc_graph().edges.any()
    assert not snapshot.poc_graph(equivalences=False).edges.any()
    assert not kind.from_bytes(snapshot.to_bytes()).poc_graph().edges.any()


@KINDS
def test_learning_leaves_the_state_to_whoever_adopts_one(kind: Kind) -> None:
    snapshot = kind(2)
    snapshot.observe([True, True])
    before = snapshot.state
    snapshot.learn([False, True])
    assert (snapshot.state == before).all()
    assert snapshot.clock == 2
    snapshot.adopt(np.array([False, True, False, False]))
    assert snapshot.state.tolist() == [False, True, False, False]


def test_a_state_is_a_selection() -> None:
    snapshot = EmpiricalSnapshot(2)
    with pytest.raises(ShapeError, match=r"^state: must be \(4,\), got \(2,\)$"):
        snapshot.adopt(np.zeros(2, np.bool_))
    with pytest.raises(InvalidValueError, match=r"^state: must be bool, got dtype"):
        snapshot.adopt(np.zeros(4))  # type: ignore[arg-type]
    rule = r"^state: must not hold a literal and its complement, got 's1'$"
    with pytest.raises(InvalidValueError, match=rule):
        snapshot.adopt(np.array([False, False, True, True]))


@KINDS
def test_the_graph_is_the_same_object_until_it_changes(kind: Kind) -> None:
    snapshot = kind(2, 0.25)
    assert snapshot.learn([True, True]) == (kind is EmpiricalSnapshot)
    graph = snapshot.poc_graph()
    assert not snapshot.learn([True, True])
    assert snapshot.poc_graph() is graph
    changed = [snapshot.learn(bits) for bits in ([0, 0], [1, 0])]
    assert any(changed)
    assert snapshot.poc_graph() is not graph


@KINDS
def test_what_is_handed_out_is_a_copy(kind: Kind) -> None:
    snapshot = kind(2)
    snapshot.observe([True, False])[:] = False
    snapshot.state[:] = False
    assert snapshot.state.any()


@KINDS
@pytest.mark.parametrize("bits", [[1], [1, 2], [1, np.nan]])
def test_a_bad_observation_changes_nothing(kind: Kind, bits: list[float]) -> None:
    snapshot = kind(2)
    snapshot.observe([1, 0])
    before = snapshot.to_bytes()
    with pytest.raises(InvalidValueError, match=r"^observation: must "):
        snapshot.observe(bits)
    assert snapshot.to_bytes() == before


@KINDS
@pytest.mark.parametrize("threshold", [0, -0.1, 0.2500001, np.nan, np.inf])
def test_a_threshold_is_at_most_a_quarter(kind: Kind, threshold: float) -> None:
    rule = r"^threshold: must be in \(0, 0.25\], got "
    with pytest.raises(InvalidValueError, match=rule):
        kind(2, threshold)
    for wrong in "much", True:
        with pytest.raises(
            InvalidValueError, match=r"^threshold: must be a number, or"
        ):
            kind(2, wrong)


@pytest.mark.parametrize("decay", [1, -0.1, np.nan, 2])
def test_a_decay_is_below_one(decay: float) -> None:
    with pytest.raises(InvalidValueError, match=r"^decay: must be in \[0, 1\), got "):
        DiscountedSnapshot(2, decay=decay)


def test_a_decay_is_a_number_and_sensors_are_counted() -> None:
    with pytest.raises(InvalidValueError, match=r"^decay: must be a number, got 'x'$"):
        DiscountedSnapshot(2, decay="x")  # type: ignore[arg-type]
    with pytest.raises(InvalidValueError, match=r"^sensors: must be 0 or more, got -1"):
        EmpiricalSnapshot(-1)


def test_a_weight_is_of_a_proper_pair() -> None:
    snapshot = EmpiricalSnapshot(2)
    rule = r"^pair: must be of two sensors, got \(0, 1\)$"
    for of in (snapshot.weight, snapshot.evidence):
        with pytest.raises(InvalidValueError, match=rule):
            of(0, 1)
        with pytest.raises(InvalidValueError, match=r"^b: must be a literal, .* got 4"):
            of(0, 4)
    assert type(snapshot.weight(0, 2)) is int
    assert type(DiscountedSnapshot(2).weight(0, 2)) is float


def test_the_clock_stops_where_counts_would_overflow() -> None:
    snapshot = EmpiricalSnapshot(2)
    snapshot._clock = 2**32 - 1
    before = snapshot.to_bytes()
    with pytest.raises(InvalidValueError, match=r"^clock: must stay below 2\*\*32, "):
        snapshot.observe([True, False])
    assert snapshot.to_bytes() == before


def test_a_discounted_weight_is_zero_from_the_tolerance_down() -> None:
    snapshot = DiscountedSnapshot(2, 0.25, decay=0.5)
    since = [snapshot.learn([tick % 3 > 0] * 2) for tick in range(60)].index(True)
    assert 2.0 ** -(since + 2) > 1e-12 > 2.0 ** -(since + 3)
    assert snapshot.poc_graph().classes() == [(0, 2), (1, 3)]
