"""A machine whose sensors break is found out, and one that is well is left alone."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.health.level_evidence import Levels
from neurosnap.health.level_monitor import FIRST, LevelMonitor
from neurosnap.health.machine_monitor import Judged, MachineMonitor
from tests.support.machine import BELT, FLOW, HOT, SENSORS, VALVE, levels, machine

DAYS = 2
LEARNED = DAYS * 8640
"""Steps of ten seconds."""
HOUR = 360


def watched(on: np.ndarray, alarms: str = "1/week") -> Judged:
    return MachineMonitor(SENSORS, alarms, "UTC", 10.0).follow(levels(on), 0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_machine_that_is_well_keeps_to_the_budget(seed: int) -> None:
    begun, _ = watched(machine(14 * 8640, seed))
    # Two weeks at one a week; of a Poisson number with that mean 5 % are above 4.
    assert len(begun) <= 4


def broken(sensor: int, hours: float = 6) -> np.ndarray:
    """Return a machine with a sensor that is another one's from some time on."""
    on, other = machine(LEARNED + 3 * 8640, 1), machine(LEARNED + 3 * 8640, 2)
    part = slice(LEARNED, LEARNED + round(hours * HOUR))
    on[part, sensor] = other[part, sensor]
    return on


@pytest.mark.parametrize("sensor", [BELT, FLOW])
def test_one_sensor_that_breaks_is_one_alarm_that_ends(sensor: int) -> None:
    begun, ended = watched(broken(sensor))
    (alarm,) = begun
    assert alarm.sensor == SENSORS[sensor]
    assert 0 < alarm.at / 10 - LEARNED < HOUR
    assert alarm.since / 10 >= LEARNED - 1
    assert [*ended] == [SENSORS[sensor]]
    assert abs((ended[alarm.sensor] or 0.0) / 10 - LEARNED - 6 * HOUR) < 30


def test_an_alarm_that_comes_back_soon_lasts_the_longer() -> None:
    on, other = machine(LEARNED + 7200, 1), machine(LEARNED + 7200, 2)
    for start in range(LEARNED, len(on), 720):  # broken for an hour, well for another
        on[start : start + 360, BELT] = other[start : start + 360, BELT]
    assert [alarm.sensor for alarm in watched(on)[0]] == ["belt"] * 3


def test_what_breaks_beside_it_is_found_too() -> None:
    on = broken(BELT, 24)
    on[LEARNED + 2000 : LEARNED + 4000, FLOW] = 0.0
    begun, _ = watched(on)
    assert [alarm.sensor for alarm in begun] == ["belt", "flow"]
    assert re.match(r"on 0% of the time since .*, where valve would", begun[1].why)
    assert begun[1].others == ("valve",)


def test_what_lasts_for_two_weeks_is_how_the_machine_is() -> None:
    on, other = machine(40 * 8640, 1), machine(40 * 8640, 2)
    on[LEARNED:, BELT] = other[LEARNED:, BELT]
    begun, ended = LevelMonitor(range(6), "1/week", 10.0).follow(levels(on), 0)
    assert SENSORS[begun.alarm.sensor] == "belt"
    assert ended == (begun.step + 14 * 8640, begun.alarm, False, None)


@pytest.mark.parametrize(("alarms", "told"), [("1/week", []), ("1/day", ["belt"])])
def test_no_alarm_is_raised_before_as_much_was_learned_as_the_budget_asks_for(
    alarms: str, told: list[str]
) -> None:
    on, other = machine(14 * HOUR, 1), machine(14 * HOUR, 2)
    on[10 * HOUR :, BELT] = other[10 * HOUR :, BELT]
    begun, _ = watched(on, alarms)
    assert [alarm.sensor for alarm in begun] == told


def test_a_sensor_that_is_not_heard_is_told_even_if_it_never_changed() -> None:
    on = machine(LEARNED + HOUR, 1)
    known = np.ones_like(on)
    known[LEARNED:, HOT] = 0
    on[:, VALVE] = 0.0
    known[LEARNED + HOUR // 2 :, VALVE] = 0
    monitor = MachineMonitor(SENSORS, "1/week", "UTC", 10.0)
    (alarm, other), _ = monitor.follow(Levels(on, known), 0)
    assert (alarm.sensor, alarm.kind) == ("hot", "silent")
    assert alarm.why.startswith("not heard since Sat 03 Jan 1970 00:00")
    assert (other.sensor, other.kind) == ("valve", "silent")
    assert other.at > (LEARNED + HOUR // 2) * 10
    health = {each.sensor: each for each in monitor.sensors}
    assert health["hot"].health == 0
    assert not health["valve"].known
    assert monitor.progress.known == len(SENSORS) - 1


def test_what_never_changed_before_is_not_told_once_it_does() -> None:
    on = machine(LEARNED + HOUR, 1)
    on[:, HOT] = 0.0
    on[LEARNED:, HOT] = 1.0
    assert not watched(on)[0]


def test_steps_without_any_reading_are_left_out() -> None:
    on = machine(LEARNED, 1)
    known = np.ones_like(on)
    known[1000:9000] = 0
    monitor = MachineMonitor(SENSORS, "1/week", "UTC", 10.0)
    assert not monitor.follow(Levels(on, known), 0)[0]


def test_a_signal_is_not_judged_by_sensors_of_its_own() -> None:
    on = broken(FLOW)
    twice = np.column_stack([on, on[:, FLOW]])
    names = (*SENSORS, "flow>2")
    apart = MachineMonitor(names, "1/week", "UTC", 10.0)
    assert "flow" not in {each.sensor for each in apart.follow(levels(twice), 0)[0]}
    as_one = MachineMonitor(names, "1/week", "UTC", 10.0, [(FLOW, len(SENSORS))])
    begun, _ = as_one.follow(levels(twice), 0)
    assert {(each.sensor, *each.others) for each in begun} <= {
        ("flow", "valve"),
        ("valve", "flow>2", "flow"),
        ("valve", "flow", "flow>2"),
    }


@pytest.mark.slow
@settings(max_examples=10)
@given(st.lists(st.integers(1, 4000), min_size=1, max_size=30))
def test_it_says_the_same_in_whatever_pieces_it_is_given(pieces: list[int]) -> None:
    on = broken(BELT)
    on[LEARNED + 5000 :, FLOW] = 1.0
    whole = LevelMonitor(range(6), "1/week", 10.0).follow(levels(on), 0)
    parts, at, changes = LevelMonitor(range(6), "1/week", 10.0), 0, []
    for count in (*pieces, len(on)):
        changes += parts.follow(levels(on[at : at + count]), at)
        at += count
    assert changes == whole
    assert whole


def test_nothing_is_said_before_enough_was_seen() -> None:
    on = np.random.default_rng(0).random((FIRST, 6)).round()
    assert not LevelMonitor(range(6), "100/hour").follow(levels(on), 0)


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(ShapeError, match="must have 6 sensors, got 5"):
        LevelMonitor(range(6)).follow(levels(np.zeros((1, 5))), 0)
    with pytest.raises(InvalidValueError):
        LevelMonitor(range(6), "one")
