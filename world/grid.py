"""A grid: thresholds along x and along y, two chains that cross everywhere."""

import numpy as np

from .places import check_at_least
from .plane import PlaneWorld


class GridWorld(PlaneWorld):
    """Setting (c): a walk on a grid, sensed by thresholds along both axes.

    Description:
        Places ``(x, y)`` with ``0 ≤ x < width`` and ``0 ≤ y < height``. What there is
        to learn is two chains, ``x_below_1 → x_below_2 → …`` and the same for y, with
        nothing between them: the direct sum of two paths.

    Sensors:
        ``x_below_1`` to ``x_below_<width - 1>``, then ``y_below_1`` to
        ``y_below_<height - 1>``; ``x_below_k`` is on iff x is below `k`. Observations
        are ``MultiBinary(width + height - 2)``.

    Actions:
        0 steps ``up`` (y + 1), 1 ``down`` (y - 1), 2 ``left`` (x - 1), 3 ``right``
        (x + 1). A step into a wall stays.

    Start:
        A place drawn uniformly.

    Reward:
        Always 0.0.

    End:
        Never.

    Info:
        ``x``, ``y``: the coordinates; ``place``: ``x + width·y``, the place's column in
        `fields` and its row in `coordinates`.

    Arguments:
        width: How many values x takes, at least 2. 11.
        height: How many values y takes, at least 2. 11.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (c); example:direct sum.

    Versions:
        v0: the first.
    """

    def __init__(self, width: int = 11, height: int = 11, wait: bool = False) -> None:
        check_at_least("width", 2, width)
        check_at_least("height", 2, height)
        super().__init__(np.ones((height, width), dtype=np.bool_), wait)
