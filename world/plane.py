"""Worlds in the plane: points of a grid, moves between them, threshold sensors.

A kind of such a world differs only in which points it has; places are those points
numbered row by row, from the lowest y up, and in a row from the lowest x up.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

from .line import thresholds
from .places import PlacesWorld, check_at_least, frozen, is_whole

_STEPS = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}


class PlaneWorld(PlacesWorld):
    """A walk on some points of a grid, sensed by thresholds along both axes.

    Args:
        free: ``(height, width)``; true at ``[y, x]`` iff the point is a place.
        wait: Whether to add a last action that stays.

    Attributes:
        coordinates: ``(places, 2)``; x and y of each place; read-only.

    Raises:
        InvalidValueError: `wait` is neither true nor false.
    """

    def __init__(self, free: NDArray[np.bool_], wait: bool) -> None:
        height, width = free.shape
        y, x = np.nonzero(free)
        here = np.arange(len(x))
        number = np.full(free.shape, -1)
        number[y, x] = here

        def step(right: int, up: int) -> NDArray[np.intp]:
            to_x = np.clip(x + right, 0, width - 1)
            to_y = np.clip(y + up, 0, height - 1)
            there = number[to_y, to_x]
            return np.where(there < 0, here, there)

        self.coordinates: NDArray[np.intp] = frozen(np.stack([x, y], axis=1))
        super().__init__(
            sensors=(
                *(f"x_below_{k}" for k in range(1, width)),
                *(f"y_below_{k}" for k in range(1, height)),
            ),
            actions=tuple(_STEPS),
            moves=np.stack([step(*change) for change in _STEPS.values()]),
            fields=np.concatenate([thresholds(width)[:, x], thresholds(height)[:, y]]),
            wait=wait,
        )

    def _info(self, place: int) -> dict[str, Any]:
        x, y = self.coordinates[place].tolist()
        return {"place": place, "x": x, "y": y}


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

    Info:
        ``x``, ``y``: the coordinates; ``place``: ``x + width·y``, the place's column in
        `fields` and its row in `coordinates`.

    Arguments:
        width: How many values x takes, at least 2. 11.
        height: How many values y takes, at least 2. 11.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (c); example:direct sum.
    """

    def __init__(self, width: int = 11, height: int = 11, wait: bool = False) -> None:
        check_at_least("width", 2, width)
        check_at_least("height", 2, height)
        super().__init__(np.ones((height, width), dtype=np.bool_), wait)


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

    Info:
        ``x``, ``y``: the coordinates; ``place``: the place's column in `fields` and its
        row in `coordinates`; places are numbered as in `GridWorld` without the hole.

    Arguments:
        width: How many values x takes, at least 3. 11.
        height: How many values y takes, at least 3. 11.
        hole: ``(x, y)``, the point removed, on no edge of the grid. If None, the
            middle, ``(width // 2, height // 2)``.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] "Example: A Punctured Grid", with the sensors of setting (c).
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
