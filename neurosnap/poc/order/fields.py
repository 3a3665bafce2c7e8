"""The field of each sensor (the points where it is on), and which contain others."""

import numpy as np
from numpy.typing import NDArray


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
