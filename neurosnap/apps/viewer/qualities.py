"""What sensors tell together: the quantities and qualities that they divide.

``row<1``, ``row<2``, ``row<3`` tell a row; ``door=locked``, ``door=open`` tell of a
door. Both are known as far as the readings leave only one value.
"""

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

_LESS = re.compile(r"([^<=]+)<(-?\d{1,9})")
_IS = re.compile(r"([^<=]+)=(.+)", re.DOTALL)

NONE = ""
"""The value of a quality of which no sensor is on, and all are known."""


class Qualities:
    """What some sensors tell of a world.

    Args:
        names: The sensors', in order.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._less: dict[str, dict[int, int]] = {}  # by quantity: sensors by bound
        self._is: dict[str, dict[str, int]] = {}  # by quality: sensors by value
        for sensor, name in enumerate(names):
            if less := _LESS.fullmatch(name):
                self._less.setdefault(less[1], {})[int(less[2])] = sensor
            elif equal := _IS.fullmatch(name):
                self._is.setdefault(equal[1], {})[equal[2]] = sensor

    def number(self, name: str, observed: NDArray[np.bool_], last: int) -> int | None:
        """Return a whole quantity; None: what was read leaves several, or none.

        Args:
            name: The quantity's.
            observed: ``(2N,)``, the literals of the sensors whose reading is known.
            last: The largest value it may have.
        """
        bounds = self._less.get(name, {})
        below = [bound for bound, k in bounds.items() if observed[2 * k]]
        from_on = [bound for bound, k in bounds.items() if observed[2 * k + 1]]
        least = max(from_on, default=min(bounds, default=1) - 1)
        most = min(below, default=last + 1) - 1
        return least if least == most else None

    def values(self, observed: NDArray[np.bool_]) -> Mapping[str, str]:
        """Return the qualities that are known, by name; `NONE`: none of its values."""
        found = {}
        for name, sensors in self._is.items():
            on = [value for value, k in sensors.items() if observed[2 * k]]
            off = sum(bool(observed[2 * k + 1]) for k in sensors.values())
            if len(on) == 1:
                found[name] = on[0]
            elif off == len(sensors):
                found[name] = NONE
        return found
