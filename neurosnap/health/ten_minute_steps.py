"""Readings in steps of ten minutes: how often each sensor came on, how long it was on.

Events count, and not levels: a door that is open for weeks says nothing all the while.
"""

import functools
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.local_time import local

STEP = 600
"""Seconds of a step."""
WEEK = 7 * 86400 // STEP
"""Steps of a week."""
DAY = 86400 // STEP
PARTS = 8
"""How many parts a day has, each with rates of its own."""
_HALF = 3
"""Steps of half an hour. All clocks but Nepal's are apart by a multiple of that."""
_SATURDAY = 5


@dataclass(eq=False)
class Steps:
    """The readings of completed steps, oldest first."""

    came_on: NDArray[np.int32]
    """``(steps, sensors)``, how often a sensor came on."""
    longest: NDArray[np.float32]
    """``(steps, sensors)``, seconds: of all the times on that end in a step or outlast
    it, how long the longest had lasted by its end."""
    first: int
    """The number of the first step, in steps since 1970."""

    def __len__(self) -> int:
        return len(self.came_on)


def steps_of(
    intervals: Iterable[tuple[float, float, int]],
    sensors: int,
    begin: float,
    end: float,
) -> Steps:
    """Return the steps from the one of `begin` to the last that is over at `end`.

    Args:
        intervals: When a sensor was on: start and end in seconds since 1970, and its
            number.
        sensors: How many there are.
        begin: Seconds since 1970.
        end: Seconds since 1970.
    """
    first = int(begin // STEP)
    count = max(0, int(end // STEP) - first)
    came_on = np.zeros((count, sensors), np.int32)
    longest = np.zeros((count, sensors), np.float32)
    for start, stop, sensor in intervals:
        low = int(start // STEP) - first
        high = min(int(stop // STEP) - first, count - 1)
        if low >= count or high < 0:
            continue
        if low >= 0:
            came_on[low, sensor] += 1
        low = max(low, 0)
        ends = (np.arange(low, high + 1) + first + 1) * float(STEP)
        lasted = np.minimum(ends, stop) - start
        np.maximum(
            longest[low : high + 1, sensor], lasted, out=longest[low : high + 1, sensor]
        )
    return Steps(came_on, longest, first)


def parts_of_day(first: int, steps: int, zone: str) -> NDArray[np.int64]:
    """Return in which part of a day steps are, by the clock of a zone.

    Args:
        first: The number of the first step.
        steps: How many.
        zone: Such as ``Europe/Berlin``.

    Returns:
        ``(steps,)``, from 0 on a workday, from 8 on a Saturday or Sunday.
    """
    halves = (first + np.arange(steps)) // _HALF
    known = range(first // _HALF, (first + steps - 1) // _HALF + 1)
    parts = np.array([_part(half, zone) for half in known], np.int64)
    return np.asarray(parts[halves - known.start])


@functools.lru_cache(maxsize=1 << 14)
def _part(half: int, zone: str) -> int:
    at = local(float(half * _HALF * STEP), zone)
    return at.hour * PARTS // 24 + PARTS * (at.weekday() >= _SATURDAY)
