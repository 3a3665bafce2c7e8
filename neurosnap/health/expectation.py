r"""How often a sensor should come on, given what the other sensors do.

A sensor comes on at a rate that is a sum of non-negative shares: of each other sensor
that came on in the same window or in the windows just before, of the time of day, and
one of its own:

.. math:: P(\text{on in a window}) = 1 - e^{-\lambda}, \quad \lambda = \sum_f x_f w_f

The weights are those of largest likelihood with a prior towards zero, found by
expectation and maximisation. Windows are ten minutes, one hour and four hours: what
belongs together within minutes, within a task, and within a part of the day.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.ten_minute_steps import DAY, PARTS

Floats = NDArray[np.float64]
WINDOWS = (1, 6, 24)
"""In steps."""
BEFORE = 2
"""How many windows before the present one count as just before."""
REACH = (1 + BEFORE) * WINDOWS[-1]
"""How many steps the features of a step look back, with itself."""
_PRIOR = 10.0
"""Windows in which, by the prior, each feature was there and the sensor was not on."""
_ROUNDS = 25
_FOLDS = 4
_FOLD = DAY
"""Steps of the stretches that are left out in turn: whole days. With parts of a day as
many as the folds, each would leave out the same hours of all days, and know nothing of
them."""


def features(
    active: NDArray[np.bool_],
    parts: NDArray[np.int64],
    window: int | NDArray[np.int64],
    now: NDArray[np.int64],
) -> Floats:
    """Return the features of steps, by windows that end with each.

    Args:
        active: ``(steps, sensors)``, whether a sensor came on.
        parts: ``(rows,)``, in which part of a day each is, or of all.
        window: In steps; one for all, or ``(rows,)``.
        now: ``(rows,)``, places of steps.

    Returns:
        ``(rows, 2 sensors + 25)``, zeros and ones: by the part of the day on any
        day, on a workday and on a free day.
    """
    steps, sensors = active.shape
    sums = np.zeros((steps + 1, sensors), np.int32)
    np.cumsum(active, axis=0, out=sums[1:])
    middle = np.maximum(now + 1 - window, 0)
    past = np.maximum(now + 1 - (1 + BEFORE) * window, 0)
    made = np.zeros((len(now), width(sensors)))
    made[:, :sensors] = sums[now + 1] > sums[middle]
    made[:, sensors : 2 * sensors] = sums[middle] > sums[past]
    rows = np.arange(len(now))
    made[rows, 2 * sensors + parts % PARTS] = 1
    made[rows, 2 * sensors + PARTS + parts] = 1
    made[:, -1] = 1
    return made


def width(sensors: int) -> int:
    """Return how many features there are for so many sensors."""
    return 2 * sensors + 3 * PARTS + 1


def fitted(inputs: Floats, on: NDArray[np.bool_], counted: NDArray[np.bool_]) -> Floats:
    """Return the weights of a sensor.

    Args:
        inputs: ``(windows, features)``, with the sensor's own features zero.
        on: ``(windows,)``, whether it came on.
        counted: ``(windows,)``, which windows to learn from.

    Returns:
        ``(features,)``, 0 or more. O(windows on × features) a round.
    """
    seen = inputs[counted].sum(0) + _PRIOR
    hits = inputs[counted & on]
    share = len(hits) / max(1, int(counted.sum()))
    weights = np.full(inputs.shape[1], share / max(1.0, float(inputs.sum(1).mean())))
    if not len(hits):
        return np.zeros(inputs.shape[1])
    for _ in range(_ROUNDS):
        rate = np.maximum(hits @ weights, 1e-12)
        weights *= (1 / -np.expm1(-rate)) @ hits / seen
    return weights


def learned(
    active: NDArray[np.bool_], valid: NDArray[np.bool_], parts: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Return the weights of all sensors, and what was expected of them in the past.

    What was expected in a stretch comes from weights that were learned without it.

    Args:
        active: ``(steps, sensors)``, whether a sensor came on.
        valid: ``(steps, sensors)``, whether a reading is to be learned from.
        parts: ``(steps,)``, in which part of a day each is.

    Returns:
        The weights, ``(windows, features, sensors)``, and the rates a window,
        ``(windows, steps, sensors)``.
    """
    steps, sensors = active.shape
    weights = np.zeros((len(WINDOWS), width(sensors), sensors))
    rates = np.zeros((len(WINDOWS), steps, sensors))
    fold = np.arange(steps) // _FOLD % _FOLDS
    for number, window in enumerate(WINDOWS):
        inputs = features(active & valid, parts, window, np.arange(steps))
        took = np.arange(window - 1, steps, window)
        thin = inputs[took]
        for sensor in range(sensors):
            own = [sensor, sensors + sensor]
            kept = thin[:, own].copy()
            thin[:, own] = 0
            good = valid[took, sensor]
            on = kept[:, 0] > 0
            found = fitted(thin, on, good)
            for left_out in range(_FOLDS):
                part = fitted(thin, on, good & (fold[took] != left_out))
                part[own] = 0
                at = fold == left_out
                rates[number, at, sensor] = inputs[at] @ part
            found[own] = 0
            weights[number, :, sensor] = found
            thin[:, own] = kept
    return weights, rates
