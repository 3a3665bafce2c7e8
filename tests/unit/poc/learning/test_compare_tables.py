"""What a machine changed is found, and what chance changed is not."""

import math
from functools import partial

import numpy as np
import pytest

from neurosnap.poc.learning import compare_tables as module
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.compare_tables import Differences, compare_tables
from neurosnap.poc.learning.lags import longest_lag
from neurosnap.poc.learning.two_samples import by_stretches, by_trials
from tests.support.changed import KINDS, recorded_twice
from tests.support.exhaustive import rows

FIRST = 100_000
"""The first seed; constants were chosen by others, all below."""
TOLD = {
    "removed": {"lost", "less"},
    "added": {"gained", "more", "less", "lost"},
    "later": {"later", "weaker", "lost"},
    "flips": {"weaker", "stronger", "lost", "more", "later"},
}
"""What may be said first of the sensors that a change was planted on."""


def compared(kind: str, seed: int) -> tuple[Differences, set[str]]:
    pair = recorded_twice(kind, seed)
    found = compare_tables(Columns.of(pair.good), Columns.of(pair.new))
    return found, {f"s{sensor}" for sensor in pair.changed}


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    ("kind", "pairs"), rows([(k, 2) for k in KINDS], [(k, 100) for k in KINDS])
)
def test_a_planted_change_is_found_and_its_sensor_is_suspected_first(
    kind: str, pairs: int
) -> None:
    right = 0
    for seed in range(FIRST, FIRST + pairs):
        found, changed = compared(kind, seed)
        if right_first := bool(found.rows) and found.suspects[0] in changed:
            first = next(row for row in found.rows if row.sensors & changed)
            assert first.change in TOLD.get(kind, {first.change})
        right += right_first
    assert right >= 0.95 * pairs


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("pairs", rows([4], [100]))
def test_without_a_change_nothing_is_told(pairs: int) -> None:
    told = [bool(compared("", seed)[0].rows) for seed in range(FIRST, FIRST + pairs)]
    assert sum(told) <= 0.05 * pairs


def motor(ticks: int, seed: int, delay: int = 2) -> np.ndarray:
    """A motor, a belt that follows it, a lamp opposite to it, and something else."""
    chance = np.random.default_rng(seed)
    lengths = chance.integers(6, 30, ticks)
    on = np.repeat(np.arange(ticks) % 2, lengths)[:ticks].astype(float)
    other = np.repeat(chance.random(ticks) < 0.5, chance.permutation(lengths))[:ticks]
    return np.stack([on, np.roll(on, delay), 1 - on, other], axis=1)


def differ(good: np.ndarray, new: np.ndarray, *, period: float = 0) -> Differences:
    return compare_tables(Columns.of(good), Columns.of(new), period=period)


def test_what_is_told_has_its_support_in_both() -> None:
    good, new = motor(6000, 0), motor(4000, 1, delay=5)
    new[::7, 2], new[::9, 1] = new[::7, 0], np.nan
    found = differ(good, new)
    lamp = next(row for row in found.rows if row.sensors == {"s0", "s2"})
    assert (lamp.change, lamp.relation) == ("lost", "s0 and s2: opposite")
    assert (lamp.failed, lamp.within, lamp.within_new) == (0, None, None)
    assert lamp.tested == np.sum(np.diff(good[:, 0]) > 0) + (good[0, 0] == 1)
    belt = next(row for row in found.rows if row.sensors == {"s0", "s1"})
    assert (belt.change, belt.within, belt.within_new) == ("later", 2, 5)
    assert belt.relation == "s0 for 2 ticks implies s1 (lag 2 ticks, now 5 ticks)"
    assert belt.failed == 0
    assert belt.failed_new == belt.tested_new > 50
    assert all(row.chance < 0.05 for row in found.rows)
    assert set(found.suspects) >= {"s2"}
    assert "s3" not in found.suspects
    back = {row.sensors: row.change for row in differ(new, good).rows}
    assert (back[lamp.sensors], back[belt.sensors]) == ("gained", "sooner")


def test_what_comes_later_is_not_called_lost() -> None:
    rows = differ(motor(6000, 0, delay=0), motor(6000, 1, delay=3)).rows
    [belt] = [row for row in rows if row.sensors == {"s0", "s1"}]
    assert (belt.change, belt.within, belt.within_new) == ("later", 0, 3)


def test_an_unknown_reading_is_no_evidence() -> None:
    good, new = motor(6000, 0), motor(6000, 1)
    new[:, 1] = np.nan
    found = differ(good, new)
    assert found.rows == []
    assert (found.relations, found.untested) == (3, 2)


def test_what_is_known_beforehand_is_not_asked() -> None:
    good, new = motor(6000, 0)[:, :3:2], motor(6000, 1)[:, :3:2]
    good[:3000, 1], new[:, 1] = np.roll(good[:3000, 1], 1), np.roll(new[:, 1], 6)
    tables = Columns.of(good), Columns.of(new)
    opposite = [(0, 3), (2, 1), (1, 2), (3, 0)]
    pairs = [row for row in compare_tables(*tables, opposite).rows if row.b]
    assert pairs == []
    assert [row for row in compare_tables(*tables).rows if row.b]


def test_a_burst_of_failures_or_fewer_occasions_break_no_relation() -> None:
    chance = np.random.default_rng(5)
    copies = np.zeros((4, 12_000, 3), np.bool_)
    for table, rate in zip(copies, (0.2, 0.2, 0.02, 0.2), strict=True):
        pulses = np.cumsum(4 + chance.geometric(rate, 12_000))
        table[pulses[pulses < 12_000]] = True
        table[:, 1] ^= chance.random(12_000) < 0.01
    copies[:, :, 2] = chance.random((4, 12_000)) < 0.005
    copies[1, 1000:1300, 1] ^= chance.random(300) < 0.8
    copies[1, 1000:1300:2, 2] = True
    copies[3, :, 1] ^= chance.random(12_000) < 0.02
    for order in slice(None), slice(None, None, -1):
        good, *others = copies[:, :, order]
        found = [differ(good, each).rows for each in others]
        told = [[r.change for r in rows if r.b and r.within is None] for rows in found]
        assert told == [[], [], ["lost"]]
        assert found[0] == []


def test_of_two_the_one_with_fewer_relations_left_is_suspected() -> None:
    chance = np.random.default_rng(6)
    tables = []
    for _ in range(2):
        a, b = chance.random((2, 4000))
        tables.append(np.stack([a < 0.6, a < 0.3, (a > 0.3) & (b < 0.4)], axis=1))
    tables[1][:, 2] = chance.permutation(tables[1][:, 2])
    found = differ(tables[0], tables[1])
    assert [row.relation for row in found.rows] == ["s1 and s2: never together"]
    assert found.suspects == ["s2"]


def test_of_too_many_some_are_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    few = partial(longest_lag, work=15_000)
    monkeypatch.setattr(module, "longest_lag", few)
    rows = differ(motor(9000, 0), motor(9000, 1, delay=5), period=0.5).rows
    [belt] = [row for row in rows if row.sensors == {"s0", "s1"}]
    assert (belt.change, belt.within_new) == ("later", 5)
    assert belt.relation == "s0* implies s1* within 1 s (lag 1 s, now 2.5 s)"


@pytest.mark.parametrize("first", [(0, 80), (3, 40), (30, 31), (0, 1)])
@pytest.mark.parametrize("second", [(9, 70), (70, 70), (1, 200)])
def test_the_bound_by_trials_is_at_least_fishers(
    first: tuple[int, int], second: tuple[int, int]
) -> None:
    (x, n), (y, m) = first, second
    most = min(m, x + y)
    ways = sum(math.comb(m, k) * math.comb(n, x + y - k) for k in range(y, most + 1))
    exact = ways / math.comb(n + m, x + y)
    [[told], [back]] = by_trials(np.array([[x], [y]]), np.array([[n], [m]])).tolist()
    if y * n > x * m:
        assert exact * 0.999 <= math.exp(-told) <= 2 * exact
        assert back == 0
    else:
        assert told == 0


def test_a_burst_or_what_lingers_is_worth_one_occasion() -> None:
    tested, none = np.full(32, 50), np.zeros(32, np.int64)
    even = np.arange(32) % 3
    burst, lingers = none.copy(), np.where(np.arange(32) < 16, 2, 0)
    burst[5] = even.sum()
    assert by_stretches((none, even), (tested, tested)) > 15
    assert by_stretches((none, burst), (tested, tested)) < 3
    assert by_stretches((none, lingers), (tested, tested)) < 5
    assert by_stretches((even, none), (tested, tested)) == 0
    assert by_stretches((none, tested), (tested, tested)) > 600
