"""Evidence matches its definition, and its tail probabilities are valid."""

import math
from datetime import datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from neurosnap.errors import InvalidValueError
from neurosnap.health.alarm_budget import parse_budget, shares
from neurosnap.health.evidence import CLOCKS, KINDS, SUMS, JudgedSteps, follow, peaks
from neurosnap.health.expectation import features, fitted, learned
from neurosnap.health.tail_probability import MEAN, RATE, SHAPE, START, tail_of, weekly
from neurosnap.health.ten_minute_steps import DAY, STEP, parts_of_day, steps_of


def level(tail: np.ndarray, times: float) -> float:
    """Return the evidence that is reached so many times a week."""
    often = max(tail[RATE] / times, 1.0)
    scale = tail[SHAPE] * tail[MEAN]
    return float(tail[START] + scale * (often ** (1 / tail[SHAPE]) - 1))


def by_hand(
    rates: np.ndarray, heard: np.ndarray, came_on: np.ndarray, scales: np.ndarray
) -> list[tuple[float, float, float, float]]:
    """Return silent, less, more and what was expected, from the definitions."""
    clocks, less, rare, often = [0.0] * 4, 0.0, 0.0, 0.0
    made = []
    for step, count in enumerate(came_on):
        rate, calm = max(rates[0, step], 1e-3), max(rates[3, step], 1e-3)

        def chance(of: float, on: bool = count > 0) -> float:
            return 1 - math.exp(-of) if on else math.exp(-of)

        less = max(0.0, less + math.log(chance(0.3 * rate) / chance(rate)))
        rare = max(0.0, rare + min(3.0, math.log(chance(calm + 0.02) / chance(calm))))
        often = max(0.0, often + min(3.0, math.log(chance(calm + 0.3) / chance(calm))))
        for clock in range(4):
            went = rates[clock, step] if clock < 3 else 1.0
            clocks[clock] = 0 if count else clocks[clock] + went * heard[step]
        course = [c / s for c, s in zip(clocks, scales, strict=True)]
        made.append((math.prod(course) ** 0.25, less, max(rare, often), clocks[0]))
    return made


@given(
    arrays(np.float64, (4, 12, 1), elements=st.floats(0, 3)),
    arrays(np.bool_, (12, 1)),
    arrays(np.int32, (12, 1), elements=st.integers(0, 3)),
)
def test_evidence_is_its_definition(
    rates: np.ndarray, heard: np.ndarray, came_on: np.ndarray
) -> None:
    trace, due = np.zeros((12, 1, len(KINDS))), np.zeros((12, 1))
    scales = np.array([[1.0], [2.0], [0.5], [3.0]])
    longest = np.linspace(0, 900, 12, dtype=np.float32)[:, None]
    judged = JudgedSteps(rates, heard, came_on, longest, np.ones((12, 1), np.bool_))
    clocks, sums = np.zeros((CLOCKS, 1)), np.zeros((SUMS, 1))
    follow(clocks, sums, scales, 1e-3, judged, trace, due)
    expected = by_hand(rates[:, :, 0], heard[:, 0], came_on[:, 0], scales[:, 0])
    found = np.column_stack([trace[:, 0, :3], due])
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(trace[:, 0, 3], np.log1p(longest[:, 0]), rtol=1e-6)


@given(st.lists(st.sampled_from([0.0, 0.0, 1.0, 2.5]), max_size=30))
def test_peaks_are_the_largest_of_each_excursion_that_is_over(
    values: list[float],
) -> None:
    runs, run = [], 0.0
    for value in values:
        if value == 0 and run > 0:
            runs.append(run)
        run = max(run, value) if value > 0 else 0.0
    assert peaks(np.array(values)).tolist() == runs


@given(
    st.lists(st.floats(0.1, 50), max_size=40), st.floats(0.5, 8), st.floats(1e-4, 0.1)
)
def test_a_level_is_reached_as_often_as_it_says(
    seen: list[float], weeks: float, times: float
) -> None:
    tail = tail_of(np.array(seen), weeks, 1.0)
    bar = level(tail, times)
    assert weekly(tail, np.array(bar)) == pytest.approx(min(times, tail[0]), rel=1e-6)
    assert weekly(tail, np.array(bar + 1)) < weekly(tail, np.array(bar))


def test_a_tail_holds_what_it_says_on_exponential_peaks() -> None:
    rng = np.random.default_rng(0)
    wanted, trials, over = 0.05, 2000, 0
    for _ in range(trials):
        tail = tail_of(rng.exponential(2.0, 40), 4.0, 0.5)
        # Ten peaks a week: above the bar come `wanted` of them on average.
        over += int(rng.poisson(10 * math.exp(-level(tail, wanted) / 2.0)))
    assert over / trials < 1.3 * wanted


def test_weights_are_of_largest_likelihood() -> None:
    rng = np.random.default_rng(1)
    inputs = (rng.random((4000, 3)) < 0.3).astype(float)
    inputs[:, 2] = 1
    truth = np.array([0.8, 0.0, 0.05])
    on = rng.random(4000) < 1 - np.exp(-inputs @ truth)
    found = fitted(inputs, on, np.ones(4000, np.bool_))
    np.testing.assert_allclose(found, truth, atol=0.08)


def test_a_sensor_says_nothing_of_itself_and_the_past_nothing_of_the_future() -> None:
    rng = np.random.default_rng(2)
    active = rng.random((288, 3)) < 0.2
    parts = parts_of_day(0, len(active), "UTC")
    weights, _ = learned(active, np.ones_like(active), parts)
    for sensor in range(3):
        assert (weights[:, [sensor, 3 + sensor], sensor] == 0).all()
    changed = active.copy()
    changed[100:] = ~changed[100:]
    rows = np.arange(100)
    before = features(active, parts[rows], 6, rows)
    assert np.array_equal(before, features(changed, parts[rows], 6, rows))


def test_what_was_expected_of_the_past_comes_to_what_there_was() -> None:
    """Two sensors come on in turn, at the same hours of every day."""
    steps = 28 * DAY
    active = np.zeros((steps, 2), np.bool_)
    rng = np.random.default_rng(3)
    for day in range(28):
        active[day * DAY + rng.integers(110, 130), day % 2] = True
    parts = parts_of_day(0, steps, "UTC")
    _, rates = learned(active, np.ones_like(active), parts)
    expected = -np.expm1(-rates[0])
    np.testing.assert_allclose(expected.sum(0), active.sum(0), rtol=0.5)


@pytest.mark.parametrize(
    ("zone", "moment", "part"),
    [
        ("UTC", "2026-03-27T06:50Z", 2),  # a Friday
        ("Europe/Berlin", "2026-03-27T21:10Z", 7),
        ("Europe/Berlin", "2026-03-27T23:00Z", 8),  # a Saturday there
        ("Europe/Berlin", "2026-03-28T05:00Z", 8 + 2),
        ("Europe/Berlin", "2026-03-29T04:00Z", 8 + 2),  # the clock went forward
        ("Asia/Kolkata", "2026-03-29T18:30Z", 0),  # a Monday there
    ],
)
def test_parts_of_a_day_are_those_of_the_local_clock(
    zone: str, moment: str, part: int
) -> None:
    first = int(datetime.fromisoformat(moment).timestamp() // STEP)
    assert parts_of_day(first, 1, zone).tolist() == [part]
    week = parts_of_day(first - 1000, 1009, zone)
    assert (week[999], week[1000]) == (*parts_of_day(first - 1, 1, zone), part)


def test_steps_count_beginnings_and_know_how_long() -> None:
    steps = steps_of([(30, 40, 0), (50, 1900, 0), (700, 700, 1)], 2, 0, 2400)
    assert steps.came_on[:, 0].tolist() == [2, 0, 0, 0]
    assert steps.came_on[:, 1].tolist() == [0, 1, 0, 0]
    assert steps.longest[:, 0].tolist() == [550, 1150, 1750, 1850]


def test_a_budget_is_shared_and_shrinks_when_it_is_exceeded() -> None:
    by_hand = np.array([0.125, 0.025, 0.05, 0.025, 0.025])
    # Four in four weeks are due.
    for raised, part in ((0, 1.0), (3, 1.0), (4, 1.0), (8, 0.5), (40, 0.1)):
        np.testing.assert_allclose(shares(1.0, 4, raised), part * by_hand)
    assert parse_budget("1/week") == 1
    assert parse_budget("2/day") == pytest.approx(14)
    for text in ("0/week", "1", "1/year", "x/day", "-1/week"):
        with pytest.raises(InvalidValueError, match=r"^alarms: must be a number"):
            parse_budget(text)
