"""Monitors a home's sensors, and reports which are broken and why.

Observations are grouped into steps of ten minutes, and each step is judged. What is
said follows from the observations and their times alone: one that was live, and one
that reads the recording afterwards, say the same.

All it says is a function of the steps it was given. What it learns comes from the last
eight weeks of them, without what was read during alarms: the evidence that led to an
alarm is learned, and so makes the next like it less likely; what a broken sensor reads
is not.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.health.alarm import (
    Alarm,
    AlarmProgress,
    Companion,
    News,
    SensorHealth,
    Standing,
)
from neurosnap.health.alarm_budget import parse_budget
from neurosnap.health.evidence import CHATTER, KINDS, LESS, SILENT, STUCK
from neurosnap.health.expectation import WINDOWS, features
from neurosnap.health.judge import WELL, Judge
from neurosnap.health.learn_normal import ACTIVATIONS, LEAST_STEPS, LearnedRates, learn
from neurosnap.health.tail_probability import weekly
from neurosnap.health.ten_minute_steps import DAY, STEP, WEEK, Steps, parts_of_day

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
MEMORY = 8 * WEEK
"""Steps that are learned from."""
QUIET = DAY // 3
"""Steps without any activation after which all readings count as unknown: nobody is at
home, or nothing is received. As long as a night."""
_SLACK = WEEK
"""Steps that may be kept beyond, so that dropping old ones costs little."""


class HealthMonitor:
    """Monitors the health of a home's sensors, step by step.

    Args:
        names: Of the sensors.
        alarms: The budget, such as ``1/week``.
        zone: The home's time zone, such as ``Europe/Berlin``; UTC if none of that
            name is known here.

    Raises:
        InvalidValueError: The budget has another form.
    """

    def __init__(
        self, names: Sequence[str], alarms: str = "1/week", zone: str = "UTC"
    ) -> None:
        self._names = list(names)
        self.zone = zone
        count = len(self._names)
        self._first = 0
        self._kept = 0
        self._came_on = np.zeros((MEMORY + _SLACK, count), np.int32)
        self._longest = np.zeros((MEMORY + _SLACK, count), np.float32)
        self._valid = np.zeros((MEMORY + _SLACK, count), np.bool_)
        self._seen = 0
        self.quiet = 0
        """Steps in which no sensor came on, up to now."""
        self._next = LEAST_STEPS
        self._activations = np.zeros(count, np.int64)
        self.learned: LearnedRates | None = None
        """What was learned; None if too little was seen."""
        self.judge = Judge(count, parse_budget(alarms))
        """The evidence, and who is in alarm."""

    @property
    def now(self) -> int:
        """The number of the step that comes next."""
        return self._first + self._kept

    @property
    def health(self) -> Floats:
        """The health of each sensor, from 1, well, to 0, in alarm; 1 if not known."""
        bad = self.judge.kind != WELL
        health = 1 - self.judge.strain.max(1).clip(0, 1)
        return np.asarray(np.where(bad, 0.0, health))

    @property
    def known(self) -> Flags:
        """Which sensors are known well enough to be judged."""
        if self.learned is None:
            return np.zeros(len(self._names), np.bool_)
        return self.learned.known.copy()

    @property
    def sensors(self) -> list[SensorHealth]:
        """How each sensor is."""
        each = zip(self._names, self.known.tolist(), self.health.tolist(), strict=True)
        return [SensorHealth(name, known, round(well, 3)) for name, known, well in each]

    @property
    def progress(self) -> AlarmProgress:
        """How much is learned."""
        return AlarmProgress(
            int(self._activations.sum()),
            int(np.maximum(self._activations, ACTIVATIONS).sum()),
            int(self.known.sum()),
            len(self._names),
        )

    def follow(
        self, steps: Steps, valid: Flags | None = None
    ) -> tuple[list[Alarm], list[str]]:
        """Judge the steps that come next.

        Args:
            steps: They follow on those before, if there were any.
            valid: ``(steps, sensors)``, which readings are known; if None, all.

        Returns:
            The alarms that begin, and the sensors that are well again, by name.

        Raises:
            ShapeError: Another number of sensors.
            InvalidValueError: They do not follow on those before.
        """
        if steps.came_on.shape[1] != len(self._names):
            rule = f"must have {len(self._names)} sensors"
            raise ShapeError("steps", rule, steps.came_on.shape[1])
        if self._seen == 0:
            self._first = steps.first
        if steps.first != self.now:
            raise InvalidValueError("steps", f"must begin with {self.now}", steps.first)
        begun: list[Alarm] = []
        ended: list[str] = []
        for at in range(len(steps)):
            known = np.ones(len(self._names), np.bool_) if valid is None else valid[at]
            number = self.now
            self.quiet = 0 if steps.came_on[at].any() else self.quiet + 1
            if self.quiet > QUIET:
                known = np.zeros_like(known)
            self._keep(steps.came_on[at], steps.longest[at], known)
            if self.learned is not None:
                changes = self.judge.step(
                    self.learned, number, steps.came_on[at], steps.longest[at], known
                )
                ended += [self._names[sensor] for sensor in changes.ended]
                begun += [self._told(sensor, number) for sensor in changes.begun]
            else:
                self.judge.remember(steps.came_on[at], known)
            self._seen += 1
            if self._seen >= self._next:
                self._learn()
        return begun, ended

    def _learn(self) -> None:
        """Learn from what was kept."""
        self.learned = learn(self.history(), self._valid[: self._kept], self.zone)
        self._next = self._seen + (DAY if self._seen < 2 * WEEK else WEEK)

    def history(self) -> Steps:
        """Return the steps that are kept."""
        return Steps(
            self._came_on[: self._kept], self._longest[: self._kept], self._first
        )

    def _keep(
        self, came_on: NDArray[np.int32], longest: NDArray[np.float32], known: Flags
    ) -> None:
        if self._kept == len(self._valid):
            for kept in (self._came_on, self._longest, self._valid):
                kept[:-_SLACK] = kept[_SLACK:].copy()
            self._first += _SLACK
            self._kept -= _SLACK
        self._came_on[self._kept] = came_on
        self._longest[self._kept] = longest
        self._valid[self._kept] = known & (self.judge.kind == WELL)
        self._kept += 1
        self._activations += came_on

    def _told(self, sensor: int, number: int) -> Alarm:
        """Return the alarm of a sensor in words."""
        learned = self.learned
        if learned is None:
            raise InvalidValueError("sensor", "must be in alarm", self._names[sensor])
        kind = int(self.judge.kind[sensor])
        since = int(self.judge.since[sensor, kind])
        history = self.history()
        evidence = self.judge.evidence[sensor, kind]
        at = max(0, since - self._first)
        expected, unexpected = expected_since(learned, history, sensor, since)
        return Alarm(
            zone=self.zone,
            sensor=self._names[sensor],
            kind=KINDS[kind],
            since=since,
            step=number,
            evidence=float(evidence),
            before=self._most(sensor, kind, at),
            weekly=float(weekly(learned.tails[sensor, kind], evidence)),
            came_on=int(history.came_on[at:, sensor].sum()),
            expected=expected,
            unexpected=unexpected,
            companion=(
                companion(
                    self._names, history, self._valid[: self._kept], sensor, since
                )
                if kind in (SILENT, LESS)
                else None
            ),
        )

    def _most(self, sensor: int, kind: int, until: int) -> float:
        """Return the most evidence before a row of what is kept; 0 where it is long."""
        valid = self._valid[:until, sensor]
        if kind == STUCK:
            return float(np.log1p(self._longest[:until, sensor][valid].max(initial=0)))
        if kind == CHATTER:
            return float(np.log(self._came_on[:until, sensor][valid].max(initial=1)))
        return 0.0


_HOUR = WINDOWS[1]
_LEAST = 5
"""Hours that a companion must have been seen in."""
HARDLY = 0.05
"""The probability of coming on in a step below which hardly anything speaks for it."""


def expected_since(
    learned: LearnedRates, history: Steps, sensor: int, since: int
) -> tuple[float, int]:
    """Return in how many steps a sensor was expected to come on.

    Args:
        learned: What is expected by.
        history: Up to now.
        sensor: Its number.
        since: A step of the history; steps before it are left out.

    Returns:
        How many, and in how many it came on although hardly anything spoke for it.
    """
    first = max(history.first, since)
    rows = np.arange(first - history.first, len(history))
    parts = parts_of_day(first, len(rows), learned.zone)
    inputs = features(history.came_on > 0, parts, WINDOWS[0], rows)
    rates = inputs @ learned.weights[0][:, sensor]
    likely = -np.expm1(-rates)
    came_on = history.came_on[rows, sensor] > 0
    return float(likely.sum()), int((came_on & (likely < HARDLY)).sum())


def companion(
    names: list[str],
    history: Steps,
    valid: NDArray[np.bool_],
    sensor: int,
    since: int,
) -> Companion | None:
    """Return the other sensor whose activity makes a silence most surprising.

    Of each other sensor the hours are counted in which it came on, and in which of them
    the sensor did, too, before and since. It is the one with the most hours since, each
    weighed by how seldom it was alone before.

    Args:
        names: Of the sensors.
        history: Up to now.
        valid: ``(steps, sensors)``, what was learned from.
        sensor: The silent one.
        since: The step from which on it is silent.
    """
    at = max(0, since - history.first)
    before = _hours((history.came_on * valid)[:at] > 0)
    later = _hours(history.came_on[at:] > 0)
    hours = before.sum(0)
    together = before[before[:, sensor]].sum(0)
    alone = later.sum(0)
    share = (together + 0.5) / (hours + 1)
    weight = -np.log1p(-share) * alone * (hours >= _LEAST)
    weight[sensor] = 0
    best = int(weight.argmax())
    if weight[best] <= 0:
        return None
    return Companion(
        names[best], int(together[best]), int(hours[best]), int(alone[best])
    )


def _hours(active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which hours, from the end backwards, sensors came on."""
    rest = len(active) % _HOUR
    whole = active[rest:]
    return np.asarray(whole.reshape(-1, _HOUR, active.shape[1]).any(1))


class Follower:
    """Follows the sensors of a home, observation by observation.

    Arguments and errors are those of `HealthMonitor`.

    Attributes:
        monitor: Who judges.
    """

    def __init__(
        self, names: Sequence[str], alarms: str = "1/week", zone: str = "UTC"
    ) -> None:
        self.monitor = HealthMonitor(names, alarms, zone)
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
        return Standing(self._number, self.monitor.progress, alarms, self.monitor.zone)

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
        """Let time pass to `now`, seconds since 1970, after the first observation."""
        said: list[News] = []
        zone = self.monitor.zone
        if self._at is None:
            return said
        while (end := (self._number + 1) * float(STEP)) <= now:
            alarms, well = self.monitor.follow(*self._step(end))
            said += [News(self._number, name, None, zone) for name in well]
            said += [News(self._number, alarm.sensor, alarm, zone) for alarm in alarms]
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
