"""The topics and texts that a run publishes under.

Below the prefix, everything retained:

========================  ==========================================================
``status``                ``online`` or ``offline``
``world/status``          the same, of who reads the sensors
``sensor/<slug>``         what is believed of the sensor: ``ON``, ``OFF``, ``unknown``
``predictions``           ``{"door": "ON"}``: what is believed of sensors unread
``decision``              ``{"action": "push", "why": "..."}``
``anomaly``               ``{"now": "ON", "last": {...}}``: whether there is one, and
                          the latest
``progress``              ``{"ticks": 89, "implications": 12, "read": 9, "of": 14}``:
                          how far learning is; of the sensors, how many were read at
                          the last tick
``learning``              ``ON``, or ``OFF`` while it is paused
``learning/set``          to be published to: ``ON`` or ``OFF``
``health/<slug>``         ``{"now": "ON", "last": "hall: silent since ..."}``:
                          whether the sensor seems broken, and its latest alarm
``health``                ``{"changes": 89, "of_about": 300, "known": 9, "of":
                          14}``: how much is known of the sensors' habits
========================  ==========================================================

Nothing but ``progress`` holds the tick, so that what stays the same need not be
published again; and that is published once its ticks are a hundredth more.
"""

import re
from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import ShapeError

_OTHER = re.compile(r"[^A-Za-z0-9_-]+")

ON, OFF = b"ON", b"OFF"
WORDS = (b"unknown", ON, OFF)


class Topics:
    """The topics of one run.

    Args:
        prefix: What they start with.
        sensors: The sensors' names.
    """

    def __init__(self, prefix: str, sensors: Sequence[str]) -> None:
        self.status = f"{prefix}/status"
        self.world = f"{prefix}/world/status"
        self.predictions = f"{prefix}/predictions"
        self.decision = f"{prefix}/decision"
        self.anomaly = f"{prefix}/anomaly"
        self.progress = f"{prefix}/progress"
        self.learning = f"{prefix}/learning"
        self.learning_set = f"{prefix}/learning/set"
        self.slugs = slugs(sensors)
        """The sensors' names, in order, as they stand in topics."""
        self.sensors = tuple(f"{prefix}/sensor/{slug}" for slug in self.slugs)
        """What each sensor's topic is."""
        self.known = f"{prefix}/health"
        self.health = tuple(f"{prefix}/health/{slug}" for slug in self.slugs)
        """The topic of each sensor's health."""


def slugs(names: Sequence[str]) -> tuple[str, ...]:
    """Return names fit for topics and for Home Assistant's ids, all different.

    Letters, digits, ``_`` and ``-`` stay, anything else becomes ``_``; where that makes
    two the same, or nothing is left of one, its place is added.

    Example:
        >>> slugs(["door", "hall/door", "hall door", "é"])
        ('door', 'hall_door', 'hall_door_2', '_3')
    """
    taken: set[str] = set()
    given: list[str] = []
    for place, name in enumerate(names):
        slug = _OTHER.sub("_", name)
        if slug in taken or slug == "_":
            slug = f"{slug.rstrip('_')}_{place}"
        while slug in taken:  # a name that looks like one made here
            slug += "_"
        taken.add(slug)
        given.append(slug)
    return tuple(given)


def beliefs(literals: NDArray[np.bool_]) -> list[bytes]:
    """Return what a state says of every sensor.

    Args:
        literals: ``(2N,)``, coherent.

    Returns:
        One of `WORDS` a sensor; unknown where neither of its literals is in the state.
    """
    which = literals[0::2] + 2 * literals[1::2]
    return [WORDS[each] for each in which.tolist()]


def predictions(
    names: Sequence[str], literals: NDArray[np.bool_], known: NDArray[np.bool_] | None
) -> bytes:
    """Return what a state says of the sensors that were not read.

    Args:
        names: The sensors' names: N of them.
        literals: ``(2N,)``, coherent.
        known: ``(N,)``: which were read; None: all.

    Returns:
        A JSON object of names and ``ON`` or ``OFF``; of what neither was read nor is
        believed, nothing.

    Raises:
        ShapeError: `known` is not one a sensor.
    """
    if known is None:
        return b"{}"
    if known.shape != (len(names),):
        rule = f"must be ({len(names)},), one a sensor"
        raise ShapeError("known", rule, known.shape)
    unread = np.flatnonzero(~known & (literals[0::2] | literals[1::2]))
    said = {names[k]: "ON" if literals[2 * k] else "OFF" for k in unread.tolist()}
    return msgspec.json.encode(said)
