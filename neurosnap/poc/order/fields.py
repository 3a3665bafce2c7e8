"""The field of each sensor (the points where it is on), and which contain others."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sensorium import Sensorium


def as_fields(
    rows: Iterable[ArrayLike], names: Iterable[str] | Sensorium | None
) -> tuple[NDArray[np.bool_], Sensorium]:
    """Return fields as an array, and the names of their sensors.

    Args:
        rows: One field a sensor, ``(points,)`` bits each.
        names: The sensors; ``s0``, ``s1``, and so on without them.

    Returns:
        ``(N, points)`` bool, a new array, and the sensorium.

    Raises:
        ShapeError: Fields have unequal lengths, there is no point, or not one name a
            field.
        InvalidValueError: An entry is not 0 or 1, or a name is malformed.
    """
    if isinstance(rows, str):
        raise InvalidValueError("fields", "must be one row of bits a sensor", rows)
    listed = [np.asarray(row) for row in rows]
    if isinstance(names, Sensorium):
        sensorium = names
    else:
        sensorium = Sensorium.of(len(listed)) if names is None else Sensorium(names)
    if len(sensorium) != len(listed):
        rule = f"must be {len(sensorium)}, one a sensor"
        raise ShapeError("fields", rule, len(listed))
    points = len(listed[0]) if listed and listed[0].ndim == 1 else 0
    fields = np.zeros((len(listed), points), np.bool_)
    for sensor, row in enumerate(listed):
        name = f"field of {sensorium.name(2 * sensor)}"
        if row.shape != fields.shape[1:]:
            rule = f"must have {points} points as the first has"
            raise ShapeError(name, rule, row.shape)
        if row.dtype.kind not in "biuf" or not np.isin(row, (0, 1)).all():
            raise InvalidValueError(name, "must be made of bits, 0 or 1", row.tolist())
        fields[sensor] = row == 1
    if listed and not points:
        raise ShapeError("fields", "must be over at least one point", fields.shape)
    return fields, sensorium


def inclusions(fields: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which fields, of ``(N, points)`` bool, are in which others.

    Returns:
        ``(2N, 2N)`` bool; true at ``[a, b]`` iff the field of `a` is in that of `b`.

    Examples:
        >>> inclusions(np.array([[True, False], [True, True]]))[0, 2]
        np.True_
    """
    sensors, points = fields.shape
    literals = np.stack([fields, ~fields], axis=1).reshape(2 * sensors, points)
    # Sums of zeros and ones: at least one cannot round to none.
    outside = literals.astype(np.float32) @ (~literals).astype(np.float32).T
    return np.asarray(outside == 0, np.bool_)
