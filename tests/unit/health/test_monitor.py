"""The monitor finds planted faults and raises no alarms without them."""

import functools
import math
import re
from copy import deepcopy
from datetime import datetime, timedelta
from zoneinfo import ZoneInfo

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.health.alarm import Alarm
from neurosnap.health.judge import WELL
from neurosnap.health.monitor import HealthMonitor
from neurosnap.health.ten_minute_steps import DAY, Steps, steps_of
from tests.support.exhaustive import rows
from tests.support.lived_in import SENSORS, START, Interval, in_steps, lived_in

DAYS, ONSET_DAY = 28, 21
ONSET = START + ONSET_DAY * 86400.0
BATH, FLUSH, FRIDGE = (SENSORS.index(name) for name in ("bath", "flush", "fridge"))
pytestmark = pytest.mark.slow


def part(steps: Steps, low: int, high: int) -> Steps:
    return Steps(steps.came_on[low:high], steps.longest[low:high], steps.first + low)


@functools.cache
def known_well() -> HealthMonitor:
    """Return a monitor that has followed the home of seed 1 until the onset."""
    monitor = HealthMonitor(SENSORS)
    monitor.follow(in_steps(lived_in(ONSET_DAY, 1), ONSET_DAY))
    return monitor


def watched(
    intervals: list[Interval], valid: NDArray[np.bool_] | None = None
) -> tuple[HealthMonitor, list[Alarm], list[str]]:
    """Return what a monitor says after the onset of a home like seed 1 before it."""
    monitor = deepcopy(known_well())
    steps = in_steps(sorted(intervals), DAYS)
    later = part(steps, ONSET_DAY * DAY, len(steps))
    return monitor, *monitor.follow(later, valid)


def without(sensor: int, begin: float = ONSET, end: float = math.inf) -> list[Interval]:
    """Return what a sensor that fails leaves of the home of seed 1."""
    return [
        one
        for one in lived_in(DAYS, 1)
        if not (one[2] == sensor and begin <= one[0] < end)
    ]


@pytest.mark.parametrize("seed", rows([0], [2]))
def test_a_home_with_nothing_wrong_keeps_to_its_budget(seed: int) -> None:
    begun, _ = HealthMonitor(SENSORS).follow(in_steps(lived_in(DAYS, seed), DAYS))
    # Four weeks at one a week; of a Poisson number with that mean 2 % are above 8.
    assert len(begun) <= 8


def test_a_large_budget_tells_nothing_of_what_did_not_happen() -> None:
    steps = in_steps(lived_in(16, 1), 16)
    begun, _ = HealthMonitor(SENSORS, "20/day").follow(steps)
    assert {alarm.kind for alarm in begun} >= {"silent", "more"}
    for alarm in begun:
        assert not alarm.why.startswith("came on 0 times") or alarm.kind == "less"


def test_a_sensor_that_stops_is_named_with_its_companion() -> None:
    monitor, begun, _ = watched(without(FLUSH))
    (alarm,) = begun
    assert (alarm.sensor, alarm.kind) == ("flush", "silent")
    assert alarm.others == ("bath",)
    assert alarm.at - ONSET < 3 * 86400
    assert monitor.health[FLUSH] == 0
    line = alarm.line()
    assert line.startswith("flush: silent since ")
    assert "bath came on in" in line
    assert "Could also be: nobody uses it any more" in line


def test_a_sensor_that_is_stuck_is_named_within_a_day() -> None:
    stuck = [*lived_in(DAYS, 1), (ONSET, ONSET + 3 * 86400.0, FRIDGE)]
    monitor, begun, _ = watched(stuck)
    alarm = begun[0]
    assert (alarm.sensor, alarm.kind) == ("fridge", "stuck")
    assert alarm.at - ONSET < 86400
    assert monitor.health[FRIDGE] > 0.5  # it went off again


def test_a_sensor_that_comes_on_at_night_is_named() -> None:
    rng = np.random.default_rng(1)
    false = ONSET + rng.uniform(0, 7 * 86400, 50)
    noisy = [*lived_in(DAYS, 1), *((t, t + 5, BATH) for t in false)]
    _, begun, _ = watched(noisy)
    (alarm,) = (each for each in begun if (each.sensor, each.kind) == ("bath", "more"))
    assert len(begun) <= 3  # what it was seen with may be accused of silence first
    came_on, unexpected = re.findall(
        r"came on (\d+) times.*, (\d+) of them", alarm.why
    )[0]
    assert 2 <= int(unexpected) <= int(came_on)


def test_chatter_is_named_at_once() -> None:
    burst = [(ONSET + 10 * n, ONSET + 10 * n + 1, FRIDGE) for n in range(60)]
    _, begun, _ = watched([*lived_in(DAYS, 1), *burst])
    assert ("fridge", "chatter") in [(a.sensor, a.kind) for a in begun]
    (first, *_) = begun
    assert first.at - ONSET < 2400


def test_a_repaired_sensor_is_well_and_the_repair_is_no_alarm() -> None:
    repaired = without(FLUSH, ONSET, ONSET + 4 * 86400.0)
    monitor, begun, ended = watched(repaired)
    assert [alarm.sensor for alarm in begun] == ["flush"]
    assert ended[-1] == "flush"
    assert monitor.judge.kind[FLUSH] == WELL


def test_nothing_is_said_before_enough_is_known() -> None:
    monitor = HealthMonitor(SENSORS)
    begun, _ = monitor.follow(in_steps(lived_in(2, 0), 2))
    assert begun == []
    assert not monitor.known.any()
    assert (monitor.health == 1).all()
    line = monitor.progress.line()
    assert line.startswith("learning: ")
    assert line.endswith("0 of 8 sensors known")


def test_one_step_at_a_time_is_the_same() -> None:
    steps = in_steps(lived_in(6, 6), 6)
    whole, single = HealthMonitor(SENSORS), HealthMonitor(SENSORS)
    told = whole.follow(steps)
    begun, ended = list[Alarm](), list[str]()
    for at in range(len(steps)):
        alarms, well = single.follow(part(steps, at, at + 1))
        begun += alarms
        ended += well
    assert (begun, ended) == told
    for name, mine in vars(whole.judge).items():
        np.testing.assert_array_equal(getattr(single.judge, name), mine)


def test_unknown_readings_are_no_silence() -> None:
    valid = np.ones(((DAYS - ONSET_DAY) * DAY, len(SENSORS)), np.bool_)
    valid[:, FLUSH] = False
    _, begun, _ = watched(without(FLUSH), valid)
    assert "flush" not in [alarm.sensor for alarm in begun]


def test_a_week_away_is_no_fault_of_any_sensor() -> None:
    back = ONSET + 7 * 86400.0
    left = [one for one in lived_in(DAYS + 7, 1) if not ONSET <= one[0] < back]
    monitor = deepcopy(known_well())
    steps = in_steps(left, DAYS + 7)
    begun, _ = monitor.follow(part(steps, ONSET_DAY * DAY, len(steps)))
    assert begun == []
    assert monitor.learned is not None


def test_a_first_free_day_is_no_change_of_a_rate() -> None:
    """Ten days as they were learned, then the bath again and again and no fridge."""
    busy = [
        one
        for one in lived_in(12, 1)
        if one[2] != FRIDGE or one[0] < START + 10 * 86400
    ]
    rng = np.random.default_rng(4)
    busy += [(t, t + 5, BATH) for t in START + 86400 * rng.uniform(10, 12, 40)]
    begun, _ = HealthMonitor(SENSORS).follow(in_steps(sorted(busy), 12))
    assert not {alarm.kind for alarm in begun} & {"less", "more"}


@pytest.mark.parametrize(("zone", "told"), [("Europe/Berlin", []), ("UTC", ["more"])])
def test_a_clock_that_is_put_back_changes_no_habit(zone: str, told: list[str]) -> None:
    """The first sensor comes on three times before eleven in Berlin, every day."""
    berlin, rng = ZoneInfo("Europe/Berlin"), np.random.default_rng(5)
    # Winter time from the 17th day.
    first, days = datetime(2026, 10, 8, tzinfo=berlin), 20
    begin = first.timestamp()
    on = [
        ((first + timedelta(day, minutes=at)).timestamp() + rng.uniform(0, 500), 0)
        for day in range(days)
        for at in (620, 635, 650)
    ]
    on += [(begin + at, 1) for at in rng.uniform(0, days * 86400.0, days * 40)]
    spans = sorted((at, at + 30, sensor) for at, sensor in on)
    steps = steps_of(spans, 2, begin, begin + days * 86400.0)
    begun, _ = HealthMonitor(["coffee", "hall"], "1/week", zone).follow(steps)
    assert [alarm.kind for alarm in begun if alarm.sensor == "coffee"] == told


def test_what_cannot_be_is_refused() -> None:
    monitor = HealthMonitor(SENSORS)
    steps = in_steps(lived_in(1, 0), 1)
    with pytest.raises(InvalidValueError, match=r"^alarms: must be a number a hour"):
        HealthMonitor(SENSORS, "often")
    with pytest.raises(ShapeError, match=r"^steps: must have 2 sensors"):
        HealthMonitor(["a", "b"]).follow(steps)
    monitor.follow(steps)
    with pytest.raises(InvalidValueError, match=r"^steps: must begin with"):
        monitor.follow(steps)
