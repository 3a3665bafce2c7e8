"""Learns what is normal from a home's history, and how much evidence varies."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.health import expectation
from neurosnap.health.evidence import (
    CLOCKS,
    KINDS,
    LESS,
    MORE,
    SUMS,
    USUAL,
    WORTH,
    JudgedSteps,
    follow,
    peaks,
)
from neurosnap.health.expectation import WINDOWS
from neurosnap.health.tail_probability import tail_of
from neurosnap.health.ten_minute_steps import DAY, WEEK, Steps, parts_of_day

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
ACTIVATIONS = 20
"""How often a sensor must have come on to be known."""
OCCASIONS = 5
"""In how many steps."""
LEAST_STEPS = 3 * DAY
_LATELY = 6
"""Steps in which another sensor must have come on for silence to count."""


@dataclass(frozen=True)
class LearnedRates:
    """The normal behaviour of sensors, learned from a home's history."""

    weights: Floats
    """``(3, features, sensors)``, see `expectation`."""
    scales: Floats
    """``(4, sensors)``, what the clocks of a silence usually come to."""
    tails: Floats
    """``(sensors, 5, 4)``, a tail for each kind of evidence."""
    known: Flags
    """``(sensors,)``, which sensors are known well enough to be judged."""
    judged: Flags
    """``(sensors, 5)``, by which kinds of evidence. By a changed rate once two weeks
    were seen: a first weekend differs from all days before."""
    least: float
    """The least rate a step that is ever expected."""
    zone: str
    """The time zone of the home."""


def learn(steps: Steps, valid: Flags, zone: str) -> LearnedRates:
    """Learn from a home's history where it is `valid`, ``(steps, sensors)``."""
    active = steps.came_on > 0
    parts = parts_of_day(steps.first, len(steps), zone)
    weights, expected = expectation.learned(active, valid, parts)
    rates = per_step(expected, expected[0])
    near = heard(active & valid)
    scales = _scales(rates, near, active, valid)
    least = 1 / max(1, len(steps))
    count, sensors = active.shape
    trace = np.zeros((count, sensors, len(KINDS)))
    follow(
        np.zeros((CLOCKS, sensors)),
        np.zeros((SUMS, sensors)),
        scales,
        least,
        JudgedSteps(rates, near, steps.came_on, steps.longest, valid),
        trace,
        np.zeros((count, sensors)),
    )
    weeks = np.maximum(valid.sum(0), 1) / WEEK
    tails = np.array(
        [
            [
                tail_of(peaks(trace[:, sensor, kind]), weeks[sensor], usual, worth)
                for kind, (usual, worth) in enumerate(zip(USUAL, WORTH, strict=True))
            ]
            for sensor in range(sensors)
        ]
    ).reshape(sensors, len(KINDS), 4)
    learned = active & valid
    known = (
        ((steps.came_on * valid).sum(0) >= ACTIVATIONS)
        & (learned.sum(0) >= OCCASIONS)
        & (valid.sum(0) >= LEAST_STEPS)
    )
    judged = np.tile(known[:, None], len(KINDS))
    judged[:, [LESS, MORE]] &= len(steps) >= 2 * WEEK
    return LearnedRates(weights, scales, tails, known, judged, least, zone)


def per_step(rates: Floats, alone: Floats) -> Floats:
    """Return the rates that evidence is followed by: ``(4, steps, sensors)``.

    Args:
        rates: ``(3, steps, sensors)``, a window each.
        alone: ``(steps, sensors)``, a step; what ``more`` is judged by.
    """
    steps = rates / np.array(WINDOWS)[:, None, None]
    return np.concatenate([steps, alone[None]])


def heard(active: Flags) -> Flags:
    """Return whether others were active lately, ``(steps, sensors)``.

    An empty home says nothing about its sensors.
    """
    sums = np.zeros((len(active) + 1, active.shape[1]), np.int64)
    np.cumsum(active, axis=0, out=sums[1:])
    now = np.arange(1, len(active) + 1)
    lately = sums[now] - sums[np.maximum(now - _LATELY, 0)]
    return np.asarray(lately.sum(1)[:, None] > lately)


def _scales(rates: Floats, near: Flags, active: Flags, valid: Flags) -> Floats:
    """Return the mean of the longer half of the silences, by each clock."""
    sensors = active.shape[1]
    goes = near & valid & ~active
    scales = np.ones((CLOCKS, sensors))
    for clock in range(CLOCKS):
        went = goes * (rates[clock] if clock < CLOCKS - 1 else 1.0)
        passed = np.cumsum(went, axis=0)
        for sensor in range(sensors):
            at = passed[active[:, sensor] & valid[:, sensor], sensor]
            lasted = np.sort(np.diff(at))
            long = lasted[len(lasted) // 2 :]
            if len(long) and long.mean() > 0:
                scales[clock, sensor] = long.mean()
    return scales
