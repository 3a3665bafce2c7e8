"""A budget of alarms: how many a home may raise while nothing is wrong.

It is shared among the sensors that are known and the kinds of evidence. When a home
has raised more alarms lately than its budget, each share shrinks in proportion: a home
whose habits change more than they did while they were learned would otherwise exceed it
for ever (after Gibbs and Candès, "Adaptive conformal inference under distribution
shift", 2021).
"""

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.health.ten_minute_steps import WEEK

_SHARES = np.array([0.5, 0.1, 0.2, 0.1, 0.1])
"""Of each kind of evidence; silence is how most sensors end."""
_WEEKS = {"hour": 1 / 168, "day": 1 / 7, "week": 1.0, "month": 365.25 / 84}
_FORM: Final = re.compile(r"(\d+(?:\.\d+)?)/(hour|day|week|month)")
NEVER: Final = "never"
"""Stands for no budget: no sensor is judged."""
LOOKBACK = 4 * WEEK
"""Steps for which an alarm counts against the budget."""


def parse_budget(text: str) -> float:
    """Return alarms a week, of a number a ``hour``, ``day``, ``week`` or ``month``.

    Raises:
        InvalidValueError: It is not of that form, or zero.

    Examples:
        >>> parse_budget("2/day")
        14.0
    """
    found = _FORM.fullmatch(text.strip())
    if found is None or float(found[1]) == 0:
        rule = 'must be a number a hour, day, week or month, such as "1/week"'
        raise InvalidValueError("alarms", rule, text)
    return float(found[1]) / _WEEKS[found[2]]


def shares(weekly: float, known: int, raised: int) -> NDArray[np.float64]:
    """Return how often a week each kind of evidence of a sensor may raise an alarm.

    Args:
        weekly: The budget, alarms a week.
        known: How many sensors are known.
        raised: How many alarms were raised in the last four weeks.
    """
    excess = max(1.0, raised / (weekly * LOOKBACK / WEEK))
    return np.asarray(_SHARES * weekly / max(1, known) / excess)
