"""Snapshots: first state, limits, unknown readings, invalid input, time to learn."""

import math
import re
from typing import Any, TypeAlias

import numpy as np
import pytest

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import Evidence
from neurosnap.poc.learning.reading_history import Newborn
from neurosnap.sensorium import Sensorium
from tests.support.edges import edge_matrix, learned_edges
from tools.paper.fig2_discounted import to_learn

Kind: TypeAlias = type[EmpiricalSnapshot] | type[DiscountedSnapshot]
KINDS = pytest.mark.parametrize("kind", [EmpiricalSnapshot, DiscountedSnapshot])


@KINDS
def test_nothing_seen_means_no_edges_and_no_state(kind: Kind) -> None:
    snapshot = kind(3)
    assert snapshot.clock == 0
    assert snapshot.sensorium == Sensorium.of(3)
    assert not snapshot.state.any()
    assert not snapshot.poc_graph().edges.any()
    assert not kind.from_bytes(snapshot.to_bytes()).poc_graph().edges.any()


@KINDS
def test_learning_leaves_the_state_to_whoever_adopts_one(kind: Kind) -> None:
    snapshot = kind(2)
    # What is handed out is a copy.
    snapshot.observe([True, True])[:] = False
    snapshot.state[:] = False
    snapshot.learn([False, True])
    assert snapshot.state.tolist() == [True, False, True, False]
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
def test_what_is_assumed_is_in_the_graph_and_not_in_what_is_learned(kind: Kind) -> None:
    plain, told = kind(70, 0.25), kind(70, 0.25)
    given = edge_matrix(140, [(0, 138), (139, 1)])
    told.assume([(0, 138), (139, 1)])
    assert told.poc_graph().implications(told.sensorium) == [("s0", "s69")]
    drawn = np.random.default_rng(3)
    for _ in range(20):
        bits = drawn.random(70) < 0.5
        bits[69] |= bits[0]
        assert plain.learn(bits) == told.learn(bits)
        assert (told.poc_graph().edges == plain.poc_graph().edges | given).all()
        plain.adopt(told.project())
    assert plain.to_bytes() == told.to_bytes()
    new = kind(70, 0.25)
    new.assume([(0, 138), (139, 1)])
    assert not new.observe([1, *[0] * 69])[[0, 139]].any()  # it cannot be read so
    told.assume([])
    again = kind.from_bytes(told.to_bytes())
    assert (told.poc_graph().edges == again.poc_graph().edges).all()


@KINDS
@pytest.mark.parametrize(
    ("bits", "known", "says"),
    [
        ([1], None, "observation: must hold 2 bits, one a sensor, got (1,)"),
        ([1, 2], None, "observation: must be 0 or 1 (at 1), got 2"),
        ([1, np.nan], None, "observation: must be 0 or 1 (at 1), got nan"),
        ([1, np.nan], [True, False], "observation: must be 0 or 1 (at 1), got nan"),
        ([1, 0], [True] * 3, "known: must hold 2 flags, one a sensor, got (3,)"),
        ([1, 0], [1, 0], "known: must be bool, got dtype('int64')"),
    ],
)
def test_a_bad_observation_changes_nothing(
    kind: Kind, bits: list[float], known: Any, says: str
) -> None:
    snapshot = kind(2)
    snapshot.observe([1, 0])
    before = snapshot.to_bytes()
    for see in (snapshot.observe, snapshot.learn):
        with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
            see(bits, known)
        assert snapshot.to_bytes() == before


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        *(
            (kind, {"threshold": wrong}, f"threshold: must be {rule}")
            for kind in (EmpiricalSnapshot, DiscountedSnapshot)
            for rule, several in (
                ("in (0, 0.25], got ", (0, -0.1, 0.2500001, np.nan, np.inf)),
                ("a number, or", ("much", True)),
            )
            for wrong in several
        ),
        *(
            (DiscountedSnapshot, {"decay": wrong}, "decay: must be in [0, 1), got ")
            for wrong in (1, -0.1, np.nan, 2)
        ),
        (DiscountedSnapshot, {"decay": "x"}, "decay: must be a number, got 'x'"),
        (EmpiricalSnapshot, {"sensors": -1}, "sensors: must be 0 or more, got -1"),
    ],
)
def test_a_threshold_is_at_most_a_quarter_and_a_decay_below_one(
    kind: Kind, given: dict[str, Any], says: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}"):
        kind(**{"sensors": 2, **given})


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


def test_counts_stand_for_and_against() -> None:
    snapshot = EmpiricalSnapshot(2, 0.2)
    for bits in [(0, 0)] * 5 + [(0, 1)] * 4 + [(1, 1)] * 3 + [(1, 0)] * 2:
        snapshot.learn(bits)
    limit = 0.2 * 14
    assert snapshot.evidence(0, 2) == Evidence(14, 3, 5, 4, 2, limit, True, 10)
    assert snapshot.evidence(3, 1) == Evidence(14, 5, 3, 4, 2, limit, True, 10)
    assert snapshot.evidence(2, 0) == Evidence(14, 3, 5, 2, 4, limit, False, 10)
    assert snapshot.evidence(0, 3) == Evidence(14, 2, 4, 5, 3, limit, False, 10)
    assert type(snapshot.evidence(0, 2).against) is int


# Unknown readings ---------------------------------------------------------------------


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


A, B, C = 0, 2, 4
"""The literals that say that the sensors are on."""


@pytest.mark.parametrize("idle", [0, 64], ids="{} sensors are idle".format)
def test_a_limit_that_grows_past_the_exceptions_counts_at_once(idle: int) -> None:
    """At tick 63, where the row looks ahead, a was 7 times without b; tau t is 6.3.

    Nothing speaks against it any more. At 71 the limit is 7.1, and a implies b. Where
    the row has many idle pairs, this one is judged from a list meanwhile.
    """
    rows = [(1, 0)] * 7 + [(1, 1), (0, 0), (0, 1), (1, 1)] * 14
    snapshot = EmpiricalSnapshot(2 + idle, threshold=0.1)
    a, b = (A, B) if not idle else (2 * (1 + idle), A)
    implied = []
    for number in range(90):
        on, also = rows[number] if number < len(rows) else (1, 1)
        row = (on, also) if not idle else (also, *[0] * idle, on)
        snapshot.observe(np.array(row, np.bool_))
        implied.append(bool(snapshot.poc_graph().up([a])[b]))
    assert [tick for tick, holds in enumerate(implied, 1) if holds] == [*range(71, 91)]


def test_a_newborn_is_judged_by_its_own_age() -> None:
    """It was read at 2 of the 100 ticks before. At two more it reads what `a` does.

    Its pairs are judged once half of its age was read: of 3 ticks 1 is not enough, of
    4 ticks 2 are. By the age of the others it would take 51 ticks.
    """
    snapshot = EmpiricalSnapshot(3, threshold=0.1)
    known = np.array([True, True, False])
    for number in range(100):
        row = np.array([number % 2, number % 3 == 0, False], np.bool_)
        snapshot.observe(row, known)
    nothing = Newborn(2, np.zeros((4, 2), np.uint32), np.zeros(2, np.uint8))
    snapshot.grow(2, "c", nothing, None)
    implied = []
    for on in (True, False, True):
        snapshot.observe([on, True, on], [True, False, True])
        implied.append(bool(snapshot.poc_graph().up([C])[A]))
    assert implied == [False, True, True]


BOTH, ONLY_B, NEITHER = (1, 1), (0, 1), (0, 0)
GRID = [(1 - 2.0**-k, tau) for k in (1, 2, 5, 9) for tau in (1 / 8000, 0.01, 0.25)]


@pytest.mark.parametrize(
    ("decay", "tau"),
    # Each observation keeps its weight above tau until the next such one.
    [(decay, tau) for decay, tau in GRID if decay**2 * (1 - decay) >= tau],
)
def test_an_implication_is_learned_after_exactly_so_many_observations(
    decay: float, tau: float
) -> None:
    """The paper's ``log tau / log q`` is needed, and the next whole number enough.

    The paper takes ``w_ab*`` by itself ([GK] discounted:formalism). With ``w_ab* = 1``
    at first, no implication ``b -> a`` on record meanwhile and the other weights above
    the threshold in time, `to_learn` is exact. While ``b -> a`` is on record, each
    truncation takes what it takes from ``w_a*b`` from ``w_ab*`` too, and the wait may
    be shorter.
    """
    arrays = DiscountedSnapshot(2, tau, decay).arrays() | {
        "clock": np.array(1),
        "joints": np.array([0.0]),
        "marginals": np.array([1.0, 0.0]),
        "codes": np.array([12], np.uint8),  # a and b* are equivalent
    }
    snapshot = DiscountedSnapshot.from_arrays(arrays)
    assert snapshot.weight(0, 3) == 1
    expected = to_learn(tau, decay)
    for count in range(1, expected + 1):
        snapshot.learn((ONLY_B, BOTH, NEITHER)[count % 3])
        assert snapshot.weight(0, 3) == pytest.approx(
            decay**count if count < expected else 0, abs=1e-12
        )
        edges = learned_edges(snapshot, equivalences=False)
        assert ((0, 2) in edges) == (count == expected)
    assert expected - 1 <= math.log(tau) / math.log(decay) < expected
