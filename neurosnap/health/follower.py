"""Groups observations into steps of ten minutes, and has a monitor judge each.

What it says follows from the observations and their times alone: one that was live, and
one that reads the recording afterwards, say the same.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.alarm import Alarm, News, Standing
from neurosnap.health.monitor import HealthMonitor
from neurosnap.health.steps import STEP, Steps

Flags = NDArray[np.bool_]


class Follower:
    """Follows the sensors of a home, observation by observation.

    Args:
        names: Of the sensors.
        alarms: The budget, such as ``1/week``.

    Attributes:
        monitor: Who judges.

    Raises:
        InvalidValueError: The budget has another form.
    """

    def __init__(self, names: Sequence[str], alarms: str = "1/week") -> None:
        self.monitor = HealthMonitor(names, alarms)
        count = len(names)
        self._at: float | None = None  # the last observation, or look at the clock
        self._on_since = np.full(count, np.nan)
        self._known = np.zeros(count, np.bool_)
        self._number = 0  # of the step under way
        self._came_on = np.zeros(count, np.int32)
        self._longest = np.zeros(count, np.float32)
        self._valid = np.zeros(count, np.bool_)  # known at some time in the step
        self._alarms: dict[str, Alarm] = {}  # in force, as they were raised

    @property
    def standing(self) -> Standing:
        """How the sensors are after the last step that is over."""
        alarms = tuple(self._alarms.values())
        return Standing(self._number, self.monitor.progress, alarms)

    def observe(
        self, on: Flags, known: Flags, at: float, *, begins: bool = False
    ) -> list[News]:
        """Observe a tick.

        Args:
            on: ``(N,)``, which sensors are on.
            known: ``(N,)``, which readings are known. One that is unknown is not on.
            at: When it was, seconds since 1970. One before the last counts as of its
                time.
            begins: Nothing was read before it: what was on meanwhile is unknown.

        Returns:
            What is said of the steps that were over by then, in order; in each, what
            ends comes before what begins. A step costs a millisecond or so, and now and
            then the time to learn anew.
        """
        if self._at is None:
            self._at, self._number = at, int(at // STEP)
        elif begins:
            none = np.zeros(len(on), np.bool_)
            self._read(none, none, self._at)
        said = self.until(at)
        self._read(on, known, max(at, self._at))
        return said

    def until(self, now: float) -> list[News]:
        """Let time pass without an observation.

        Args:
            now: Seconds since 1970. Before the first observation it does nothing.
        """
        said: list[News] = []
        if self._at is None:
            return said
        while (end := (self._number + 1) * float(STEP)) <= now:
            alarms, well = self.monitor.follow(*self._step(end))
            said += [News(self._number, name, None) for name in well]
            said += [News(self._number, alarm.sensor, alarm) for alarm in alarms]
            for name in (*well, *(alarm.sensor for alarm in alarms)):
                self._alarms.pop(name, None)
            self._alarms |= {alarm.sensor: alarm for alarm in alarms}
            self._at = max(self._at, end)
        self._at = max(self._at, now)
        return said

    def _read(self, on: Flags, known: Flags, at: float) -> None:
        """Let the sensors read so from a time on."""
        on = on & known
        was_on = ~np.isnan(self._on_since)
        self._came_on += on & ~was_on
        off = was_on & ~on
        lasted = np.where(off, at - self._on_since, 0.0).astype(np.float32)
        np.maximum(self._longest, lasted, out=self._longest)
        self._on_since[on & ~was_on] = at
        self._on_since[off] = np.nan
        self._known = known.copy()
        self._valid |= known

    def _step(self, end: float) -> tuple[Steps, Flags]:
        """Return the step under way, which ends, and begin the next."""
        on = ~np.isnan(self._on_since)
        lasted = np.where(on, end - self._on_since, 0.0).astype(np.float32)
        longest = np.maximum(self._longest, lasted)
        made = Steps(self._came_on[None], longest[None], self._number)
        valid = self._valid[None]
        self._number += 1
        self._came_on = np.zeros_like(self._came_on)
        self._longest = np.zeros_like(self._longest)
        self._valid = self._known.copy()
        return made, valid
