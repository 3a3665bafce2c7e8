"""A path whose sensors have random fields."""

import numpy as np

from .line import steps
from .places import World, check_at_least, frozen


class RandomFieldsWorld(World):
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

    Reward:
        Always 0.0.

    End:
        Never.

    Info:
        ``place``: the number of the place.

    Arguments:
        places: How many places, at least 2. 21.
        sensors: How many sensors, at least 1. 20.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (d).

    Versions:
        v0: the first.
    """

    def __init__(self, places: int = 21, sensors: int = 20, wait: bool = False) -> None:
        check_at_least("places", 2, places)
        check_at_least("sensors", 1, sensors)
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
