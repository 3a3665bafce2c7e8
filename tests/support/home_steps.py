"""The ten-minute steps that a home's sensors make, from when each was on."""

from collections.abc import Iterable

import numpy as np

from neurosnap.health.ten_minute_steps import STEP, Steps


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
