"""Follows the sensors of a home or a machine, observation by observation.

The readings between two observations are those of the first. They are grouped into
steps, and each step that is over is judged: of a home how often each sensor came on in
ten minutes (`neurosnap.health.monitor`), of a machine for which share of a shorter step
it was on (`neurosnap.health.level_monitor`).
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap.health.alarm import (
    Alarm,
    News,
    Standing,
)
from neurosnap.health.level_evidence import Levels
from neurosnap.health.machine_monitor import Judged, MachineMonitor
from neurosnap.health.monitor import HealthMonitor
from neurosnap.health.ten_minute_steps import STEP, Steps

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
_REGULAR = 0.9
"""The share of times between observations that are the usual one, of a clock."""
_HOLDS = 5
"""Steps for which a machine's readings hold: it is off, or not heard, from then on."""
_QUICK = 10.0
"""Seconds: what is observed more often than that is no home."""


def usual_step(times: Floats) -> float:
    """Return the seconds of a machine's steps, by when it was observed.

    It is the usual time between two observations, or a second, where that is more.

    Args:
        times: ``(T,)``, seconds since 1970, in order.

    Returns:
        0 if it is no machine: observations come now and then, as something happens.
    """
    apart = np.diff(times)
    apart = apart[apart > 0]
    if not len(apart):
        return 0.0
    usual = float(np.median(apart))
    alike = (np.abs(apart - usual) <= 0.01 * usual).mean()
    return max(1.0, round(usual, 3)) if usual < _QUICK or alike >= _REGULAR else 0.0


class Follower:
    """Follows sensors, and reports which of them seem broken.

    Args:
        names: Of the sensors.
        alarms: The budget, such as ``1/week``.
        zone: The time zone, such as ``Europe/Berlin``; UTC if none of that name is
            known here.
        step: Seconds of a machine's steps; 0 if it is a home.
        alike: Pairs of sensors, by number, that are about the same signal.
        numbers: Returns what the signals of sensors measured, by their number, of what
            an observation says.

    Attributes:
        monitor: Who judges.

    Raises:
        InvalidValueError: The budget has another form.
    """

    def __init__(
        self,
        names: Sequence[str],
        alarms: str = "1/week",
        zone: str = "UTC",
        step: float = 0.0,
        alike: Sequence[tuple[int, int]] = (),
        numbers: Callable[[bytes], Mapping[int, float]] = lambda _: {},
    ) -> None:
        self._zone = zone
        self._numbers, self._said = numbers, b""
        self._place = {name: sensor for sensor, name in enumerate(names)}
        count = len(names)
        self._steps: _HomeSteps | _MachineSteps
        self.monitor: HealthMonitor | MachineMonitor
        if step:
            self.monitor = MachineMonitor(names, alarms, zone, step, alike)
            self._steps = _MachineSteps(self.monitor, count, step)
        else:
            self.monitor = HealthMonitor(names, alarms, zone)
            self._steps = _HomeSteps(self.monitor, count)
        self._step = step or float(STEP)
        self._at: float | None = None  # the last observation, or look at the clock
        self._number = 0  # of the step under way
        self._alarms: dict[str, Alarm] = {}  # in force, as they were raised

    @property
    def standing(self) -> Standing:
        """How the sensors are after the last step that is over."""
        alarms = tuple(self._alarms.values())
        over = self._number * self._step
        return Standing(over, self.monitor.progress, alarms, self._zone)

    def observe(
        self,
        on: Flags,
        known: Flags,
        at: float,
        *,
        begins: bool = False,
        said: bytes = b"",
    ) -> list[News]:
        """Observe a tick.

        Args:
            on: ``(N,)``, which sensors are on.
            known: ``(N,)``, which readings are known. One that is unknown is not on.
            at: When it was, seconds since 1970. One before the last counts as of its
                time.
            begins: Nothing was read before it: what was on meanwhile is unknown.
            said: The numbers behind the readings.

        Returns:
            What is said of the steps that were over by then, in order; in each, what
            ends comes before what begins. A step costs a millisecond or so, and now and
            then the time to learn anew.
        """
        if self._at is None:
            self._at, self._number, begins = at, int(at // self._step), True
        elif begins:
            none = np.zeros(len(on), np.bool_)
            self._steps.read(none, none, self._at)
        news = self.until(at)
        if begins:
            self._steps.begin()
        self._steps.read(on, known, max(at, self._at))
        self._said = said
        return news

    def until(self, now: float) -> list[News]:
        """Let time pass to `now`, seconds since 1970, after the first observation."""
        said: list[News] = []
        if self._at is None:
            return said
        while (end := (self._number + 1) * self._step) <= now:
            if end - self._step >= self._steps.until:
                self._number = int(now // self._step)
                self._steps.begin()
                break
            begun, well = self._steps.over(self._number, end)
            if begun:
                numbers = self._numbers(self._said)
                begun = [
                    replace(alarm, number=numbers.get(self._place[alarm.sensor]))
                    for alarm in begun
                ]
            self._number += 1
            said += [News(end, name, None, self._zone, at) for name, at in well.items()]
            said += [News(end, alarm.sensor, alarm, self._zone) for alarm in begun]
            for name in (*well, *(alarm.sensor for alarm in begun)):
                self._alarms.pop(name, None)
            self._alarms |= {alarm.sensor: alarm for alarm in begun}
            self._at = max(self._at, end)
        self._at = max(self._at, now)
        return said


class _HomeSteps:
    """Steps of ten minutes: how often each sensor came on, and how long it was on."""

    until = np.inf

    def __init__(self, monitor: HealthMonitor, count: int) -> None:
        self._monitor = monitor
        self._on_since = np.full(count, np.nan)
        self._known = np.zeros(count, np.bool_)
        self._came_on = np.zeros(count, np.int32)
        self._longest = np.zeros(count, np.float32)
        self._valid = np.zeros(count, np.bool_)  # known at some time in the step

    def begin(self) -> None:
        """Know nothing of the step under way so far; what was read counts."""

    def read(self, on: Flags, known: Flags, at: float) -> None:
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

    def over(self, number: int, end: float) -> Judged:
        """End a step, and begin the next."""
        on = ~np.isnan(self._on_since)
        lasted = np.where(on, end - self._on_since, 0.0).astype(np.float32)
        longest = np.maximum(self._longest, lasted)
        made = Steps(self._came_on[None], longest[None], number)
        valid = self._valid[None]
        self._came_on = np.zeros_like(self._came_on)
        self._longest = np.zeros_like(self._longest)
        self._valid = self._known.copy()
        begun, well = self._monitor.follow(made, valid)
        return begun, dict.fromkeys(well)


class _MachineSteps:
    """Steps of a machine: for which share of them each sensor was on, and known.

    Attributes:
        until: From when on nothing is known if nothing is read, seconds since 1970.
    """

    def __init__(self, monitor: MachineMonitor, count: int, step: float) -> None:
        self._monitor = monitor
        self._step = step
        self._at = self.until = 0.0
        self._on = np.zeros(count, np.bool_)
        self._known = np.zeros(count, np.bool_)
        self._seconds = np.zeros((2, count))
        """For how long each was on, and known, in the step so far."""
        self._whole = False

    def begin(self) -> None:
        """Know nothing of the step under way so far: it is not judged."""
        self._whole = False

    def read(self, on: Flags, known: Flags, at: float) -> None:
        """Let the sensors read so from a time on."""
        self._pass(at)
        self._on, self._known = on & known, known.copy()
        self.until = at + _HOLDS * self._step

    def over(self, number: int, end: float) -> Judged:
        """End a step, and begin the next."""
        self._pass(end)
        on, known = self._seconds
        share = np.divide(on, known, out=np.zeros_like(on), where=known > 0)
        levels = Levels(share[None], np.minimum(known / self._step, 1.0)[None])
        judged = self._monitor.follow(levels, number) if self._whole else ([], {})
        self._seconds = np.zeros_like(self._seconds)
        self._whole = True
        return judged

    def _pass(self, at: float) -> None:
        lasts = min(at, self.until) - self._at
        if lasts > 0:
            self._seconds += lasts * np.array([self._on, self._known])
        self._at = max(at, self._at)
