"""An alarm: a sensor that seems broken, described in one line.

And the news of a home: which alarms begin and end from one look at its sensors to the
next.
"""

from collections.abc import Iterator

import msgspec

from neurosnap.system.local_time import local

_UNITS = (1, "weeks"), (7, "days"), (168, "hours")


class Alarm(msgspec.Struct, frozen=True):
    """A sensor that seems broken, and the evidence against it."""

    zone: str
    """The time zone that its times are told by."""
    sensor: str
    kind: str
    """In a word, what is wrong with it."""
    since: float
    """When the evidence began, seconds since 1970."""
    at: float
    """When it was raised, seconds since 1970."""
    weekly: float
    """How often a week the evidence would go so far with nothing wrong."""
    why: str
    """What was read, and what was to be expected."""
    otherwise: str
    """What else it could be."""
    others: tuple[str, ...] = ()
    """The sensors that say so most."""
    number: float | None = None
    """What the sensor's signal measured when it was raised; None if it is no number."""

    def line(self) -> str:
        """Return the alarm in a line."""
        number = "" if self.number is None else f" ({self.number:g})"
        rest = f"{self._rare()}. Could also be: {self.otherwise}."
        return f"{self.sensor}{number}: {self.why}; {rest}"

    def _rare(self) -> str:
        if self.weekly <= 0:
            return "this sensor never does so by chance"
        weeks = 1 / self.weekly
        if weeks > 520:
            return "this sensor does so by chance not once in ten years"
        often, unit = next(
            (weeks * of, unit) for of, unit in _UNITS if weeks * of >= 2 or of > 100
        )
        return f"this sensor does so by chance once in {often:.0f} {unit}"


def told(at: float, zone: str) -> str:
    """Return a moment, seconds since 1970, by the clock of a zone."""
    clock = "%H:%M:%S" if at % 60 else "%H:%M"
    return f"{local(at, zone):%a %d %b %Y {clock} %Z}"


def lasted(seconds: float) -> str:
    """Return a time in words, to the minute from a minute on."""
    if seconds < 60:
        return f"{seconds:.0f} s"
    minutes = int(seconds) // 60
    days, rest = divmod(minutes, 1440)
    hours, minutes = divmod(rest, 60)
    if days:
        return f"{days} d {hours} h"
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


class AlarmProgress(msgspec.Struct, frozen=True):
    """How much of a home's normal behaviour has been learned."""

    activations: int
    """How often sensors came on."""
    of_about: int
    """How often they have to have, for all of them to be known."""
    known: int
    """Sensors that are known."""
    sensors: int

    def line(self) -> str:
        """Return the progress in a line."""
        return (
            f"learning: {self.activations} of about {self.of_about} changes;"
            f" {self.known} of {self.sensors} sensors known"
        )


class SensorHealth(msgspec.Struct, frozen=True):
    """The health of one sensor."""

    sensor: str
    known: bool
    """Enough was learned of it for it to be judged."""
    health: float
    """From 1, well, to 0, in alarm."""


class Standing(msgspec.Struct, frozen=True):
    """The health of all sensors of a home."""

    at: float
    """Seconds since 1970, when the last step that was judged was over."""
    progress: AlarmProgress
    """How much is known of them."""
    alarms: tuple[Alarm, ...] = ()
    """Those in force, the oldest first."""
    zone: str = "UTC"
    """The home's time zone."""


class News(msgspec.Struct, frozen=True):
    """An alarm that was raised, or is over."""

    at: float
    """When it was, seconds since 1970."""
    sensor: str
    alarm: Alarm | None
    """None if it is over: the sensor agrees with the others again, or what it reads has
    been taken for normal."""
    zone: str
    """The home's time zone."""
    usual: float | None = None
    """Of one that is over, since when the sensor was as usual, if that is told."""

    def line(self) -> str:
        """Return the text of the alarm in one line."""
        said = f"{self.sensor}: alarm over" if self.alarm is None else self.alarm.line()
        if self.usual is not None:
            said += f", as usual since {told(self.usual, self.zone)}"
        return f"{told(self.at, self.zone)}  {said}"


def news(before: Standing | None, now: Standing) -> Iterator[News]:
    """Yield what is over, and then what was raised.

    An alarm that begins and ends between two looks is missed. `before` is None if
    nothing was known of the sensors.
    """
    alarms = () if before is None else before.alarms
    was = {(alarm.sensor, alarm.at) for alarm in alarms}
    bad = {alarm.sensor for alarm in now.alarms}
    for alarm in alarms:
        if alarm.sensor not in bad:
            yield News(now.at, alarm.sensor, None, now.zone)
    for alarm in now.alarms:
        if (alarm.sensor, alarm.at) not in was:
            yield News(alarm.at, alarm.sensor, alarm, now.zone)


class Newsreader:
    """Reports each new or ended alarm of a home once, in one line.

    What the first one has is no news: it is known from before a run was resumed.
    """

    def __init__(self) -> None:
        self.last: Standing | None = None

    def lines(self, now: Standing) -> Iterator[str]:
        """Yield what is new; where other sensors are known, how much is learned."""
        before, self.last = self.last, now
        if before is None or before.progress.known != now.progress.known:
            yield now.progress.line()
        if before is not None:
            yield from (each.line() for each in news(before, now))
