"""Worlds in the plane: points of a grid, moves between them, threshold sensors.

A kind of such a world differs only in which points it has; places are those points
numbered row by row, from the lowest y up, and in a row from the lowest x up.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .line import thresholds
from .places import World, frozen

_STEPS = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}


class PlaneWorld(World):
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
