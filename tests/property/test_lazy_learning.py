"""Learning that puts off what changes no code is the same bits as one that does not.

The other side judges every pair at every observation: `EagerCounts`.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import (
    AUTO,
    SHARE,
    START,
    Persistence,
    is_tolerated,
    share_of_changes,
)
from neurosnap.poc.learning.counting_kernels import CALM, DENSE, FREE
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import rows_of
from neurosnap.poc.order.literals import from_words

_CELLS = ((0, 0, 4), (0, 1, 1), (1, 0, 2), (1, 1, 8))
"""The joint readings, 0 for on; and the code of the implication each is against."""


class EagerCounts:
    """What an empirical snapshot is, all of whose readings are known."""

    def __init__(self, sensors: int, threshold: float | str) -> None:
        pairs, auto = sensors * (sensors - 1) // 2, threshold == AUTO
        self.threshold = SHARE if auto else float(threshold)
        self.clock = 0
        self.joints = np.zeros(pairs, np.uint32)
        self.marginals = np.zeros(sensors, np.uint32)
        self.codes = np.zeros(pairs, np.uint8)
        self.since = np.zeros(pairs, np.uint32)
        self.persistence = Persistence(sensors) if auto else None
        self._latter, self._former = np.tril_indices(sensors, -1)

    def learn(self, bits: NDArray[np.uint8]) -> bool:
        """Observe; return whether any code changed."""
        if self.persistence is not None:
            self.persistence.count(bits, np.ones_like(bits))
        self.clock += 1
        self.marginals += bits
        self.joints += bits[self._latter] & bits[self._former]
        fresh = self._judged()
        changed = fresh != self.codes
        self.codes = fresh
        self.since[changed] = self.clock
        return bool(changed.any())

    def squares(self) -> NDArray[np.int64]:
        """Return ``(4, P)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*``."""
        both = self.joints.astype(np.int64)
        mine = self.marginals[self._latter] - both
        yours = self.marginals[self._former] - both
        return np.stack([both, mine, yours, self.clock - both - mine - yours])

    def _judged(self) -> NDArray[np.uint8]:
        squares = self.squares()
        limit = self.threshold * self.clock
        if self.persistence is not None:
            limit = max(limit - START, 1.0)
        second, least = np.sort(squares, axis=0)[1], squares.min(axis=0)
        holds = (least < second) & (least < limit)
        fresh = np.zeros(len(self.joints), np.uint8)
        for cell, (_, _, code) in enumerate(_CELLS):
            fresh[holds & (squares[cell] == least)] = code
        if self.persistence is not None:
            for pair in np.flatnonzero(holds & (least > 0)):
                if not self._stands(int(pair), squares[:, pair], int(fresh[pair])):
                    fresh[pair] = 0
        fresh[(squares[1] == 0) & (squares[2] == 0)] = 3
        fresh[(squares[0] == 0) & (squares[3] == 0)] = 12
        return fresh

    def _stands(self, pair: int, square: NDArray[np.int64], code: int) -> bool:
        """Return whether an implication stands that was broken."""
        assert self.persistence is not None
        i, j = int(self._latter[pair]), int(self._former[pair])
        if not self.persistence.spells[1][i]:
            return bool(code == self.codes[pair])
        cell = int(square.argmin())
        a, b, _ = _CELLS[cell]
        changes = share_of_changes(self.persistence.spells, 2 * i + a, 2 * j + b)
        against = float(square[cell])
        from_a, from_b = against + square[cell ^ 1], against + square[cell ^ 2]
        total = float(square.sum())
        return is_tolerated(against, float(from_a), float(from_b), total, changes)

    def assert_same(self, snapshot: EmpiricalSnapshot) -> None:
        """Assert that a snapshot has the same weights, codes, dates and graph."""
        arrays = snapshot.arrays()
        assert arrays["clock"] == self.clock
        np.testing.assert_array_equal(arrays["joints"], self.joints)
        np.testing.assert_array_equal(arrays["marginals"], self.marginals)
        np.testing.assert_array_equal(arrays["since"], self.since)
        np.testing.assert_array_equal(snapshot.codes, self.codes)
        rows = rows_of(self.codes, len(self.marginals))
        edges = from_words(rows, len(rows))
        np.testing.assert_array_equal(snapshot.poc_graph().edges, edges)
        if self.persistence is not None:
            for name, array in self.persistence.arrays().items():
                np.testing.assert_array_equal(arrays[name], array)


Bits = NDArray[np.uint8]

KINDS = "walk", "windows", "rates", "noise", "stands"


def readings_of(kind: str, sensors: int, ticks: int, rng: np.random.Generator) -> Bits:
    """Return ``(ticks, sensors)`` readings.

    Args:
        kind: Of a walker on a line who is behind a point (``walk``) or within a window;
            of sensors that each change at a rate of their own (``rates``); at random
            at every tick; or the same for ever.
        sensors: How many.
        ticks: How many.
        rng: Draws them.
    """
    if kind in ("walk", "windows"):
        steps = rng.choice([-1, 1], ticks)
        places = np.abs(rng.integers(sensors) + steps.cumsum()) % (2 * sensors)
        places = np.minimum(places, 2 * sensors - places)[:, np.newaxis]
        begin, wide = np.arange(sensors), np.full(sensors, sensors)
        if kind == "windows":
            begin = rng.integers(0, sensors, sensors)
            wide = rng.integers(1, sensors + 1, sensors)
        within: Bits = ((begin <= places) & (places < begin + wide)).astype(np.uint8)
        return within
    if kind == "rates":
        flips = rng.random((ticks, sensors)) < 10.0 ** -rng.uniform(0.5, 4, sensors)
        return (flips.cumsum(axis=0) % 2).astype(np.uint8)
    if kind == "noise":
        return (rng.random((ticks, sensors)) < rng.random(sensors)).astype(np.uint8)
    return np.repeat(rng.integers(0, 2, (1, sensors)), ticks, axis=0).astype(np.uint8)


@st.composite
def sources(draw: st.DrawFn) -> Bits:
    """Draw readings: stretches of several kinds, with a few that are wrong."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    sensors = draw(st.integers(1, 70))
    lengths = st.sampled_from([1, 31, 64, 200, 900])
    stretches = draw(
        st.lists(st.tuples(st.sampled_from(KINDS), lengths), min_size=1, max_size=3)
    )
    rows = np.vstack(
        [readings_of(kind, sensors, ticks, rng) for kind, ticks in stretches]
    )
    wrong = draw(st.sampled_from([0, 0, 0.001, 0.02]))
    return rows ^ (rng.random(rows.shape) < wrong).astype(np.uint8)


THRESHOLDS: st.SearchStrategy[float | str] = st.sampled_from(
    [AUTO, AUTO, 0.25, 1 / 32, 0.01, 1e-5]
)


def both(sensors: int, threshold: float | str) -> tuple[EmpiricalSnapshot, EagerCounts]:
    return EmpiricalSnapshot(sensors, threshold), EagerCounts(sensors, threshold)


@given(sources(), st.data())
def test_codes_are_the_same_after_every_observation(
    rows: Bits, data: st.DataObject
) -> None:
    lazy, eager = both(rows.shape[1], data.draw(THRESHOLDS))
    for bits in rows:
        assert lazy.learn(bits) == eager.learn(bits)
        assert lazy.codes.tobytes() == eager.codes.tobytes()
    eager.assert_same(lazy)


@given(sources(), st.data())
def test_it_can_be_read_saved_and_interrupted_at_any_time(
    rows: Bits, data: st.DataObject
) -> None:
    lazy, eager = both(rows.shape[1], data.draw(THRESHOLDS))
    whens = st.lists(st.integers(0, len(rows)), max_size=4)
    stops = {
        what: set(data.draw(whens, label=what))
        for what in ("saved", "compared", "weighed")
    }
    for tick, bits in enumerate(rows):
        lazy.learn(bits)
        eager.learn(bits)
        if tick in stops["saved"]:
            lazy = EmpiricalSnapshot.from_bytes(lazy.to_bytes())
        if tick in stops["compared"]:
            eager.assert_same(lazy)
        if tick in stops["weighed"] and rows.shape[1] > 1:
            assert lazy.weight(2, 0) == eager.joints[0]
            assert lazy.evidence(2, 0).both == eager.joints[0]
            assert lazy.evidence(2, 0).since == eager.since[0]
    eager.assert_same(lazy)


@given(sources(), st.booleans(), st.integers(0, 150))
def test_an_unknown_reading_finds_all_counted(
    rows: Bits, auto: bool, more: int
) -> None:
    """The four weights of each pair are taken on from counts that were put off."""
    count = rows.shape[1]
    lazy, eager = both(count, "auto" if auto else 0.01)
    for bits in rows:
        lazy.learn(bits)
        eager.learn(bits)
    lazy.learn(rows[-1], known=np.zeros(count, np.bool_))
    np.testing.assert_array_equal(lazy.arrays()["squares"], eager.squares())
    # And from there on as it is in one that was saved before: nothing is put off.
    again = EmpiricalSnapshot.from_bytes(lazy.to_bytes())
    for bits in rows[:more]:
        assert lazy.learn(bits) == again.learn(bits)
    assert lazy.to_bytes() == again.to_bytes()


def modes_on(rows: Bits, threshold: float | str) -> Iterator[NDArray[np.uint8]]:
    """Yield the modes of all rows but the first two, observation by observation."""
    snapshot = EmpiricalSnapshot(rows.shape[1], threshold)
    for bits in rows:
        snapshot.learn(bits)
        lag = snapshot._lag
        assert lag is not None
        yield lag.modes[2:].copy()


@pytest.mark.parametrize("threshold", [0.01, "auto"])
def test_a_walk_leaves_most_pairs_alone(threshold: float | str) -> None:
    rows = readings_of("walk", 120, 4000, np.random.default_rng(1))
    modes = np.array(list(modes_on(rows, threshold)))[-1000:]
    assert (modes == CALM).mean() > 0.7
    assert (modes == DENSE).any()


@pytest.mark.parametrize("threshold", [0.01, "auto"])
def test_fair_coins_are_soon_left_alone(threshold: float | str) -> None:
    rows = np.random.default_rng(1).integers(0, 2, (1000, 50)).astype(np.uint8)
    modes = np.array(list(modes_on(rows, threshold)))
    assert (modes[:32] == DENSE).mean() > 0.5
    assert (modes[-200:] == FREE).all()


def test_pairs_near_a_change_are_listed_and_leave_the_list() -> None:
    rows = readings_of("windows", 120, 3000, np.random.default_rng(2))
    snapshot = EmpiricalSnapshot(120, 0.01)
    lengths = []
    for bits in rows:
        snapshot.learn(bits)
        lag = snapshot._lag
        assert lag is not None
        lengths.append(lag.length[0].item())
    assert max(lengths) > 0
    assert lengths.count(0) > 0


def test_counts_may_be_as_large_as_they_get() -> None:
    """Near the end of the clock, sums of counts would not fit."""
    sensors = 40
    eager = EmpiricalSnapshot(sensors, 0.25)
    arrays = dict(eager.arrays())
    clock = 2**32 - 300
    marginals = np.full(sensors, clock - 3, np.uint32)
    joints = np.full(sensors * (sensors - 1) // 2, clock - 5, np.uint32)
    arrays |= {"clock": np.array(clock), "marginals": marginals, "joints": joints}
    lazy = EmpiricalSnapshot.from_arrays(arrays)
    plain = EagerCounts(sensors, 0.25)
    plain.clock = clock
    plain.marginals[:], plain.joints[:] = marginals, joints
    plain.codes[:] = lazy.codes
    rng = np.random.default_rng(3)
    rows = readings_of("rates", sensors, 290, rng)
    for bits in rows:
        assert lazy.learn(bits) == plain.learn(bits)
        np.testing.assert_array_equal(lazy.codes, plain.codes)
    plain.assert_same(lazy)
