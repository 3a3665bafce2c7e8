"""What holds late: windows one by one, planted lags, and flips that are none."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.beyond_pairs import Limits
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.lags import (
    Lag,
    _chosen,
    bits_of,
    find_lags,
    longest_lag,
    proposed,
    shortest,
    waits,
)
from neurosnap.poc.learning.relation_table import Relation, tabulate
from neurosnap.poc.order.literal_sets import from_words
from tests.support.planted import planted

Flags = NDArray[np.bool_]
CHANCE = np.random.default_rng
ALONE = Limits(1, 32)


def slow(seed: int, ticks: int, hold: float = 0.95) -> Flags:
    """Return a sensor that stays as it is at most ticks."""
    chance = CHANCE(seed)
    fresh = chance.random(ticks) >= hold
    last = np.maximum.accumulate(np.where(fresh, np.arange(ticks), 0))
    taken: Flags = (chance.random(ticks) < 0.5)[last]
    return taken


def late(sensor: Flags, ticks: int) -> Flags:
    return np.concatenate([np.zeros(ticks, np.bool_), sensor[: len(sensor) - ticks]])


def told(*sensors: Flags, limits: Limits = ALONE) -> list[Relation]:
    names = ["a", "b", "c", "d"][: len(sensors)]
    return tabulate(Columns.of(np.stack(sensors, axis=1), names), limits=limits)


@pytest.mark.parametrize(
    ("first", "ticks"), [*itertools.product((True, False), (0, 1, 5, 63))]
)
def test_windows_are_what_is_read_one_by_one(first: bool, ticks: int) -> None:
    table = CHANCE(1).choice([0, 1, np.nan], (200, 2), p=[0.1, 0.8, 0.1])
    columns = Columns.of(table)
    lag = Lag(0, 3, ticks, first)
    end, other, whole, broken = (
        from_words(each, 200) for each in bits_of(columns, lag)
    )
    for tick in range(200):
        window = table[max(0, tick - ticks) : tick + 1, 0]
        at = table[max(0, tick - ticks) if first else tick, 1]
        inside = tick >= ticks
        assert whole[tick] == (inside and (window == 1).all())
        assert broken[tick] == (inside and (window == 0).any())
        assert end[tick] == (inside and at == 0)
        assert other[tick] == (inside and at == 1)


@pytest.mark.parametrize("ticks", [1, 4, 20])
def test_a_copy_that_comes_late_is_told_with_its_lag(ticks: int) -> None:
    first = slow(2, 6000, 0.97)
    rows = told(first, late(first, ticks), slow(3, 6000))
    assert {row.sentence for row in rows} == {
        f"a implies b within {ticks} tick{'s' * (ticks > 1)}",
        f"a* implies b* within {ticks} tick{'s' * (ticks > 1)}",
    }
    assert {(row.soonest, row.usual) for row in rows} == {(ticks, ticks)}


def test_flipped_readings_do_not_widen_a_lag() -> None:
    chance = CHANCE(8)
    first = slow(9, 20_000, 0.97)
    both = (each ^ (chance.random(20_000) < 0.01) for each in (first, late(first, 6)))
    assert {row.within for row in told(*both) if row.within} == {6}


def test_an_answer_with_jitter_is_told_with_the_longest_wait() -> None:
    chance = CHANCE(4)
    asked = np.zeros(5000, np.bool_)
    asked[np.cumsum(chance.integers(12, 60, 130))] = True
    answers = np.zeros(5000, np.bool_)
    answers[
        np.minimum(np.flatnonzero(asked) + chance.integers(3, 8, asked.sum()), 4999)
    ] = True
    rows = {row.sentence: row for row in told(asked, answers)}
    assert rows.keys() == {
        "a implies b within 7 ticks",
        "b only within 7 ticks after a",
    }
    row = rows["a implies b within 7 ticks"]
    assert (row.soonest, row.last_failure) == (3, None)
    assert 4 <= row.usual <= 6
    assert row.explains > 100
    assert row.tested == asked.sum()
    answers[np.flatnonzero(answers)[::3]] = False
    (row,) = told(asked, answers)
    assert row.sentence == "b only within 7 ticks after a"
    assert (row.tested, row.failed) == (answers.sum(), 0)


def test_what_lasts_must_last_to_be_answered() -> None:
    """A valve that is opened for a moment only brings nothing."""
    chance = CHANCE(5)
    lengths = chance.choice([2, 9], 400)
    valve = np.concatenate([np.arange(n + 7) < n for n in lengths])
    flow = valve & late(valve, 1) & late(valve, 2) & late(valve, 3)
    rows = told(valve, flow)
    assert "a for 3 ticks implies b" in {row.sentence for row in rows}


def test_a_tick_of_latency_is_no_near_relation() -> None:
    """Now and then a stop is seen a tick after its command."""
    stop, chance = np.zeros(3000, np.bool_), CHANCE(7)
    starts = np.cumsum(chance.integers(60, 260, 18))
    for start, length in zip(starts, chance.integers(5, 30, 18), strict=True):
        stop[start : start + length] = True
    running = ~stop
    running[starts[[2, 5, 9, 14]]] = True
    assert {row.sentence for row in told(stop, running, slow(6, 3000))} == {
        "at least one of a and b",
        "a implies b* within 1 tick",
    }


@pytest.mark.parametrize("hold", [0, 0.5, 0.9])
def test_flipped_readings_are_no_lag(hold: float) -> None:
    for seed, noise in enumerate((0, 0.002, 0.01)):
        wanted = planted(seed, noise, sensors=92, hold=hold)
        rows = tabulate(Columns.of(wanted.table), limits=ALONE)
        assert not [row.sentence for row in rows if row.within]


def test_a_search_passes_no_lag_over() -> None:
    first = slow(11, 2000, 0.9)
    columns = Columns.of(np.stack([first, late(first, 9), late(first, 13)], axis=1))
    found = proposed(columns, 30, 415.0, np.ones((3, 3), np.float32))
    for side, u, x in np.argwhere(found >= 0):
        lags = [[Lag(u, x, k, end) for k in range(31)] for end in (side == 0, side > 0)]
        bits = np.array([[bits_of(columns, lag) for lag in some] for some in lags])
        ends, whole = bits[:, :, 0], bits[:, :, 2]
        both = np.bitwise_count(ends & whole).sum(axis=-1).astype(float)
        wide = np.bitwise_count(whole[0]).sum(axis=-1).astype(float)
        times = float(np.bitwise_count(columns.ticks_of(x)).sum())
        told = _chosen(both[0], both[1], times, wide, 2000, 415.0)
        assert found[side, u, x] == told * (u >> 1 != x >> 1)
    assert {4, 9} <= {*found.ravel().tolist()}


def test_independent_sensors_answer_nothing() -> None:
    table = np.stack([slow(seed, 4000, 0.8) for seed in range(40)], axis=1)
    assert find_lags(Columns.of(table), 32) == []


def test_what_takes_as_long_as_two_others_follows() -> None:
    reach = np.eye(6, dtype=np.bool_)
    one, two = Lag(3, 0, 2, True), Lag(5, 2, 3, True)
    both, sooner = Lag(5, 0, 5, True), Lag(5, 0, 4, True)
    assert [*shortest([both, two, one], reach, 32)] == [one, two]
    assert [*shortest([sooner, two, one], reach, 32)] == [one, two, sooner]
    reach[2, 4] = reach[5, 3] = True  # at once
    assert [*shortest([one, both], reach, 32)] == [one]


def test_waits_are_counted_from_where_the_answer_is_awaited() -> None:
    first = [0, 1, 1, 0, 0, 1, 0, 0, 0, 1, 0]
    then = [0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0]
    columns = Columns.of(np.array([first, then]).T)
    assert waits(columns, Lag(3, 0, 3, True)) == (2, 3, 3)
    assert waits(columns, Lag(3, 0, 1, True)) == (0, 0, 0)


def test_of_too_many_sensors_shorter_lags_are_looked_for_and_that_is_said() -> None:
    table = CHANCE(9).random((64, 3000)) < 0.5
    assert longest_lag(Columns.of(table[:, :1000]), 63) == 63
    wide = longest_lag(Columns.of(np.repeat(table, 20, axis=0)), 63)
    assert wide < 63
    assert wide * 2 * 6000 * 5998 * 20 <= 1 << 35


@pytest.mark.parametrize(("premises", "lag"), [(0, 1), (4, 1), (1, -1), (1, 64)])
def test_limits_out_of_range_are_refused(premises: int, lag: int) -> None:
    with pytest.raises(InvalidValueError, match="must be"):
        Limits.of(premises, lag)
