"""An alarm: a sensor that seems broken, described in one line.

And the news of a home: which alarms begin and end from one look at its sensors to the
next.
"""

import math
from collections.abc import Iterator

import msgspec

from neurosnap.health.ten_minute_steps import STEP
from neurosnap.system.local_time import local


class Companion(msgspec.Struct, frozen=True):
    """A sensor that another one used to come on with, but no longer does."""

    name: str
    together: int
    """Hours in which both came on, before."""
    hours: int
    """Hours in which it came on, before."""
    since: int
    """Hours in which it came on since, and the other did not."""


class Alarm(msgspec.Struct, frozen=True):
    """A sensor that seems broken, and the evidence against it."""

    zone: str
    """The home's time zone."""
    sensor: str
    kind: str
    """One of `KINDS`."""
    since: int
    """The step in which the evidence began."""
    step: int
    """The step after which it was raised."""
    evidence: float
    """Of that kind, see `neurosnap.health.evidence`."""
    before: float
    """How far it went at most while the home was learned."""
    weekly: float
    """How often a week it would go so far in this home with nothing wrong."""
    came_on: int
    """How often the sensor came on since."""
    expected: float
    """In how many steps it was expected to come on since."""
    unexpected: int
    """In how many steps it came on since although hardly anything spoke for it."""
    companion: Companion | None
    """The sensor that says so most; None if no one stands out."""

    def line(self) -> str:
        """Return the alarm in a line."""
        return f"{self.sensor}: {self._what()}{self._who()}; {self._rare()}. Could also be: {_ELSE[self.kind]}."

    def _what(self) -> str:
        began = told(self.since, self.zone)
        if self.kind == "silent":
            return (
                f"silent since {began} ({lasted((self.step + 1 - self.since) * STEP)}), where"
                f" {self.expected:.1f} activations were to be expected"
            )
        if self.kind in ("less", "more"):
            alone = f", {self.unexpected} of them with nothing that it goes with"
            times = "once" if self.came_on == 1 else f"{self.came_on} times"
            return (
                f"came on {times} since {began}, where"
                f" {self.expected:.1f} were to be expected"
                f"{alone if self.kind == 'more' and self.unexpected else ''}"
            )
        if self.kind == "stuck":
            return (
                f"on for {_seconds(self.evidence)} since {began}, longest before:"
                f" {_seconds(self.before)}"
            )
        return (
            f"came on {self.came_on} times within ten minutes, most before:"
            f" {math.exp(self.before):.0f}"
        )

    def _who(self) -> str:
        with_it = self.companion
        if with_it is None:
            return ""
        return (
            f" ({with_it.name} came on in {with_it.since} hours without it; before, in"
            f" {with_it.together} of {with_it.hours} with it)"
        )

    def _rare(self) -> str:
        if self.weekly <= 0:
            return "this sensor never does so by chance"
        weeks = 1 / self.weekly
        if weeks > 520:
            return "this sensor does so by chance not once in ten years"
        return f"this sensor does so by chance once in {weeks:.0f} weeks"


_ELSE = {
    "silent": "nobody uses it any more, or the day differs from all days learned",
    "less": "the room is used less than it was",
    "more": "guests, a pet, or a new habit",
    "stuck": "left open or left on",
    "chatter": "somebody plays with it, or a loose contact",
}


def told(step: int, zone: str) -> str:
    """Return when a step begins, by the clock of a zone."""
    return f"{local(step * STEP, zone):%a %d %b %Y %H:%M %Z}"


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


def _seconds(evidence: float) -> str:
    """Return the time on that evidence of kind ``stuck`` stands for."""
    seconds = math.expm1(evidence)
    return f"{seconds:.0f} s" if seconds < STEP else lasted(seconds // STEP * STEP)


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

    step: int
    """The step that is under way."""
    progress: AlarmProgress
    """How much is known of them."""
    alarms: tuple[Alarm, ...] = ()
    """Those in force, the oldest first."""
    zone: str = "UTC"
    """The home's time zone."""


class News(msgspec.Struct, frozen=True):
    """An alarm that was raised, or is over."""

    step: int
    """The step under way when it was."""
    sensor: str
    alarm: Alarm | None
    """None if the sensor is well again."""
    zone: str
    """The home's time zone."""

    def line(self) -> str:
        """Return the text of the alarm in one line."""
        said = f"{self.sensor}: well again" if self.alarm is None else self.alarm.line()
        return f"{told(self.step, self.zone)}  {said}"


def news(before: Standing | None, now: Standing) -> Iterator[News]:
    """Yield what is over, and then what was raised.

    An alarm that begins and ends between two looks is missed. `before` is None if
    nothing was known of the sensors.
    """
    alarms = () if before is None else before.alarms
    was = {(alarm.sensor, alarm.step) for alarm in alarms}
    bad = {alarm.sensor for alarm in now.alarms}
    for alarm in alarms:
        if alarm.sensor not in bad:
            yield News(now.step, alarm.sensor, None, now.zone)
    for alarm in now.alarms:
        if (alarm.sensor, alarm.step) not in was:
            yield News(alarm.step + 1, alarm.sensor, alarm, now.zone)


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
