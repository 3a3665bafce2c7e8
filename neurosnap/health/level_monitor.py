"""Judges the signals of a machine by the levels of their sensors, step by step.

All that is said is a function of the steps it was given. A signal in alarm is learned
from no more, and no other is judged by it: so one fault is one alarm, and what goes on
beside it is still found.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import ShapeError
from neurosnap.health.alarm_budget import parse_budget
from neurosnap.health.level_evidence import (
    STRETCH,
    TOP,
    TURN,
    WINDOWS,
    Bounds,
    LevelEvidence,
    Levels,
    Moments,
    Peaks,
    follow,
    is_well,
    learn,
)
from neurosnap.health.level_model import LevelModel
from neurosnap.health.tail_probability import MEAN, RATE, SHAPE, START, weekly

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
FIRST = 300
"""Steps from which on there is a regression."""
TURNS = 40
"""How often a sensor must have changed to be known."""
_GROWTH = 1.25
"""The regression is made anew whenever so many times as many steps were seen."""
_RECENT = 1 / 3
"""Peaks count from this share of all steps on: the first regressions were worse."""
_FEWEST = 5
"""Peaks that tell how far evidence goes, at least."""
_PRIOR = 4
"""Peaks that what is usual among all signals is worth, for one of them."""
_HEAVY = 0.15, 0.4
"""How heavy the tail of peaks is, at least and at most: the extreme value index. Even
where peaks look exponential, a machine does more than was seen."""
_CALM, _AGREED = 32, 5
"""Steps that the evidence must be as usual for an alarm to end, and how often the
sensor must have changed in them, at least: while nothing happens all agree."""
_RELAPSE = 4
"""How many times as many it takes for an alarm that came back within `_NOVEL`."""
HEARD = 0.5
"""Share of the time that a sensor is known, which is told to be silent below it."""
_WEEK = 7 * 86400.0
_ACCEPTED = 2 * _WEEK
"""Seconds after which what an alarm is about is how the machine is now."""
_NOVEL = 0.1
"""The share of the time between two alarms of the budget that is learned before any is
raised. What a machine does for the first time, such as a first stop halfway, no tail
foretells. The rule comes from a simulated plant; the share was not fitted to it."""
_CHECKED = 1024
"""Steps after which it is seen anew what the budget allows."""


class LevelAlarm(NamedTuple):
    """An alarm about a signal, and what it is told by."""

    signal: int
    sensor: int
    """The one of its sensors that differs most."""
    since: int
    """The step in which the evidence began."""
    at: int
    """The step after which it was raised."""
    window: int
    """The place of the window over which the evidence is most unlikely."""
    weekly: float
    """How often a week it would go so far with nothing wrong."""
    known: float
    """For which share of the window the sensor was known; 0 if it is not known now."""
    read: float
    """For which share of that it was on."""
    guessed: float
    """For which share it should have been, by all others."""
    patience: int
    """How many times as many steps as else it must be as usual for it to end."""
    others: tuple[int, ...]
    """The sensors that the guess rests on, the one that says most first."""


class LevelChange(NamedTuple):
    """An alarm that begins or ends with a step."""

    step: int
    alarm: LevelAlarm
    begins: bool
    usual: int | None = None
    """From which step on it was as usual, if it ends so."""


class LevelMonitor:
    """Judges the signals of a machine by their sensors' levels.

    Args:
        signals: Of each sensor the number of its signal, from 0 on, rising.
        alarms: The budget, such as ``1/week``.
        step: Seconds.

    Raises:
        InvalidValueError: The budget has another form.
    """

    def __init__(
        self, signals: Sequence[int], alarms: str = "1/week", step: float = 1.0
    ) -> None:
        count = int(signals[-1]) + 1 if len(signals) else 0
        self._bounds = np.searchsorted(np.array(signals), np.arange(count + 1))
        self._budget = parse_budget(alarms)
        self._step = step
        self._lasting = round(_ACCEPTED / step)
        self._novel = _NOVEL * _WEEK / self._budget / step  # steps
        self._seen = 0
        self.turns = np.zeros(len(signals), np.int64)
        """How often each sensor changed, from one step to the next."""
        self._before = np.full(len(signals), np.nan)
        self._evidence = LevelEvidence.none(count, len(signals))
        self._moments = Moments.none(len(signals))
        self._model: LevelModel | None = None
        self._eras: list[tuple[int, Peaks]] = []
        self._tails = np.zeros((len(WINDOWS), count, 4))
        self._alarms: dict[int, LevelAlarm] = {}
        self._accepted: dict[int, LevelAlarm] = {}
        self._over: dict[int, LevelChange] = {}
        self._raised: list[int] = []
        self._limits: tuple[bytes, Bounds] | None = None

    @property
    def known(self) -> Flags:
        """Which signals are known well enough to be judged, ``(S,)``."""
        return self._any(self.turns >= TURNS)

    @property
    def health(self) -> Floats:
        """The health of each signal, ``(S,)``: from 1, well, to 0, in alarm."""
        used = self._tails[..., SHAPE] > 0
        often = self._often()
        most = np.maximum(self._tails[..., RATE], 2 * self._allowed(0))
        strain = np.log(most / np.maximum(often, 1e-300)) / np.log(
            most / self._allowed(0)
        )
        health = 1 - np.where(used, strain, 0.0).max(0).clip(0, 1)
        health[~self.known] = 1
        health[[*self._alarms]] = 0
        return np.asarray(health)

    def follow(self, levels: Levels, number: int) -> list[LevelChange]:
        """Judge the steps that come next, and learn from them.

        Steps in which no sensor is known are left out: the machine is off, or nothing
        is received.

        Args:
            levels: What the sensors read.
            number: Of the first step; larger than those before.

        Raises:
            ShapeError: They are of another number of sensors.
        """
        if levels.on.shape[1] != len(self.turns):
            rule = f"must have {len(self.turns)} sensors"
            raise ShapeError("levels", rule, levels.on.shape[1])
        changes: list[LevelChange] = []
        at = 0
        while at < len(levels.on):
            heard = levels.known[at] > 0
            if not heard.any():
                at += 1
                continue
            stop = self._stop(levels.known, at, number)
            some = Levels(levels.on[at:stop], levels.known[at:stop])
            went = stop - at
            if self._model is None:
                learn(some, self._evidence.lately, self._moments)
            else:
                went = self._judge(self._model, some, number + at)
            at += went
            self._seen += went
            self._count(Levels(some.on[:went], some.known[:went]))
            if self._model is not None:
                changes += self._changes(self._model, heard, number + at - 1)
            if self._seen == self._next():
                self._learn_anew()
            if self._seen % _CHECKED == 0:
                self._limits = None
        return changes

    def _stop(self, known: Floats, at: int, number: int) -> int:
        """Return how far steps can be judged by the same bounds and regression.

        It depends on the numbers of the steps, and not on how many are given at once.
        """
        left = min(self._next() - self._seen, _CHECKED - self._seen % _CHECKED)
        for alarm in self._alarms.values():
            left = min(left, alarm.at + self._lasting + 1 - number - at)
        some = known[at : at + max(1, left)] > 0
        other = (some != some[0]).any(1).nonzero()[0]
        return at + (int(other[0]) if len(other) else len(some))

    def _next(self) -> int:
        """Return after how many steps the regression is made anew."""
        return int(self._eras[-1][0] * _GROWTH) if self._eras else FIRST

    def _judge(self, model: LevelModel, levels: Levels, number: int) -> int:
        heard = levels.known[0] > 0
        return follow(
            number,
            levels,
            model.mask(heard, self._bad()),
            self._bounds_of(model, heard, number),
            self._evidence,
            self._moments,
            self._eras[-1][1],
        )

    def _often(self) -> Floats:
        """Return how often a week evidence would go so far with nothing wrong."""
        used = self._tails[..., SHAPE, None] > 0
        return weekly(np.where(used, self._tails, 1), self._evidence.mean)

    def _bad(self) -> list[int]:
        return sorted((*self._alarms, *self._accepted))

    def _any(self, sensors: Flags) -> Flags:
        """Return which signals have such a sensor."""
        some = np.concatenate([[0], np.cumsum(sensors)])
        return np.asarray(np.diff(some[self._bounds]) > 0)

    def _count(self, levels: Levels) -> None:
        """Count how often sensors change."""
        on = np.where(levels.known > 0, levels.on, np.nan)
        rows = np.concatenate([self._before[None], on])
        self.turns += (np.abs(np.diff(rows, axis=0)) >= TURN).sum(0)
        self._before = np.where(np.isnan(on[-1]), self._before, on[-1])

    def _allowed(self, number: int) -> float:
        """Return how often a week each signal may be told by each window."""
        lately = [at for at in self._raised if (number - at) * self._step < 4 * _WEEK]
        excess = max(1.0, len(lately) / (4 * self._budget))
        windows = int(self._tails[..., SHAPE].any(1).sum())
        return self._budget / excess / max(1, windows * int(self.known.sum()))

    def _bounds_of(self, model: LevelModel, heard: Flags, number: int) -> Bounds:
        """Return where evidence is told, and where it is as usual.

        A signal that changed too seldom to be known is told if it is not heard. One
        that leans on signals that are left out is not: what is usual was learned with
        them.
        """
        if self._limits is not None and self._limits[0] == heard.tobytes():
            return self._limits[1]
        rate, start, mean, shape = np.moveaxis(self._tails, -1, 0)
        far = (rate / self._allowed(number)) ** (1 / np.maximum(shape, 1)) - 1
        alarm, usual = start + mean * shape * np.maximum(far, 0), start.copy()
        alarm[shape == 0] = usual[shape == 0] = np.inf
        alarm[:, ~self.known & ~self._any(~heard)] = np.inf
        if self._seen < self._novel:
            alarm[:] = np.inf
        count = alarm.shape[1]
        bad, learned = np.zeros(count, np.bool_), np.ones(count, np.bool_)
        bad[self._bad()] = True
        alarm[:, bad | model.mask(heard, self._bad()).unsure] = np.inf
        learned[[*self._alarms]] = False
        within, turns = np.full(count, len(WINDOWS)), np.zeros(count, np.int64)
        ends = np.full(count, self._lasting)
        for signal, alarmed in self._alarms.items():
            within[signal] = max(1, alarmed.window)
            calm = alarmed.patience * max(_CALM, int(WINDOWS[alarmed.window]))
            ends[signal] = min(calm, self._lasting)
            turns[signal] = _AGREED * (alarmed.known > HEARD)
        made = Bounds(alarm, usual, bad, learned, ends, turns, within)
        self._limits = heard.tobytes(), made
        return made

    def _changes(self, model: LevelModel, heard: Flags, last: int) -> list[LevelChange]:
        """Return the alarms that begin and end after a step."""
        bounds = self._bounds_of(model, heard, last)
        changes = []
        for signal in self._bad():
            alarm = {**self._accepted, **self._alarms}[signal]
            calm = is_well(signal, self._evidence, bounds)
            if signal in self._alarms and (calm or last - alarm.at >= self._lasting):
                usual = int(self._evidence.odd[signal]) + 1 if calm else None
                self._over[signal] = LevelChange(last, alarm, False, usual)
                changes.append(self._over[signal])
                del self._alarms[signal]
                if not calm:
                    self._accepted[signal] = alarm
            elif calm:
                del self._accepted[signal]
        over = self._evidence.mean > bounds.alarm
        if over.any():
            alarm = self._begin(model, heard, over, last)
            changes.append(LevelChange(last, alarm, True))
        if changes or len(self._bad()) < bounds.bad.sum():
            self._forget()
            self._limits = None
        return changes

    def _begin(
        self, model: LevelModel, heard: Flags, over: Flags, last: int
    ) -> LevelAlarm:
        """Begin the alarm of the signal whose evidence is most unlikely.

        It explains what is odd about all others.
        """
        evidence = self._evidence
        often = np.where(over, self._often(), np.inf)
        window, signal = map(int, np.unravel_index(int(often.argmin()), often.shape))
        low, high = self._bounds[signal : signal + 2]
        apart, known = evidence.apart[window], evidence.known[window]
        odd = np.maximum(apart, 1 - known)[low:high]
        sensor = int(low + odd.argmax())
        patience, before = 1, self._over.get(signal)
        if before is not None and last - before.step < self._novel:
            patience = _RELAPSE * before.alarm.patience
        alarm = LevelAlarm(
            signal=signal,
            sensor=sensor,
            since=int(evidence.began[window, signal]),
            at=last,
            window=window,
            weekly=float(often[window, signal]),
            known=float(known[sensor] * heard[sensor]),
            read=float(evidence.read[window, sensor]),
            guessed=float(evidence.guessed[window, sensor]),
            patience=patience,
            others=model.leaned_on(signal, self._bad()),
        )
        self._alarms[signal] = alarm
        self._raised.append(last)
        evidence.calm[signal], evidence.odd[signal] = 0, last
        return alarm

    def _forget(self) -> None:
        """Let the evidence against signals not in alarm be as usual, at most."""
        well = np.ones(self._evidence.mean.shape[1], np.bool_)
        well[self._bad()] = False
        used = self._tails[..., SHAPE] > 0
        usual = np.where(used, self._tails[..., START], 0.0)
        own = self._evidence.mean
        np.minimum(own, usual, out=own, where=well)

    def _learn_anew(self) -> None:
        """Make the regression anew, and tell how far evidence goes by recent peaks."""
        self._model = LevelModel(
            self._moments.mean(), self._moments.covariance(), self._bounds
        )
        kept = [era for era in self._eras if era[0] >= self._seen * _RECENT]
        if kept:
            self._tails = tails_of([peaks for _, peaks in kept], self._step)
        count = self._tails.shape[1]
        self._eras = [*kept, (self._seen, Peaks.none(count))]
        self._limits = None


def tails_of(eras: Sequence[Peaks], step: float) -> Floats:
    """Return how often evidence goes how far: ``(W, S, 4)``.

    The columns are those of `neurosnap.health.tail_probability`; 0 for windows with too
    few peaks. How far the largest peaks are above the next one is taken to be of a
    generalized Pareto distribution (Pickands 1975), with moments for its parameters
    (Hosking and Wallis 1987); in the mean it is never less than among all signals.

    Args:
        eras: Peaks that were seen.
        step: Seconds.
    """
    stretches = np.sum([era.stretches for era in eras], axis=0)
    made = np.zeros((*eras[0].now.shape, 4))
    for window, count in enumerate(stretches.tolist()):
        if count < _FEWEST:
            continue
        top = np.concatenate([era.top[window] for era in eras], axis=1)
        top = -np.sort(-top, axis=1)
        used = min(count, max(_FEWEST, min(TOP, count // 2)))
        start = top[:, used] if used < count else np.zeros(len(top))
        excess = top[:, :used] - start[:, None]
        above = excess.sum(1)
        alike = np.median(above[above > 0]) / used if (above > 0).any() else 1.0
        weeks = count * STRETCH * WINDOWS[window] * step / _WEEK
        made[window, :, RATE] = (used + 0.5) / weeks
        made[window, :, START] = start
        mean = (above + _PRIOR * alike) / (used + _PRIOR)
        made[window, :, MEAN] = np.maximum(alike, mean)
        made[window, :, SHAPE] = 1 / np.clip(_index(excess), *_HEAVY)
    return made


def _index(excess: Floats) -> Floats:
    """Return the extreme value index of each row of excesses, by their moments."""
    mean, spread = excess.mean(1), excess.var(1, ddof=1)
    square = np.divide(mean**2, spread, out=np.ones_like(mean), where=spread > 0)
    return np.asarray((1 - square) / 2)
