"""Monitors the sensors of a machine, and says which are broken and why."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.alarm import Alarm, AlarmProgress, SensorHealth, lasted, told
from neurosnap.health.level_evidence import Levels
from neurosnap.health.level_monitor import HEARD, TURNS, LevelAlarm, LevelMonitor

_APART = 0.1
"""Share of the time by which a level is more or less than expected, to be told so."""
_MOST = 2
"""Others that are named."""


Judged = tuple[list[Alarm], dict[str, float | None]]
"""The alarms that begin, and of the sensors whose alarm is over since when they were as
usual, seconds since 1970; None if what they read is taken for normal."""


class MachineMonitor:
    """Monitors the health of a machine's sensors, step by step.

    Args:
        names: Of the sensors.
        alarms: The budget, such as ``1/week``.
        zone: The time zone that times are told by.
        step: Seconds.
        alike: Pairs of sensors, by number, that are about the same signal. They are
            judged together, and by none of each other.

    Raises:
        InvalidValueError: The budget has another form.
    """

    def __init__(
        self,
        names: Sequence[str],
        alarms: str,
        zone: str,
        step: float,
        alike: Sequence[tuple[int, int]] = (),
    ) -> None:
        signal = _signals(len(names), alike)
        self._order = np.argsort(signal, kind="stable")
        self._names = [names[sensor] for sensor in self._order]
        self._of = signal[self._order]
        self._zone = zone
        self._step = step
        self._levels = LevelMonitor(self._of.tolist(), alarms, step)

    def follow(self, levels: Levels, number: int) -> Judged:
        """Judge the steps that come next.

        Args:
            levels: Of the sensors, in the order of their names.
            number: Of the first, in steps since 1970.
        """
        own = Levels(
            np.ascontiguousarray(levels.on[:, self._order]),
            np.ascontiguousarray(levels.known[:, self._order]),
        )
        begun: list[Alarm] = []
        well: dict[str, float | None] = {}
        for _, alarm, begins, usual in self._levels.follow(own, number):
            if begins:
                begun.append(self._alarm(alarm))
            else:
                well[self._names[alarm.sensor]] = usual and usual * self._step
        return begun, well

    @property
    def sensors(self) -> list[SensorHealth]:
        """How each sensor is."""
        known, health = self._levels.known[self._of], self._levels.health[self._of]
        made: list[SensorHealth | None] = [None] * len(self._names)
        for place, sensor in enumerate(self._order.tolist()):
            well = round(float(health[place]), 3)
            made[sensor] = SensorHealth(self._names[place], bool(known[place]), well)
        return [each for each in made if each is not None]

    @property
    def progress(self) -> AlarmProgress:
        """How much is learned."""
        turns = self._levels.turns
        return AlarmProgress(
            int(turns.sum()),
            int(np.maximum(turns, TURNS).sum()),
            int(self._levels.known[self._of].sum()),
            len(self._names),
        )

    def _alarm(self, alarm: LevelAlarm) -> Alarm:
        """Return an alarm in words."""
        since, end = (float(step * self._step) for step in (alarm.since, alarm.at + 1))
        names = [self._names[sensor] for sensor in alarm.others[:_MOST]]
        others = " and ".join(names) or "the others"
        kind = "silent"
        when = f"since {told(since, self._zone)} ({lasted(end - since)})"
        if alarm.known < HEARD:
            why = f"not heard {when}"
            otherwise = "its source is off, or the way to it is cut"
        else:
            guess = max(0.0, min(1.0, alarm.guessed))
            more = alarm.read - guess
            kind = "more" if more > _APART else "less" if more < -_APART else "differs"
            read = f"on {alarm.read:.0%} of the time {when}"
            why = f"{read}, where {others} would have it on {guess:.0%}"
            if kind == "differs":
                why = f"{read}, but not when {others} would have it"
            otherwise = f"{others} may be wrong, or the machine does what it never did"
        return Alarm(
            zone=self._zone,
            sensor=self._names[alarm.sensor],
            kind=kind,
            since=since,
            at=end,
            weekly=alarm.weekly,
            why=why,
            otherwise=otherwise,
            others=tuple(names),
        )


def _signals(count: int, alike: Sequence[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the number of each sensor's signal."""
    heads = list(range(count))
    for a, b in alike:
        low, high = sorted((heads[a], heads[b]))
        heads = [low if head == high else head for head in heads]
    return np.unique(np.array(heads, np.int64), return_inverse=True)[1]
