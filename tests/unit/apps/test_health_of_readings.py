"""The alarms that a monitor raised in a home, each with its end."""

import struct

import numpy as np
import pytest

from neurosnap.apps import health_of_readings
from neurosnap.health.alarm import Alarm, News, told
from neurosnap.health.follower import Follower
from neurosnap.poc.learning.columns import Columns
from neurosnap.recording.read.recorded_readings import OwnReadings
from neurosnap.sources.conditions import parse_condition
from neurosnap.sources.readings import Readings
from neurosnap.sources.wanted import Wanted


def alarm(kind: str, step: int) -> News:
    """Return that an alarm was raised after a step."""
    at = 600.0 * (step + 1)
    found = Alarm("UTC", "door", kind, at - 1800, at, 0.01, "why", "else")
    return News(at, "door", found, "UTC")


class Scripted(Follower):
    """A follower that says what it is told to, whatever it observes."""

    def __init__(self, said: list[list[News]]) -> None:
        super().__init__(["door"])
        self._script = iter(said)

    def observe(self, *_: object, **__: object) -> list[News]:
        return next(self._script)


def log_of(said: list[list[News]]) -> health_of_readings.HealthLog:
    off = np.zeros(1, np.bool_)
    observations = [OwnReadings(float(at), off, ~off) for at in range(len(said))]
    return health_of_readings.follow(observations, Scripted(said), "1/week")


def test_an_alarm_that_becomes_another_is_over() -> None:
    less, silent = alarm("less", 10), alarm("silent", 20)
    found = log_of([[less], [silent]])
    ends = [(each.ended, each.became) for each in found.alarms]
    assert ends == [(told(12600.0, "UTC"), "silent"), (None, None)]
    lines = list(found.lines())
    assert lines[0].endswith(f" Became 'silent' {told(12600.0, 'UTC')}.")
    assert lines[-1] == "2 alarms, 1 in force (budget 1/week)"


SILENT, STUCK = alarm("silent", 10), alarm("stuck", 40)
OVER = News(18600.0, "door", None, "UTC", 17400.0)


@pytest.mark.parametrize(
    "said",
    [
        [[SILENT], [OVER], [STUCK]],
        [[SILENT, OVER, STUCK]],
        [[SILENT], [OVER, alarm("stuck", 30)]],
    ],
    ids=["step by step", "several steps at once", "an end and an alarm in one step"],
)
def test_an_alarm_ends_before_a_later_one_begins(said: list[list[News]]) -> None:
    found = log_of(said)
    ends = [(each.ended, each.became) for each in found.alarms]
    assert ends == [(told(18600.0, "UTC"), None), (None, None)]
    since = f", as usual since {told(17400.0, 'UTC')}"
    assert next(found.lines()).endswith(f"{ends[0][0]}{since}.")
    assert OVER.line().endswith(f"door: alarm over{since}")


def test_an_alarm_tells_what_was_measured() -> None:
    rng = np.random.default_rng(0)
    flow = np.cumsum(rng.random(2000) < 0.1) % 2 * 5.0
    shown = flow.copy()
    shown[1900:] = 2.5  # the second sensor drifts
    names = ("flow > 1", "shown > 3")
    on = np.column_stack([flow > 1, shown > 3])
    readings = Readings(
        Columns.of(on, [name.replace(" ", "") for name in names]),
        [str(60.0 * minute) for minute in range(len(on))],
        said=[struct.pack("<2f", *row) for row in zip(flow, shown, strict=True)],
        wanted=Wanted(conditions=tuple(map(parse_condition, names))),
    )
    found = health_of_readings.health_of(readings, "1/day")
    raised = {each.alarm.sensor: each for each in found.alarms}
    assert raised["shown>3"].alarm.number == 2.5
    assert raised["shown>3"].line.startswith("shown>3 (2.5): on ")
