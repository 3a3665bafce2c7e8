"""Monitors a home's sensors, and reports which are broken and why.

Observations are grouped into steps of ten minutes, and each step is judged. What is
said follows from the observations and their times alone: one that was live, and one
that reads the recording afterwards, say the same.

All it says is a function of the steps it was given. What it learns comes from the last
eight weeks of them, without what was read during alarms: the evidence that led to an
alarm is learned, and so makes the next like it less likely; what a broken sensor reads
is not.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.health.alarm import Alarm, AlarmProgress, SensorHealth, lasted, told
from neurosnap.health.alarm_budget import parse_budget
from neurosnap.health.evidence import CHATTER, KINDS, LESS, MORE, SILENT, STUCK
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
        others: tuple[str, ...] = ()
        who = ""
        if kind in (SILENT, LESS):
            valid = self._valid[: self._kept]
            others, who = companion(self._names, history, valid, sensor, since)
        why = _what(
            kind,
            Facts(
                told(since * STEP, self.zone),
                (number + 1 - since) * STEP,
                evidence,
                self._most(sensor, kind, at),
                int(history.came_on[at:, sensor].sum()),
                expected,
                unexpected,
            ),
        )
        return Alarm(
            zone=self.zone,
            sensor=self._names[sensor],
            kind=KINDS[kind],
            since=since * float(STEP),
            at=(number + 1) * float(STEP),
            weekly=float(weekly(learned.tails[sensor, kind], evidence)),
            why=why + who,
            otherwise=_ELSE[kind],
            others=others,
        )

    def _most(self, sensor: int, kind: int, until: int) -> float:
        """Return the most evidence before a row of what is kept; 0 where it is long."""
        valid = self._valid[:until, sensor]
        if kind == STUCK:
            return float(np.log1p(self._longest[:until, sensor][valid].max(initial=0)))
        if kind == CHATTER:
            return float(np.log(self._came_on[:until, sensor][valid].max(initial=1)))
        return 0.0


class Facts(NamedTuple):
    """What an alarm about a sensor is told by."""

    began: str
    """When the evidence began."""
    lasted: float
    """For how many seconds it has been going on."""
    evidence: float
    """Of its kind, see `neurosnap.health.evidence`."""
    before: float
    """How far it went at most while the home was learned."""
    came_on: int
    """How often the sensor came on since."""
    expected: float
    """In how many steps it was expected to come on since."""
    unexpected: int
    """In how many steps it came on since although hardly anything spoke for it."""


_ELSE = (
    "nobody uses it any more, or the day differs from all days learned",
    "the room is used less than it was",
    "guests, a pet, or a new habit",
    "left open or left on",
    "somebody plays with it, or a loose contact",
)
"""What else each kind of evidence could be."""


def _what(kind: int, facts: Facts) -> str:
    """Return what was read, and what was to be expected."""
    began = facts.began
    if kind == SILENT:
        return (
            f"silent since {began} ({lasted(facts.lasted)}), where"
            f" {facts.expected:.1f} activations were to be expected"
        )
    if kind in (LESS, MORE):
        alone = f", {facts.unexpected} of them with nothing that it goes with"
        times = "once" if facts.came_on == 1 else f"{facts.came_on} times"
        return (
            f"came on {times} since {began}, where"
            f" {facts.expected:.1f} were to be expected"
            f"{alone if kind == MORE and facts.unexpected else ''}"
        )
    if kind == STUCK:
        return (
            f"on for {_seconds(facts.evidence)} since {began}, longest before:"
            f" {_seconds(facts.before)}"
        )
    return (
        f"came on {facts.came_on} times within ten minutes, most before:"
        f" {math.exp(facts.before):.0f}"
    )


def _seconds(evidence: float) -> str:
    """Return the time on that evidence of kind ``stuck`` stands for."""
    seconds = math.expm1(evidence)
    return f"{seconds:.0f} s" if seconds < STEP else lasted(seconds // STEP * STEP)


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
) -> tuple[tuple[str, ...], str]:
    """Return the other sensor whose activity makes a silence most surprising, and why.

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
        return (), ""
    return (names[best],), (
        f" ({names[best]} came on in {alone[best]} hours without it; before, in"
        f" {together[best]} of {hours[best]} with it)"
    )


def _hours(active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which hours, from the end backwards, sensors came on."""
    rest = len(active) % _HOUR
    whole = active[rest:]
    return np.asarray(whole.reshape(-1, _HOUR, active.shape[1]).any(1))
