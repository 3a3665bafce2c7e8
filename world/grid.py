"""A grid, whole or with a hole: its points, moves between them, threshold sensors.

Places are its points numbered row by row, from the lowest y up, and in a row from the
lowest x up.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

from .path_and_cycle import thresholds
from .places import PlacesWorld, check_at_least, check_fits, frozen, is_whole

_STEPS = {"up": (0, 1), "down": (0, -1), "left": (-1, 0), "right": (1, 0)}


class GridWorld(PlacesWorld):
    """Setting (c): a walk on a grid, sensed by thresholds along both axes.

    Description:
        Places ``(x, y)`` with ``0 ≤ x < width`` and ``0 ≤ y < height``, a hole left out
        if there is one. What there is to learn is two chains,
        ``x_below_1 → x_below_2 → …`` and the same for y, with nothing between them: the
        direct sum of two paths. A hole changes nothing there: every meeting of two
        fields keeps a corner of the grid, so the model space has no hole. An agent that
        plans in it is bound to try the hole where that lies on a shortest path, and
        stays where it is.

    Sensors:
        ``x_below_1`` to ``x_below_<width - 1>``, then ``y_below_1`` to
        ``y_below_<height - 1>``; ``x_below_k`` is on iff x is below `k`. Observations
        are ``MultiBinary(width + height - 2)``.

    Actions:
        0 steps ``up`` (y + 1), 1 ``down`` (y - 1), 2 ``left`` (x - 1), 3 ``right``
        (x + 1). A step into a wall or onto the hole stays.

    Info:
        ``x``, ``y``: the coordinates; ``place``: the place's column in `fields` and its
        row in `coordinates`; without a hole ``x + width·y``.

    Arguments:
        width: How many values x takes, at least 2, or 3 where there is a hole. 11.
        height: How many values y takes, likewise. 11.
        hole: ``(x, y)``, a point removed, on no edge of the grid; or ``"middle"``,
            which is ``(width // 2, height // 2)``. None, and ``"middle"`` as
            ``neurosnap/PuncturedGrid-v0``.
        wait: Whether there is a last action that stays. False.

    Attributes:
        coordinates: ``(places, 2)``; x and y of each place; read-only.

    References:
        [GK] setting (c); example:direct sum; "Example: A Punctured Grid".
    """

    def __init__(
        self,
        width: int = 11,
        height: int = 11,
        hole: tuple[int, int] | Literal["middle"] | None = None,
        wait: bool = False,
    ) -> None:
        least = 2 if hole is None else 3
        check_at_least("width", least, width)
        check_at_least("height", least, height)
        sensors = width + height
        check_fits("width", width, sensors, 3 * sensors * width * height)
        number = np.zeros((height, width), np.intp)
        if hole == "middle":
            hole = (width // 2, height // 2)
        if hole is not None:
            at_x, at_y = _interior(hole, width, height)
            number[at_y, at_x] = -1
        y, x = np.nonzero(number == 0)
        here = np.arange(len(x))
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


def _interior(hole: object, width: int, height: int) -> tuple[int, int]:
    """Return the hole, if it is an interior point."""
    match hole:
        case (x, y) if (
            is_whole(x) and is_whole(y) and 0 < x < width - 1 and 0 < y < height - 1
        ):
            return x, y
    rule = f"must be (x, y) with x in 1..{width - 2} and y in 1..{height - 2}"
    raise InvalidValueError("hole", rule, hole)
