"""A cycle: every sensor a beacon; far beacons exclude each other."""

import numpy as np

from .places import World, check_at_least


class CycleWorld(World):
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

    Start:
        A place drawn uniformly.

    Reward:
        Always 0.0.

    End:
        Never.

    Info:
        ``place``: the number of the place.

    Arguments:
        places: How many places and beacons, at least 4, so that no beacon is always
            on. 20, and 24 as ``neurosnap/Rail-v0``.
        wait: Whether there is a last action that stays. False, and True as
            ``neurosnap/Rail-v0``.

    References:
        [GK] setting (b); example:N-cycle; "Example: Agent on a Circular Rail".

    Versions:
        v0: the first.
    """

    def __init__(self, places: int = 20, wait: bool = False) -> None:
        check_at_least("places", 4, places)
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
