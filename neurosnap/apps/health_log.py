"""The health of a home's sensors over readings that are there as a whole."""

from collections.abc import Iterator

import msgspec

from neurosnap.health.alarm import Alarm, Progress, told
from neurosnap.health.monitor import HealthMonitor
from neurosnap.health.steps import Steps, steps_of
from neurosnap.sources.tables.readings import Readings
from neurosnap.sources.tables.spans import spans_of


class Raised(msgspec.Struct, frozen=True):
    """An alarm, and its end."""

    alarm: Alarm
    line: str
    """The alarm in words."""
    ended: str | None
    """When the sensor was well again; None: it is not."""


class SensorHealth(msgspec.Struct, frozen=True):
    """A sensor at the end."""

    sensor: str
    known: bool
    health: float
    """From 1, well, to 0, in alarm."""


class HealthLog(msgspec.Struct, frozen=True):
    """All that a monitor said of a home."""

    alarms: list[Raised]
    sensors: list[SensorHealth]
    progress: Progress
    budget: str

    def lines(self) -> Iterator[str]:
        """Yield it for people, a line each."""
        for raised in self.alarms:
            end = "" if raised.ended is None else f" Well again {raised.ended}."
            yield f"{told(raised.alarm.step + 1)}  {raised.line}{end}"
        yield self.progress.line()
        bad = sum(raised.ended is None for raised in self.alarms)
        count = len(self.alarms)
        alarms = "1 alarm" if count == 1 else f"{count} alarms"
        yield f"{alarms}, {bad} in force (budget {self.budget})"


def follow(readings: Readings, budget: str) -> HealthLog:
    """Return what a monitor says of readings, from the first to the last.

    Args:
        readings: With times.
        budget: Of alarms, such as ``1/week``.

    Raises:
        InvalidValueError: There are no times, or the budget is none.
    """
    names = list(readings.columns.sensorium.names)
    spans = spans_of(readings)
    monitor = HealthMonitor(names, budget)
    used = [own for own in spans if len(own)]
    steps = steps_of(
        (
            (float(on), float(off), sensor)
            for sensor, own in enumerate(spans)
            for on, off in own
        ),
        len(names),
        min((float(own[0, 0]) for own in used), default=0.0),
        max((float(own[:, 1].max()) for own in used), default=0.0),
    )
    raised: list[Raised] = []
    for at in range(len(steps)):
        one = slice(at, at + 1)
        begun, ended = monitor.take(
            Steps(steps.came_on[one], steps.longest[one], steps.first + at)
        )
        now = told(steps.first + at + 1)
        for place, each in enumerate(raised):
            if each.ended is None and each.alarm.sensor in ended:
                raised[place] = msgspec.structs.replace(each, ended=now)
        raised += [Raised(alarm, alarm.line(), None) for alarm in begun]
    known, health = monitor.known, monitor.health
    return HealthLog(
        raised,
        [
            SensorHealth(name, bool(known[at]), round(float(health[at]), 3))
            for at, name in enumerate(names)
        ],
        monitor.progress,
        budget,
    )
