"""What is new about the sensors of a home, from one look at them to the next."""

from collections.abc import Iterator

import msgspec

from neurosnap.health.alarm import Alarm, AlarmProgress, told


class Standing(msgspec.Struct, frozen=True):
    """How the sensors of a home are."""

    step: int
    """The step that is under way."""
    progress: AlarmProgress
    """How much is known of them."""
    alarms: tuple[Alarm, ...] = ()
    """Those in force, the oldest first."""


class News(msgspec.Struct, frozen=True):
    """An alarm that was raised, or is over."""

    step: int
    """The step under way when it was."""
    sensor: str
    alarm: Alarm | None
    """None if the sensor is well again."""

    def line(self) -> str:
        """Return it for people."""
        said = f"{self.sensor}: well again" if self.alarm is None else self.alarm.line()
        return f"{told(self.step)}  {said}"


def news(before: Standing | None, now: Standing) -> Iterator[News]:
    """Yield what is over, and then what was raised.

    An alarm that begins and ends between two looks is missed.

    Args:
        before: How they were; None if nothing was known of them.
        now: How they are.
    """
    alarms = () if before is None else before.alarms
    was = {(alarm.sensor, alarm.step) for alarm in alarms}
    bad = {alarm.sensor for alarm in now.alarms}
    for alarm in alarms:
        if alarm.sensor not in bad:
            yield News(now.step, alarm.sensor, None)
    for alarm in now.alarms:
        if (alarm.sensor, alarm.step) not in was:
            yield News(alarm.step + 1, alarm.sensor, alarm)


class Newsreader:
    """Tells a home's news in lines, each once, from one standing after the other.

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
