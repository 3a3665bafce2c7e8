"""A path: every sensor a threshold, all of them one chain of implications."""

from .line import steps, thresholds
from .places import World, check_at_least


class PathWorld(World):
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

    Start:
        A place drawn uniformly.

    Reward:
        Always 0.0.

    End:
        Never.

    Info:
        ``place``: the number of the place.

    Arguments:
        places: How many places, at least 2; one more than there are sensors. 21.
        wait: Whether there is a last action that stays. False.

    References:
        [GK] setting (a); example:N-path and example:path with motion.

    Versions:
        v0: the first.
    """

    def __init__(self, places: int = 21, wait: bool = False) -> None:
        check_at_least("places", 2, places)
        super().__init__(
            sensors=tuple(f"below_{k}" for k in range(1, places)),
            actions=("forward", "back"),
            moves=steps(places),
            fields=thresholds(places),
            wait=wait,
        )
