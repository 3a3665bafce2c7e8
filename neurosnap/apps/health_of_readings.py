"""Finds broken sensors of a home in its recorded readings."""

from collections.abc import Iterable, Iterator

import msgspec

from neurosnap.health.alarm import Alarm, AlarmProgress, News, SensorHealth, told
from neurosnap.health.alarm_budget import parse_budget
from neurosnap.health.follower import Follower, usual_step
from neurosnap.protocol.run_options import follower_of
from neurosnap.recording.read.recorded_readings import OwnReadings, observations
from neurosnap.recording.read.recording import Recording
from neurosnap.sources.readings import Readings, seconds_of
from neurosnap.system.local_time import check_zone


class Raised(msgspec.Struct, frozen=True):
    """An alarm, and its end."""

    alarm: Alarm
    line: str
    """The alarm in words."""
    ended: str | None
    """When the sensor was well again, or its next alarm began; None if in force."""
    became: str | None
    """The kind of that next alarm; None if there is none."""
    usual: str | None = None
    """Since when the sensor was as usual when it was well again; None of a home."""


class HealthLog(msgspec.Struct, frozen=True):
    """The alarms of a home and the health of its sensors, as its monitor gave them."""

    alarms: list[Raised]
    sensors: list[SensorHealth]
    """How each sensor is at the end."""
    progress: AlarmProgress
    budget: str

    def lines(self) -> Iterator[str]:
        """Yield it for people, a line each."""
        for raised in self.alarms:
            yield f"{told(raised.alarm.at, raised.alarm.zone)}  {raised.line}{_end_of(raised)}"
        yield self.progress.line()
        count, bad = len(self.alarms), sum(each.ended is None for each in self.alarms)
        alarms = "1 alarm" if count == 1 else f"{count} alarms"
        yield f"{alarms}, {bad} in force (budget {self.budget})"


def health_of(
    found: Recording | Readings,
    budget: str,
    zone: str | None = None,
    step: float | None = None,
) -> HealthLog:
    """Return the alarms and health of a home, by a recording or a table of readings.

    Args:
        found: What the home's own sensors read, and when.
        budget: Of alarms, such as ``1/week``.
        zone: The home's time zone; if None, the one that `found` has.
        step: As `RunOptions.health_step`; if None, that of the run, or by the times.

    Raises:
        InvalidValueError: The budget or the zone is none; or a table has no times, or
            not in order.
        RecordingError: The recording is damaged, or not a run's.
    """
    if zone is not None:
        check_zone(zone)
    parse_budget(budget)
    if isinstance(found, Recording):
        options = found.options
        names, theirs = options.body.own, options.zone
        usual, conditions = options.health_step, options.conditions
        readings = (each for _, each in observations(found))
    else:
        names, theirs = found.columns.sensorium.names, found.zone
        times = seconds_of(found)
        usual = usual_step(times)
        conditions, said = found.wanted.every_condition(), found.said
        readings = (
            OwnReadings(at, *found.columns.row(tick), said=said[tick] if said else b"")
            for tick, at in enumerate(times.tolist())
        )
    step = usual if step is None else step
    follower = follower_of(names, conditions, budget, zone or theirs, step)
    return follow(readings, follower, budget)


def follow(
    readings: Iterable[OwnReadings], follower: Follower, budget: str
) -> HealthLog:
    """Return the alarms and health of a home, from the first observation to the last.

    Args:
        readings: In order.
        follower: Has followed nothing yet.
        budget: Of alarms, that it keeps.

    Raises:
        InvalidValueError: What the readings raise.
    """
    raised: list[Raised] = []
    for at, on, known, begins, said in readings:
        for news in follower.observe(on, known, at, begins=begins, said=said):
            _end(raised, news)
            if (alarm := news.alarm) is not None:
                raised.append(Raised(alarm, alarm.line(), None, None))
    monitor = follower.monitor
    return HealthLog(raised, monitor.sensors, monitor.progress, budget)


def _end(raised: list[Raised], news: News) -> None:
    """Note that the alarm of a sensor, if there is one, ended."""
    became = None if news.alarm is None else news.alarm.kind
    for place, each in enumerate(raised):
        if each.ended is None and each.alarm.sensor == news.sensor:
            usual = None if news.usual is None else told(news.usual, news.zone)
            ended = told(news.at, news.zone)
            raised[place] = Raised(each.alarm, each.line, ended, became, usual)


def _end_of(raised: Raised) -> str:
    if raised.ended is None:
        return ""
    how = "Well again" if raised.became is None else f"Became {raised.became!r}"
    since = "" if raised.usual is None else f", as usual since {raised.usual}"
    return f" {how} {raised.ended}{since}."
