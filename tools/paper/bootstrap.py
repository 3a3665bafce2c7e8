"""95 % intervals of ratios and medians, by drawing cases again."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Interval = tuple[float, float, float]
"""A value, and the bounds of its interval."""

_DRAWS = 1000
_SEED = 16


def ratio(above: Floats, below: Floats) -> Interval:
    """Return the sum of one over the sum of the other, cases drawn together.

    Args:
        above: ``(cases,)``.
        below: ``(cases,)``.

    Returns:
        Not a number if there is nothing below.
    """
    return score(np.column_stack([above, below]), lambda s: _over(s[..., 0], s[..., 1]))


def score(columns: Floats, of: Callable[[Floats], Floats]) -> Interval:
    """Return a function of the sums of columns.

    Args:
        columns: ``(cases, columns)``.
        of: Takes sums, ``(..., columns)``, and returns values, ``(...)``.
    """
    count = len(columns)
    if not count:
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(_SEED)
    times = rng.multinomial(count, np.full(count, 1 / count), _DRAWS)
    values = of(times @ columns)
    values = values[~np.isnan(values)]
    whole = float(of(columns.sum(0)))
    if not len(values):
        return whole, np.nan, np.nan
    low, high = np.quantile(values, (0.025, 0.975))
    return whole, float(low), float(high)


def harmonic(sums: Floats) -> Floats:
    """Return F1 of sums of right ones, of those named, and of those there are."""
    right, named, there = sums[..., 0], sums[..., 1], sums[..., 2]
    return _over(2 * right, named + there)


def median(values: Floats) -> Interval:
    """Return the median; values may be infinite."""
    if not len(values):
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(_SEED)
    ordered = np.sort(values)
    drawn = rng.integers(0, len(values), (_DRAWS, len(values)))
    middle = ordered[np.partition(drawn, len(values) // 2, axis=1)[:, len(values) // 2]]
    low, high = np.quantile(middle, (0.025, 0.975), method="nearest")
    return float(ordered[len(values) // 2]), float(low), float(high)


def _over(above: Floats, below: Floats) -> Floats:
    return np.asarray(np.divide(above, np.where(below > 0, below, np.nan)))
