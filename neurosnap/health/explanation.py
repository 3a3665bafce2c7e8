"""Why a sensor is in alarm: what was expected of it, and who says so most."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.alarm import Companion
from neurosnap.health.expectation import WINDOWS, features
from neurosnap.health.learning import LearnedRates
from neurosnap.health.steps import Steps

_HOUR = WINDOWS[1]
_LEAST = 5
"""Hours that a companion must have been seen in."""


HARDLY = 0.05
"""The probability of coming on in a step below which hardly anything speaks for it."""


def expected_since(
    learned: LearnedRates, history: Steps, sensor: int, since: int
) -> tuple[float, int]:
    """Return in how many steps a sensor was expected to come on.

    Args:
        learned: What is expected by.
        history: Up to now.
        sensor: Its number.
        since: A step of the history; steps before it are left out.

    Returns:
        How many, and in how many it came on although hardly anything spoke for it.
    """
    rows = np.arange(max(0, since - history.first), len(history))
    inputs = features(history.came_on > 0, history.first, WINDOWS[0], rows)
    rates = inputs @ learned.weights[0][:, sensor]
    likely = -np.expm1(-rates)
    came_on = history.came_on[rows, sensor] > 0
    return float(likely.sum()), int((came_on & (likely < HARDLY)).sum())


def companion(
    names: list[str],
    history: Steps,
    valid: NDArray[np.bool_],
    sensor: int,
    since: int,
) -> Companion | None:
    """Return who makes a silence most surprising: it came on without the sensor.

    Of each other sensor the hours are counted in which it came on, and in which of them
    the sensor did, too, before and since. It is the one with the most hours since, each
    weighed by how seldom it was alone before.

    Args:
        names: Of the sensors.
        history: Up to now.
        valid: ``(steps, sensors)``, what was learned from.
        sensor: The silent one.
        since: The step from which on it is silent.
    """
    at = max(0, since - history.first)
    before = _hours((history.came_on * valid)[:at] > 0)
    later = _hours(history.came_on[at:] > 0)
    hours = before.sum(0)
    together = before[before[:, sensor]].sum(0)
    alone = later.sum(0)
    share = (together + 0.5) / (hours + 1)
    weight = -np.log1p(-share) * alone * (hours >= _LEAST)
    weight[sensor] = 0
    best = int(weight.argmax())
    if weight[best] <= 0:
        return None
    return Companion(
        names[best], int(together[best]), int(hours[best]), int(alone[best])
    )


def _hours(active: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return in which hours, from the end backwards, sensors came on."""
    rest = len(active) % _HOUR
    whole = active[rest:]
    return np.asarray(whole.reshape(-1, _HOUR, active.shape[1]).any(1))
