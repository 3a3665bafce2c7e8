"""The five kinds of evidence that a sensor is broken, updated at each step.

``silent``: what was expected since it last came on, by four clocks: the rates that
the others' activity gives over ten minutes, an hour and four hours, and the time in
which others were active at all. Their geometric mean, each in units of its usual
course, counts: a silence is long if it is by all of them.

``less``: it comes on less than expected. ``more``: it comes on when nothing speaks for
it. ``stuck``: it is on for long. ``chatter``: it comes on many times in a step.

``less`` and ``more`` are cumulated log likelihood ratios that restart at zero (Page's
CUSUM): of a rate that is 70 % smaller, and of rates to which activations are added,
three a day or two an hour, whichever has more evidence. They are e-detectors in the
sense of Shin, Ramdas and Rinaldo (2022) as far as the rates are right.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.compiled import njit

Floats = NDArray[np.float64]
KINDS = ("silent", "less", "more", "stuck", "chatter")
SILENT, LESS, MORE, STUCK, CHATTER = range(5)
CLOCKS = 4
USUAL = np.array([0.5, 1.0, 1.0, 0.7, 0.35])
"""What evidence goes above its start on average, at least. 1 for log likelihood ratios:
by Ville's inequality they exceed x with probability ``exp(-x)`` if the rates are right,
and no more often. A silence is in units of its usual course, the others are logarithms
of times and of numbers."""
WORTH = np.array([1.0, 4.0, 4.0, 4.0, 4.0])
"""How many peaks that is worth: silences differ most from sensor to sensor."""
SUMS = 3
_THINNED = 0.3
_RARE = 0.02
_OFTEN = 0.3
_MOST = 3.0
"""What one step with an activation can say for ``more``: one alone is no alarm."""


class JudgedSteps(NamedTuple):
    """The readings of some steps, and what was expected of them."""

    rates: Floats
    """``(4, steps, sensors)``: by which the first three clocks go on a step; the last
    is the rate a step that ``more`` is judged by."""
    heard: NDArray[np.bool_]
    """``(steps, sensors)``, whether others were active lately."""
    came_on: NDArray[np.int32]
    """``(steps, sensors)``, how often each came on."""
    longest: NDArray[np.float32]
    """``(steps, sensors)``, seconds."""
    valid: NDArray[np.bool_]
    """``(steps, sensors)``; nothing changes where false."""


@njit(nogil=True)
def follow(
    clocks: Floats,
    sums: Floats,
    scales: Floats,
    least: float,
    judged: JudgedSteps,
    trace: Floats,
    expected: Floats,
) -> None:
    """Go on with the evidence by some steps.

    Args:
        clocks: ``(4, sensors)``, since a sensor last came on; changed.
        sums: ``(3, sensors)``, less, and more by few and by many; changed.
        scales: ``(4, sensors)``, the usual course of the clocks.
        least: The least rate a step that is ever expected.
        judged: The steps.
        trace: ``(steps, sensors, 5)``, the evidence of each kind; written.
        expected: ``(steps, sensors)``, how many activations were to be expected since
            the last, by the first clock; written.
    """
    rates, heard, came_on, longest, valid = judged
    steps, sensors = came_on.shape
    for step in range(steps):
        for sensor in range(sensors):
            row = trace[step, sensor]
            if not valid[step, sensor]:
                row[:] = 0.0
                expected[step, sensor] = 0.0
                continue
            on = came_on[step, sensor] > 0
            rate = max(rates[0, step, sensor], least)
            calm = max(rates[3, step, sensor], least)
            if on:
                clocks[:, sensor] = 0.0
                less = np.log(np.expm1(-_THINNED * rate) / np.expm1(-rate))
                past = np.expm1(-calm)
                rare = min(_MOST, np.log(np.expm1(-calm - _RARE) / past))
                often = min(_MOST, np.log(np.expm1(-calm - _OFTEN) / past))
            else:
                less = (1 - _THINNED) * rate
                rare = -_RARE
                often = -_OFTEN
                if heard[step, sensor]:
                    for clock in range(3):
                        clocks[clock, sensor] += rates[clock, step, sensor]
                    clocks[3, sensor] += 1.0
            sums[0, sensor] = max(0.0, sums[0, sensor] + less)
            sums[1, sensor] = max(0.0, sums[1, sensor] + rare)
            sums[2, sensor] = max(0.0, sums[2, sensor] + often)
            course = 1.0
            for clock in range(4):
                course *= clocks[clock, sensor] / scales[clock, sensor]
            row[0] = course**0.25
            expected[step, sensor] = clocks[0, sensor]
            row[1] = sums[0, sensor]
            row[2] = max(sums[1, sensor], sums[2, sensor])
            row[3] = np.log1p(longest[step, sensor])
            row[4] = np.log(came_on[step, sensor]) if on else 0.0


def speaks(evidence: Floats, expected: Floats) -> NDArray[np.bool_]:
    """Return where evidence says anything at all, however rare it may be.

    A silence does not before one activation was to be expected: those of a sensor that
    comes on again and again are mostly over in minutes.

    Args:
        evidence: ``(..., 5)``, 0 or more.
        expected: ``(...)``, how many activations were to be expected since the last.
    """
    does: NDArray[np.bool_] = evidence > 0
    does[..., SILENT] &= expected >= 1
    return does


def peaks(evidence: Floats) -> Floats:
    """Return the peaks of ``(steps,)``, 0 or more, in the excursions that are over."""
    above = np.concatenate([[False], evidence > 0, [False]])
    bounds = np.flatnonzero(above[1:] != above[:-1]).reshape(-1, 2)
    over = bounds[bounds[:, 1] < len(evidence)]
    if not len(over):
        return np.zeros(0)
    return np.maximum.reduceat(evidence, over.ravel())[::2]
