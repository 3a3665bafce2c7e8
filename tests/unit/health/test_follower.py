"""The follower of a run's readings builds ten-minute steps and reports what is new."""

from collections.abc import Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.health import follower as followers
from neurosnap.health.alarm import Alarm
from neurosnap.health.follower import Follower, usual_step
from neurosnap.health.level_evidence import Levels
from neurosnap.health.machine_monitor import Judged, MachineMonitor
from neurosnap.health.monitor import HealthMonitor
from neurosnap.health.ten_minute_steps import STEP, Steps, steps_of

START = 1_600_000_123.0


class KeptLevels(MachineMonitor):
    """Keeps the levels that it is given, and judges nothing."""

    def __init__(self, names: Sequence[str], *rest: Any) -> None:
        super().__init__(names, *rest)
        self.on: list[np.ndarray] = []
        self.known: list[np.ndarray] = []
        self.numbers: list[int] = []

    def follow(self, levels: Levels, number: int) -> Judged:
        self.on += [*levels.on]
        self.known += [*levels.known]
        self.numbers.append(number)
        return [], {}


def machine(count: int, step: float) -> tuple[Follower, KeptLevels]:
    with patch.object(followers, "MachineMonitor", KeptLevels):
        follower = Follower([f"s{k}" for k in range(count)], step=step)
    assert isinstance(follower.monitor, KeptLevels)
    return follower, follower.monitor


class Kept(HealthMonitor):
    """Keeps the steps that it is given, and judges nothing."""

    def __init__(self, names: Sequence[str], *_: str) -> None:
        super().__init__(names)
        self.steps: list[Steps] = []
        self.valid: list[list[bool]] = []

    def follow(
        self, steps: Steps, valid: np.ndarray | None = None
    ) -> tuple[list[Alarm], list[str]]:
        assert valid is not None
        self.steps.append(steps)
        self.valid += valid.tolist()
        return [], []


def following(count: int) -> tuple[Follower, Kept]:
    with patch.object(followers, "HealthMonitor", Kept):
        follower = Follower([f"s{k}" for k in range(count)])
    assert isinstance(follower.monitor, Kept)
    return follower, follower.monitor


def flags(*values: int) -> np.ndarray:
    return np.array(values, np.bool_)


# Per sensor: for how long it is off, and then on, in turn; seconds.
COURSES = st.lists(
    st.lists(st.tuples(st.integers(1, 2000), st.integers(1, 2000)), max_size=5),
    min_size=1,
    max_size=3,
)


@given(COURSES, st.data())
def test_it_makes_the_steps_that_intervals_make(
    courses: list[list[tuple[int, int]]], data: st.DataObject
) -> None:
    intervals: list[tuple[float, float, int]] = []
    for sensor, course in enumerate(courses):
        at = START
        for off, on in course:
            intervals.append((at + off, at + off + on, sensor))
            at += off + on
    edges = sorted({START, *(t for a, b, _ in intervals for t in (a, b))})
    follower, kept = following(len(courses))
    for at in edges:
        now = {sensor for a, b, sensor in intervals if a <= at < b}
        reads = np.array([sensor in now for sensor in range(len(courses))])
        follower.observe(reads, np.ones(len(courses), np.bool_), at)
        if data.draw(st.booleans()):
            follower.until(at + data.draw(st.integers(0, 1)) * 0.5)
    follower.until(edges[-1] + STEP)
    expected = steps_of(intervals, len(courses), START, edges[-1] + STEP)
    count = len(expected)
    assert [step.first for step in kept.steps[:count]] == [
        expected.first + k for k in range(count)
    ]
    came_on = np.concatenate([step.came_on for step in kept.steps[:count]])
    longest = np.concatenate([step.longest for step in kept.steps[:count]])
    assert np.array_equal(came_on, expected.came_on)
    np.testing.assert_allclose(longest, expected.longest, atol=0.51)
    assert all(map(all, kept.valid))


def test_what_was_unknown_all_along_is_not_valid() -> None:
    follower, kept = following(2)
    follower.observe(flags(1, 1), flags(1, 0), 6000.0)
    follower.observe(flags(1, 0), flags(1, 1), 6700.0)
    follower.observe(flags(1, 1), flags(0, 1), 6800.0)
    follower.until(8400.0)
    assert kept.valid == [[True, False], [True, True], [False, True], [False, True]]
    # One that becomes unknown is not on: it came on once, and lasted for 800 s.
    assert [step.came_on.tolist() for step in kept.steps[:2]] == [[[1, 0]], [[0, 1]]]
    assert kept.steps[1].longest.tolist() == [[800.0, 400.0]]


def test_while_nobody_listened_nothing_is_known() -> None:
    follower, kept = following(1)
    follower.observe(flags(1), flags(1), 6000.0, begins=True)
    follower.observe(flags(1), flags(1), 6000.0 + 3 * STEP, begins=True)
    follower.until(6000.0 + 4 * STEP)
    assert kept.valid == [[True], [False], [False], [True]]
    assert [step.came_on.tolist() for step in kept.steps] == [
        [[1]],
        [[0]],
        [[0]],
        [[1]],
    ]


def test_time_that_goes_back_stands_still() -> None:
    follower, kept = following(1)
    assert follower.until(1e9) == []  # before anything was seen
    follower.observe(flags(0), flags(1), 6000.0)
    follower.observe(flags(1), flags(1), 5000.0)
    follower.observe(flags(0), flags(1), 6100.0)
    follower.until(6600.0)
    assert [step.first for step in kept.steps] == [10]
    assert kept.steps[0].longest.tolist() == [[100.0]]


READINGS = st.lists(
    st.tuples(st.integers(1, 40), st.integers(0, 3), st.integers(0, 3)), min_size=1
)


@given(READINGS)
def test_a_machines_steps_hold_for_how_long_each_sensor_was_on(
    readings: list[tuple[int, int, int]],
) -> None:
    # Quarters of a second; the bits of two sensors that are on, and that are known.
    follower, kept = machine(2, 2.0)
    at, quarters = 4000, []
    for lasts, on, known in readings:
        reads, sure = flags(on & 1, on & 2), flags(known & 1, known & 2)
        follower.observe(reads, sure, at / 4)
        quarters += [(reads, sure)] * lasts
        at += lasts
    follower.until(at / 4)
    whole = np.array(quarters)[8 : len(quarters) // 8 * 8]  # the first is not judged
    known = whole[:, 1].reshape(-1, 8, 2).mean(1)
    on = (whole[:, 0] & whole[:, 1]).reshape(-1, 8, 2).mean(1)
    assert kept.numbers == [501 + k for k in range(len(on))]
    if len(on):
        assert np.allclose(kept.known, known)
        assert np.allclose(np.array(kept.on) * known, on)


def test_a_machines_step_in_which_listening_began_is_not_judged() -> None:
    follower, kept = machine(1, 1.0)
    follower.observe(flags(1), flags(1), 10.0)
    follower.observe(flags(1), flags(1), 13.5, begins=True)
    follower.until(15.0)
    assert kept.numbers == [11, 12, 14]
    assert [each.tolist() for each in kept.known] == [[0.0], [0.0], [1.0]]


def test_a_machine_that_is_not_read_is_not_judged_whatever_it_read_last() -> None:
    follower, kept = machine(1, 1.0)
    follower.observe(flags(1), flags(1), 10.0)
    follower.observe(flags(1), flags(1), 1e9)
    follower.until(1e9 + 2)
    assert kept.numbers == [*range(11, 15), 1_000_000_001]
    assert np.array(kept.known).all()


@pytest.mark.parametrize(
    ("times", "step"),
    [
        (np.arange(100) * 3600.0, 3600.0),
        (np.arange(100) * 0.1, 1.0),
        (np.cumsum(np.random.default_rng(0).exponential(3.0, 100)), None),
        (np.cumsum(np.random.default_rng(0).exponential(300.0, 100)), 0.0),
        (np.zeros(3), 0.0),
        (np.zeros(0), 0.0),
    ],
    ids=["by the hour", "quick", "quick, by events", "a home", "no time", "nothing"],
)
def test_a_machine_is_read_by_a_clock_or_often(
    times: np.ndarray, step: float | None
) -> None:
    expected = round(float(np.median(np.diff(times))), 3) if step is None else step
    assert usual_step(times) == expected
