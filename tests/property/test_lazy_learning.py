"""Lazy learning gives the same bits as eager learning.

The other side judges every pair at every observation: `Eager`.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import AUTO
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.lazy_counting_kernels import CALM, DENSE, FREE


class Eager:
    """A snapshot that judges every pair at every observation.

    It has the four weights of each pair, since its first reading of all is unknown; so
    it is one observation ahead.
    """

    def __init__(self, sensors: int, threshold: float | str) -> None:
        self.snapshot = EmpiricalSnapshot(sensors, threshold)
        self.snapshot.learn(np.zeros(sensors), np.zeros(sensors, np.bool_))

    def assert_same(self, snapshot: EmpiricalSnapshot) -> None:
        """Assert that a snapshot has the same weights, codes, dates and graph."""
        alone = EmpiricalSnapshot.from_bytes(snapshot.to_bytes())
        alone.stand_apart()
        arrays, mine = alone.arrays(), self.snapshot.arrays()
        assert arrays["clock"] == mine["clock"] - 1
        blocks = alone._weights.blocks(snapshot.clock)
        squares = np.hstack([block for _, block in blocks])
        np.testing.assert_array_equal(squares, mine["squares"])
        dates = np.where(mine["since"] > 0, mine["since"] - 1, 0)
        np.testing.assert_array_equal(arrays["since"], dates)
        np.testing.assert_array_equal(snapshot.codes, self.snapshot.codes)
        edges = self.snapshot.poc_graph().edges
        np.testing.assert_array_equal(snapshot.poc_graph().edges, edges)
        for name in {"spells", "last"} & arrays.keys():
            np.testing.assert_array_equal(arrays[name], mine[name])


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


@given(sources(), st.data())
def test_codes_are_the_same_after_every_observation_whatever_is_done_meanwhile(
    rows: Bits, data: st.DataObject
) -> None:
    threshold = data.draw(THRESHOLDS)
    lazy = EmpiricalSnapshot(rows.shape[1], threshold)
    eager = Eager(rows.shape[1], threshold)
    whens = st.lists(st.integers(0, len(rows)), max_size=4)
    stops = {
        what: set(data.draw(whens, label=what))
        for what in ("saved", "compared", "weighed")
    }
    for tick, bits in enumerate(rows):
        assert lazy.learn(bits) == eager.snapshot.learn(bits)
        assert lazy.codes.tobytes() == eager.snapshot.codes.tobytes()
        if tick in stops["saved"]:
            lazy = EmpiricalSnapshot.from_bytes(lazy.to_bytes())
        if tick in stops["compared"]:
            eager.assert_same(lazy)
        if tick in stops["weighed"] and rows.shape[1] > 1:
            assert lazy.weight(2, 0) == eager.snapshot.weight(2, 0)
    eager.assert_same(lazy)


@given(sources(), st.booleans(), st.integers(0, 150))
def test_an_unknown_reading_finds_all_counted(
    rows: Bits, auto: bool, more: int
) -> None:
    """The four weights of each pair are taken on from counts that were put off."""
    count = rows.shape[1]
    threshold: float | str = AUTO if auto else 0.01
    lazy, eager = EmpiricalSnapshot(count, threshold), Eager(count, threshold)
    for bits in rows:
        lazy.learn(bits)
        eager.snapshot.learn(bits)
    lazy.learn(rows[-1], known=np.zeros(count, np.bool_))
    mine = eager.snapshot.arrays()["squares"]
    np.testing.assert_array_equal(lazy.arrays()["squares"], mine)
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
        lag = snapshot._due
        assert lag is not None
        yield lag.modes[2:].copy()


@pytest.mark.parametrize("threshold", [0.01, "auto"])
def test_a_walk_leaves_most_pairs_alone(threshold: float | str) -> None:
    rows = readings_of("walk", 120, 4000, np.random.default_rng(1))
    modes = np.concatenate(list(modes_on(rows, threshold))[-1000:])
    assert modes.size > 1000 * 90
    assert (modes == CALM).mean() > 0.7
    assert (modes == DENSE).any()


@pytest.mark.parametrize("threshold", [0.01, "auto"])
def test_fair_coins_are_soon_left_alone(threshold: float | str) -> None:
    rows = np.random.default_rng(1).integers(0, 2, (1000, 50)).astype(np.uint8)
    modes = list(modes_on(rows, threshold))
    assert (np.concatenate(modes[:32]) == DENSE).mean() > 0.5
    assert (np.concatenate(modes[-200:]) == FREE).all()


def test_pairs_near_a_change_are_listed_and_leave_the_list() -> None:
    rows = readings_of("windows", 120, 3000, np.random.default_rng(2))
    snapshot = EmpiricalSnapshot(120, 0.01)
    lengths = []
    for bits in rows:
        snapshot.learn(bits)
        lag = snapshot._due
        assert lag is not None
        lengths.append(lag.length[0].item())
    assert max(lengths) > 0
    assert lengths.count(0) > 0


def test_counts_may_be_as_large_as_they_get() -> None:
    """Near the end of the clock, sums of counts would not fit."""
    sensors = 40
    blank = EmpiricalSnapshot(sensors, 0.25)
    blank.stand_apart()
    arrays = dict(blank.arrays())
    clock = 2**32 - 300
    marginals = np.full(sensors, clock - 3, np.uint32)
    joints = np.full(sensors * (sensors - 1) // 2, clock - 5, np.uint32)
    arrays |= {"clock": np.array(clock), "marginals": marginals, "joints": joints}
    lazy, eager = EmpiricalSnapshot.from_arrays(arrays), Eager(sensors, 0.25)
    blocks = lazy._weights.blocks(clock)
    squares = np.hstack([block for _, block in blocks]).astype(np.uint32)
    arrays |= {"clock": np.array(clock + 1), "squares": squares}
    eager.snapshot = EmpiricalSnapshot.from_arrays(arrays)
    for bits in readings_of("rates", sensors, 290, np.random.default_rng(3)):
        assert lazy.learn(bits) == eager.snapshot.learn(bits)
        np.testing.assert_array_equal(lazy.codes, eager.snapshot.codes)
    eager.assert_same(lazy)
