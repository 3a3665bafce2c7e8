"""A grid with a hole that no sensor sees."""

import numpy as np

from neurosnap.errors import InvalidValueError

from .places import check_at_least, is_whole
from .plane import PlaneWorld


class PuncturedGridWorld(PlaneWorld):
    """The punctured grid: setting (c) with one interior point removed.

    Description:
        Places ``(x, y)`` with ``0 ≤ x < width`` and ``0 ≤ y < height``, the hole left
        out. Every meeting of two fields keeps a corner of the grid, so what there is to
        learn is the two chains of the whole grid, whose model space has no hole: an
        agent that plans in it is bound to try the hole where that lies on a shortest
        path, and stays where it is.

    Sensors:
        ``x_below_1`` to ``x_below_<width - 1>``, then ``y_below_1`` to
        ``y_below_<height - 1>``; ``x_below_k`` is on iff x is below `k`. Observations
        are ``MultiBinary(width + height - 2)``.

    Actions:
        0 steps ``up`` (y + 1), 1 ``down`` (y - 1), 2 ``left`` (x - 1), 3 ``right``
        (x + 1). A step into a wall or onto the hole stays.

    Start:
        A place drawn uniformly.

    Reward:
        Always 0.0.

    End:
        Never.

    Info:
        ``x``, ``y``: the coordinates; ``place``: the place's column in `fields` and its
        row in `coordinates`; places are numbered as in `GridWorld` without the hole.

    Arguments:
        width: How many values x takes, at least 3. 11.
        height: How many values y takes, at least 3. 11.
        hole: ``(x, y)``, the point removed, on no edge of the grid. None: the middle,
            ``(width // 2, height // 2)``.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] "Example: A Punctured Grid", with the sensors of setting (c).

    Versions:
        v0: the first.
    """

    def __init__(
        self,
        width: int = 11,
        height: int = 11,
        hole: tuple[int, int] | None = None,
        wait: bool = False,
    ) -> None:
        check_at_least("width", 3, width)
        check_at_least("height", 3, height)
        if hole is None:
            hole = (width // 2, height // 2)
        x, y = _interior(hole, width, height)
        free = np.ones((height, width), dtype=np.bool_)
        free[y, x] = False
        super().__init__(free, wait)


def _interior(hole: tuple[int, int], width: int, height: int) -> tuple[int, int]:
    """Return the hole, if it is an interior point.

    Raises:
        InvalidValueError: It is none.
    """
    match hole:
        case (x, y) if (
            is_whole(x) and is_whole(y) and 0 < x < width - 1 and 0 < y < height - 1
        ):
            return x, y
    rule = f"must be (x, y) with x in 1..{width - 2} and y in 1..{height - 2}"
    raise InvalidValueError("hole", rule, hole)
