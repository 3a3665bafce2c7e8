"""Judges sensors step by step against what was learned, within a budget of alarms."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.alarm_budget import LOOKBACK, shares
from neurosnap.health.evidence import (
    CHATTER,
    CLOCKS,
    KINDS,
    LESS,
    MORE,
    SILENT,
    STUCK,
    SUMS,
    JudgedSteps,
    follow,
    speaks,
)
from neurosnap.health.expectation import REACH, WINDOWS, features
from neurosnap.health.learn_normal import LearnedRates, heard, per_step
from neurosnap.health.tail_probability import weekly
from neurosnap.health.ten_minute_steps import DAY, STEP, WEEK, parts_of_day

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
WELL = -1
"""The kind of a sensor without an alarm."""
_WELL_BELOW = 0.5
"""Strain below which a sensor whose rate had changed is well again."""
_CALM = DAY
"""Steps for which it must be."""
_NEAR = 0.8
"""Strain from which on a rate counts as changed, when they are counted."""
_MANY = 3
"""So many sensors, and one of so many, are many at once."""
_ACCEPTED = 2 * WEEK
"""Steps after which a changed rate is how the home is now."""


class RateChanges(NamedTuple):
    """The sensors whose alarm began in a step, and those whose alarm ended."""

    begun: list[int]
    ended: list[int]


class Judge:
    """Judges the sensors of a home: the evidence against each, and its alarm.

    The budget is so many alarms a week. An alarm ends when its sensor is well again: it
    came on after a silence, went off after it was stuck, or came on as usual for a day.
    The evidence for it starts from zero then, so that a repair is no alarm.
    """

    def __init__(self, sensors: int, alarms: float) -> None:
        self._alarms = alarms
        self.recent = np.zeros((REACH, sensors), np.bool_)
        """Who came on in the last steps."""
        self.clocks = np.zeros((CLOCKS, sensors))
        self.sums = np.zeros((SUMS, sensors))
        self.evidence = np.zeros((sensors, len(KINDS)))
        self.since = np.zeros((sensors, len(KINDS)), np.int64)
        """The steps in which the evidence began."""
        self.strain = np.zeros((sensors, len(KINDS)))
        """How near to an alarm: 0 is not at all, 1 is one; a logarithm of how rare."""
        self.kind = np.full(sensors, WELL)
        """The kind of alarm that each sensor is in."""
        self.raised_at = np.zeros(sensors, np.int64)
        self.calm = np.zeros(sensors, np.int64)
        self.raised = np.zeros(0, np.int64)
        """The steps in which alarms were raised lately."""

    def remember(self, came_on: NDArray[np.int32], valid: Flags) -> None:
        """Remember which sensors came on in a step; judge nothing.

        Args:
            came_on: ``(sensors,)``, how often each came on.
            valid: ``(sensors,)``, which readings are known.
        """
        self.recent = np.concatenate([self.recent[1:], ((came_on > 0) & valid)[None]])

    def step(
        self,
        learned: LearnedRates,
        number: int,
        came_on: NDArray[np.int32],
        longest: NDArray[np.float32],
        valid: Flags,
    ) -> RateChanges:
        """Take a step.

        Args:
            learned: What to judge by.
            number: Of the step.
            came_on: ``(sensors,)``, how often each came on.
            longest: ``(sensors,)``, seconds, as in `Steps`.
            valid: ``(sensors,)``, which readings are known.
        """
        self.remember(came_on, valid)
        rates = self._rates(learned, number)
        near = heard(self.recent)[-1:]
        trace = np.zeros((1, *self.evidence.shape))
        due = np.zeros((1, len(self.kind)))
        judged = JudgedSteps(rates, near, came_on[None], longest[None], valid[None])
        follow(
            self.clocks, self.sums, learned.scales, learned.least, judged, trace, due
        )
        self._keep_evidence(trace[0], number, came_on, longest, valid)
        ended = self._end(number, came_on, longest, valid)
        self._weigh(learned, number, due[0], valid)
        return RateChanges(self._begin(learned, number), ended)

    def _rates(self, learned: LearnedRates, number: int) -> Floats:
        """Return the rates of a step, ``(4, 1, sensors)``.

        A sensor in alarm accuses no other of silence. Where it could excuse an
        activation, the word of a sensor in bad health is replaced by how likely the
        others say it would have come on.
        """
        others = slice(2 * len(self.kind))
        ill = np.tile(self._ill(), 2)
        part = parts_of_day(number, 1, learned.zone)
        now = np.full(len(WINDOWS), REACH - 1)
        rows = features(self.recent, part, np.array(WINDOWS), now)
        excuse = rows[:1].copy()
        excuse[:, others] *= 1 - ill
        likely = -np.expm1(-(excuse @ learned.weights[0]))
        excuse[:, others] += ill * np.tile(likely, 2)
        rows[:, others] *= np.tile(self.kind == WELL, 2)
        rates = rows[:, None] @ learned.weights
        return per_step(rates, excuse @ learned.weights[0])

    def _ill(self) -> Floats:
        """Return how ill each sensor is, from 0 to 1, in alarm.

        Half the way to an alarm is nothing yet: evidence often goes as far.
        """
        ill = (2 * self.strain.max(1) - 1).clip(0, 1)
        ill[self.kind != WELL] = 1
        return np.asarray(ill)

    def _keep_evidence(
        self,
        trace: Floats,
        number: int,
        came_on: NDArray[np.int32],
        longest: NDArray[np.float32],
        valid: Flags,
    ) -> None:
        """Keep the evidence of a step, and when it began."""
        fresh = ((self.evidence <= 0) | (trace <= 0)) & valid[:, None]
        self.since[fresh] = number
        on = came_on > 0
        self.since[on, SILENT] = number + 1
        lasted = np.ceil(longest / STEP).astype(np.int64)
        self.since[:, STUCK] = number + 1 - np.maximum(lasted, 1)
        self.since[:, CHATTER] = number
        self.evidence = np.where(valid[:, None], trace, self.evidence)

    def _weigh(
        self, learned: LearnedRates, number: int, expected: Floats, valid: Flags
    ) -> None:
        self.raised = self.raised[self.raised > number - LOOKBACK]
        allowed = shares(self._alarms, int(learned.known.sum()), len(self.raised))
        often = weekly(learned.tails, self.evidence)
        most = np.maximum(learned.tails[..., 0], 2 * allowed)
        strain = np.log(most / np.maximum(often, 1e-300)) / np.log(most / allowed)
        judged = learned.judged & speaks(self.evidence, expected)
        strain = np.where(judged, np.maximum(strain, 0.0), 0.0)
        self.strain = np.where(valid[:, None], strain, self.strain)
        self.sums *= learned.judged[:, LESS]
        self._excuse_many(int(learned.known.sum()))

    def _excuse_many(self, known: int) -> None:
        """Let no sensor be near an alarm because the rates of many have changed.

        Guests come, or all go away: one event, and no fault of the sensors.
        """
        rates = self.strain[:, LESS:STUCK]
        many = (rates >= _NEAR).sum(0) >= max(_MANY, known / _MANY)
        rates[:, many] = np.minimum(rates[:, many], _NEAR)

    def _begin(self, learned: LearnedRates, number: int) -> list[int]:
        over = self.strain.max(1) >= 1
        # One that was too loud and falls silent is another alarm.
        silent = (self.strain[:, :MORE].max(1) >= 1) & (self.kind >= MORE)
        begun = np.flatnonzero(over & (self.kind == WELL) | silent)
        for sensor in begun:
            kinds = (
                self.strain[sensor, :MORE] if silent[sensor] else self.strain[sensor]
            )
            self.kind[sensor] = kinds.argmax()
            self.raised_at[sensor] = number
            self.calm[sensor] = 0
        self.raised = np.concatenate([self.raised, np.full(len(begun), number)])
        return [int(sensor) for sensor in begun]

    def _end(
        self,
        number: int,
        came_on: NDArray[np.int32],
        longest: NDArray[np.float32],
        valid: Flags,
    ) -> list[int]:
        ended = []
        for sensor in np.flatnonzero(self.kind != WELL):
            kind = self.kind[sensor]
            if kind == SILENT:
                well = came_on[sensor] > 0
            elif kind == STUCK:
                well = longest[sensor] == 0
            else:
                below = self.strain[sensor, LESS:].max() < _WELL_BELOW
                if valid[sensor]:
                    self.calm[sensor] = self.calm[sensor] + 1 if below else 0
                accepted = number - self.raised_at[sensor] >= _ACCEPTED
                well = self.calm[sensor] >= _CALM or accepted
            if well:
                self._reset(int(sensor))
                ended.append(int(sensor))
        return ended

    def _reset(self, sensor: int) -> None:
        """End an alarm. A silence goes on while one of another kind ends."""
        if self.kind[sensor] == STUCK:
            self.clocks[:, sensor] = 0
        if self.kind[sensor] in (SILENT, STUCK):
            self.evidence[sensor, SILENT] = self.strain[sensor, SILENT] = 0
        self.kind[sensor] = WELL
        self.sums[:, sensor] = 0
        self.evidence[sensor, LESS:] = 0
        self.strain[sensor, LESS:] = 0
