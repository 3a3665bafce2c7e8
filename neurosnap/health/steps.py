"""Readings in steps of ten minutes: how often each sensor came on, how long it was on.

Events count, and not levels: a door that is open for weeks says nothing all the while.
"""

import numpy as np
from numpy.typing import NDArray

STEP = 600
"""Seconds of a step."""
WEEK = 7 * 86400 // STEP
"""Steps of a week."""
DAY = 86400 // STEP


class Steps:
    """What happened in steps that are over, oldest first.

    Args:
        came_on: ``(steps, sensors)``, how often a sensor came on.
        longest: ``(steps, sensors)``, seconds: of all the times on that end in a step
            or outlast it, how long the longest had lasted by its end.
        first: The number of the first step, in steps since 1970.
    """

    def __init__(
        self, came_on: NDArray[np.int32], longest: NDArray[np.float32], first: int
    ) -> None:
        self.came_on = came_on
        self.longest = longest
        self.first = first

    def __len__(self) -> int:
        return len(self.came_on)
