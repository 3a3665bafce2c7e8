"""Worlds on a line or a ring of places, and the moves in them."""

import numpy as np
from numpy.typing import NDArray

from .places import PlacesWorld, check_at_least, check_fits, frozen


class PathWorld(PlacesWorld):
    """Setting (a): a walk along a path, sensed by thresholds.

    Description:
        Places 0 to ``places - 1`` in a line. The sensors are nested, so what there is
        to learn is one chain ``below_1 → below_2 → …``, as high as there are sensors.

    Sensors:
        ``below_1`` to ``below_<places - 1>``; ``below_k`` is on iff the place is below
        `k`. Observations are ``MultiBinary(places - 1)``.

    Actions:
        0 steps ``forward``, to the next higher place; 1 steps ``back``. A step off an
        end stays there.

    Arguments:
        places: How many places, at least 2; one more than there are sensors. 21.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (a); example:N-path and example:path with motion.
    """

    def __init__(self, places: int = 21, wait: bool = False) -> None:
        check_at_least("places", 2, places)
        check_fits("places", places, places, 120 * places)
        super().__init__(
            sensors=tuple(f"below_{k}" for k in range(1, places)),
            actions=("forward", "back"),
            moves=steps(places),
            fields=thresholds(places),
            wait=wait,
        )


class CycleWorld(PlacesWorld):
    """Setting (b), the circular rail: a walk around a cycle, sensed by beacons.

    Description:
        Places 0 to ``places - 1`` in a ring, a beacon at each. No beacon implies
        another; what there is to learn is which are never on together:
        ``near_0 → near_3*`` and the like. The order stays low however many sensors
        there are, and the space is not contractible.

    Sensors:
        ``near_0`` to ``near_<places - 1>``; ``near_i`` is on at `i` and at the places
        next to it. Observations are ``MultiBinary(places)``.

    Actions:
        0 steps ``forward``, which is clockwise, to the next higher place; 1 steps
        ``back``. Both go around.

    Arguments:
        places: How many places and beacons, at least 4, so that no beacon is always
            on. 20, and 24 as ``neurosnap/Rail-v0``.
        wait: Whether there is a last action that stays. False, and True as
            ``neurosnap/Rail-v0``.

    References:
        [GK] setting (b); example:N-cycle; "Example: Agent on a Circular Rail".
    """

    def __init__(self, places: int = 20, wait: bool = False) -> None:
        check_at_least("places", 4, places)
        check_fits("places", places, places, 3 * places**2)
        here = np.arange(places)
        clockwise = (here + 1) % places
        counter_clockwise = (here - 1) % places
        at = np.eye(places, dtype=np.bool_)
        super().__init__(
            sensors=tuple(f"near_{i}" for i in range(places)),
            actions=("forward", "back"),
            moves=np.stack([clockwise, counter_clockwise]),
            fields=at | at[clockwise] | at[counter_clockwise],
            wait=wait,
        )


class RandomFieldsWorld(PlacesWorld):
    """Setting (d): a walk along a path, sensed by random subsets of its places.

    Description:
        Places 0 to ``places - 1`` in a line, as in `PathWorld`. Every sensor's field is
        a subset of the places drawn uniformly from all subsets. By chance a field may
        be empty, full or equal to another; the implications that follow are counted
        as true.

    Sensors:
        ``field_0`` to ``field_<sensors - 1>``. Observations are
        ``MultiBinary(sensors)``.

    Actions:
        0 steps ``forward``, to the next higher place; 1 steps ``back``. A step off an
        end stays there.

    Start:
        The fields are drawn by every reset with a seed, and by the first reset if it
        has none; a later reset without a seed keeps them. Then a place is drawn
        uniformly. Before the first reset there are no fields, and asking for them
        raises `gymnasium.error.ResetNeeded`.

    Arguments:
        places: How many places, at least 2. 21.
        sensors: How many sensors, at least 1. 20.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (d).
    """

    def __init__(self, places: int = 21, sensors: int = 20, wait: bool = False) -> None:
        check_at_least("places", 2, places)
        check_at_least("sensors", 1, sensors)
        check_fits("sensors", sensors, sensors, 3 * sensors * places)
        super().__init__(
            sensors=tuple(f"field_{i}" for i in range(sensors)),
            actions=("forward", "back"),
            moves=steps(places),
            fields=None,
            wait=wait,
        )

    def _begin(self, *, seeded: bool) -> None:
        if seeded or self._fields is None:
            shape = (len(self.sensors), self.moves.shape[1])
            drawn = self.np_random.integers(2, size=shape, dtype=np.int8)
            self._fields = frozen(drawn == 1)


def steps(places: int) -> NDArray[np.intp]:
    """Return the moves ``(2, places)``: forward, then back; both stop at the ends."""
    here = np.arange(places)
    return np.stack([np.minimum(here + 1, places - 1), np.maximum(here - 1, 0)])


def thresholds(places: int) -> NDArray[np.bool_]:
    """Return the fields ``(places - 1, places)`` of the paper's ``a_1 < a_2 < …``.

    Row ``k - 1`` is ``a_k``: on iff the position is below `k`.
    """
    # Windows into one row: a path of 100,000 places takes as many bytes, not 10 GB.
    row = np.arange(2 * places) < places
    windows = np.lib.stride_tricks.sliding_window_view(row, places)
    return windows[places - 1 : 0 : -1]
