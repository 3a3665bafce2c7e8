"""Learning that puts off what changes no code is the same bits as one that does not.

The other side judges every pair at every observation: `tests.support.eager_learning`.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.learning.update_kernels_lazy import CALM, DENSE, FREE
from tests.support.eager_learning import EagerCounts

Bits = NDArray[np.uint8]

KINDS = "walk", "windows", "rates", "noise", "stands"


def rows_of(kind: str, sensors: int, ticks: int, rng: np.random.Generator) -> Bits:
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
        st.lists(st.tuples(st.sampled_from(KINDS), lengths), min_size=1, max_size=5)
    )
    rows = np.vstack([rows_of(kind, sensors, ticks, rng) for kind, ticks in stretches])
    wrong = draw(st.sampled_from([0, 0, 0.001, 0.02]))
    return rows ^ (rng.random(rows.shape) < wrong).astype(np.uint8)


@st.composite
def thresholds(draw: st.DrawFn, sensors: int) -> float | str | NDArray[np.float64]:
    """Draw a threshold of each sort."""
    sort = draw(st.sampled_from(["auto", "one", "each"]))
    if sort == "one":
        return draw(st.sampled_from([0.25, 1 / 32, 0.01, 1e-5]))
    if sort == "each":
        rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
        half = np.triu(rng.uniform(0.001, 0.125, (sensors, sensors)))
        return half + half.T
    return sort


def both(
    sensors: int, threshold: float | str | NDArray[np.float64]
) -> tuple[EmpiricalSnapshot, EagerCounts]:
    return EmpiricalSnapshot(sensors, threshold), EagerCounts(sensors, threshold)


@given(sources(), st.data())
def test_codes_are_the_same_after_every_observation(
    rows: Bits, data: st.DataObject
) -> None:
    lazy, eager = both(rows.shape[1], data.draw(thresholds(rows.shape[1])))
    for bits in rows:
        assert lazy.learn(bits) == eager.learn(bits)
        assert lazy.codes.tobytes() == eager.codes.tobytes()
    eager.assert_same(lazy)


@given(sources(), st.data())
def test_it_can_be_read_saved_and_interrupted_at_any_time(
    rows: Bits, data: st.DataObject
) -> None:
    lazy, eager = both(rows.shape[1], data.draw(thresholds(rows.shape[1])))
    whens = st.lists(st.integers(0, len(rows)), max_size=4)
    stops = {
        what: set(data.draw(whens, label=what))
        for what in ("saved", "compared", "skipped", "weighed")
    }
    for tick, bits in enumerate(rows):
        lazy.learn(bits)
        eager.learn(bits)
        if tick in stops["skipped"]:
            lazy.skip()
            eager.skipped += 1
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
    rows = rows_of("walk", 120, 4000, np.random.default_rng(1))
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
    rows = rows_of("windows", 120, 3000, np.random.default_rng(2))
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
    rows = rows_of("rates", sensors, 290, rng)
    for bits in rows:
        assert lazy.learn(bits) == plain.learn(bits)
        np.testing.assert_array_equal(lazy.codes, plain.codes)
    plain.assert_same(lazy)
