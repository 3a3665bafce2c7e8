"""True implications of a world's sensors.

Literal a implies b iff a's field lies within b's. Literals are numbered as everywhere
in neurosnap: sensor ``s`` is ``2s``, its complement ``2s + 1``. A sensor that is never
on has the empty field, so it implies everything and its complement is implied by
everything; two sensors with the same field imply each other. Nothing is left out for
being degenerate.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def inclusions(fields: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which literals' fields lie within which, ([GK] eqn:true dir matrix).

    Args:
        fields: ``(sensors, places)``; where each sensor is on.

    Returns:
        ``(2 sensors, 2 sensors)``; true at ``[a, b]`` iff `a` and `b` are of different
        sensors and the field of `a` is a subset of the field of `b`.
    """
    sensors, places = fields.shape
    literals = np.stack([fields, ~fields], axis=1).reshape(2 * sensors, places)
    # Counts of places in a and not in b, by a matrix product of whole numbers: a count
    # of at least one cannot round to zero, so single precision decides exactly.
    counts = literals.astype(np.float32) @ (~literals).astype(np.float32).T
    sensor = np.arange(2 * sensors) >> 1
    included: NDArray[np.bool_] = (counts == 0) & (sensor[:, np.newaxis] != sensor)
    return included


def implications(
    sensors: Sequence[str], fields: NDArray[np.bool_]
) -> list[tuple[str, str]]:
    """Return every true implication between literals of different sensors, by name.

    Args:
        sensors: The sensors' names.
        fields: ``(sensors, places)``; where each is on.

    Returns:
        Pairs ``(a, b)`` with the field of `a` within the field of `b`, in the order of
        the literals' numbers; ``name*`` is the complement of ``name``.
    """
    names = [literal for name in sensors for literal in (name, f"{name}*")]
    return [(names[a], names[b]) for a, b in np.argwhere(inclusions(fields))]
