"""Rules for learning thresholds: at most a quarter, and symmetric."""

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.archive import Arrays, entry

AUTO: Final = "auto"
"""Instead of a threshold: each pair chooses its own."""


def is_auto(threshold: ArrayLike | None) -> bool:
    """Return whether thresholds are to choose themselves."""
    text = isinstance(threshold, str) or (
        isinstance(threshold, np.ndarray) and threshold.dtype.kind == "U"
    )
    return text and str(threshold) == AUTO


def checked_threshold(threshold: ArrayLike, count: int) -> NDArray[np.float64]:
    """Return a threshold as a 0-d or ``(N, N)`` array of its own.

    Args:
        threshold: One number, or one a pair of sensors.
        count: ``N``.

    Raises:
        ShapeError: It has another shape.
        InvalidValueError: It is not in (0, 1/4], or not symmetric.
    """
    try:
        array = np.array(threshold, np.float64)
    except (TypeError, ValueError) as error:
        rule = 'must be a number, an array of numbers, or "auto"'
        raise InvalidValueError("threshold", rule, threshold) from error
    if array.ndim and array.shape != (count, count):
        raise ShapeError("threshold", f"must be ({count}, {count})", array.shape)
    # Written so that NaN is out of range.
    wrong = ~((array > 0) & (array <= 0.25))
    if wrong.any():
        value = array[wrong][0].item()
        raise InvalidValueError("threshold", "must be in (0, 0.25]", value)
    if array.ndim and (array != array.T).any():
        i, j = (int(k) for k in np.argwhere(array != array.T)[0])
        value = (array[i, j].item(), array[j, i].item())
        rule = f"must be symmetric (at {i}, {j})"
        raise InvalidValueError("threshold", rule, value)
    return array


def by_pair(threshold: NDArray[np.float64], pairs: range) -> NDArray[np.float64]:
    """Return a checked threshold as the kernels want it.

    Args:
        threshold: One number, or one a pair of sensors.
        pairs: Those it is wanted of.

    Returns:
        ``(1,)`` if it is one number; one a pair and a last one of no meaning
        otherwise, so that one pair's is not taken for everybody's.
    """
    if threshold.ndim == 0:
        return threshold.reshape(1)
    every = threshold[np.tril_indices(len(threshold), -1)]
    return np.append(every[pairs.start : pairs.stop], 0.25)


def saved_threshold(arrays: Arrays, count: int) -> NDArray[np.float64]:
    """Return the threshold of a saved snapshot of `count` sensors.

    Raises:
        ValueError: It is not there, or has another shape or type.
    """
    scalar = arrays.get("threshold", np.empty(())).ndim == 0
    return entry(arrays, "threshold", () if scalar else (count, count), np.float64)
