"""Tail probabilities: how often a healthy sensor shows evidence of a given strength.

Evidence rises from zero, reaches a peak and falls back: an excursion. The larger half
of the peaks of the past is taken to be exponential above the median, with unknown mean.
The predictive distribution of the next peak is then a Lomax distribution, whose tail is
the heavier the fewer peaks were seen: nothing is alarming before enough was seen.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
RATE, START, MEAN, SHAPE = range(4)
"""The columns of a tail: peaks a week above its start, the start, the mean above it,
and the number of peaks that tell so."""
_WHOLE = 5
"""With fewer peaks all of them are used."""


def tail_of(peaks: Floats, weeks: float, mean: float, weight: float = 1) -> Floats:
    """Return the tail of peaks that were seen, ``(4,)``: rate, start, mean, shape.

    Args:
        peaks: ``(n,)``, in any order, above zero.
        weeks: In how much time.
        mean: What to expect above the start if there were no peaks. What is found is
            never below it: a tail lighter than theory gives is not believed.
        weight: How many peaks that is worth.
    """
    count = len(peaks)
    upper = min(count, max(_WHOLE, (count + 1) // 2))
    high = np.sort(peaks)
    start = high[count - upper - 1] if upper < count else 0.0
    total = float((high[count - upper :] - start).sum()) + weight * mean
    shape = upper + weight
    return np.array([(upper + 0.5) / weeks, start, max(mean, total / shape), shape])


def weekly(tails: Floats, evidence: Floats) -> Floats:
    """Return how often a week evidence goes that far, by tails.

    Args:
        tails: ``(..., 4)``.
        evidence: ``(...)``, 0 or more.
    """
    above = np.maximum(evidence - tails[..., START], 0.0)
    scale = tails[..., SHAPE] * tails[..., MEAN]
    with np.errstate(over="ignore"):
        return np.asarray(
            tails[..., RATE] * (1.0 + above / scale) ** -tails[..., SHAPE]
        )
