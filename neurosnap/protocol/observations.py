"""Decodes observations: the readings, and which of them are known."""

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.sensorium import unpack


def readings(
    observation: wire.Observation | wire.Learn, count: int
) -> tuple[NDArray[np.bool_], NDArray[np.bool_] | None]:
    """Return what the sensors read, and of which of them that is known.

    Args:
        observation: Checked by `neurosnap.protocol.message_checks.check_readings`.
        count: How many sensors there are.

    Returns:
        ``(N,)`` each, the second None where all readings are known.

    Raises:
        ShapeError: It is of another number of sensors.
    """
    bits = unpack(observation.bits, count)
    return bits, unpack(observation.known, count) if observation.known else None
