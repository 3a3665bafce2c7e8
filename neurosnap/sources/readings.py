"""All readings of a file, each with its timestamp."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import Columns
from neurosnap.sources.wanted import Wanted

_ALL = Wanted()
_NEARLY = 0.05
"""The share of a period that clocks are off by, and of the readings that are late."""


@dataclass(frozen=True, eq=False)
class Readings:
    """The readings of a file, and the time of each tick if it is known."""

    columns: Columns
    times: Sequence[str] | None = None
    """``(T,)``, as the data have them, or in UTC; None if there are none."""
    zone: str = "UTC"
    """The time zone of the home."""
    said: Sequence[bytes] = ()
    """The numbers behind each reading, as in `wire.Observation`; empty if there are
    none, or they are not known."""
    wanted: Wanted = _ALL
    """Which sensors they are of, and how each was read."""
    every: float = 0.0
    """Seconds from row to row, where a clock made them; else 0."""

    def moment(self, tick: int) -> str:
        """Return when a tick from 1 on was; nothing, if that is not known."""
        if self.times is None or not 1 <= tick <= len(self.times):
            return ""
        return self.times[tick - 1]


def utc(seconds: float) -> str:
    """Return a moment, in seconds since 1970, as text, to the second.

    Examples:
        >>> utc(1203898814)
        '2008-02-25 00:20:14Z'
    """
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}Z"


def seconds_of(readings: Readings) -> NDArray[np.float64]:
    """Return when each reading was, seconds since 1970.

    Raises:
        InvalidValueError: They do not say when they were, or not in order.
    """
    if readings.times is None:
        raise InvalidValueError("data", "must say when each reading was", "no times")
    made = np.array([parse_time(text, "time") for text in readings.times])
    back = np.flatnonzero(np.diff(made) < 0)
    if len(back):
        text = readings.times[int(back[0]) + 1]
        raise InvalidValueError("time", "must not be before the one above it", text)
    return made


_MILLISECONDS = 1e11
"""Numbers from here on count these: in seconds it would be the year 5138."""
_LATEST = 253402214400  # the last day of the year 9999


def parse_time(text: str, name: str) -> float:
    """Return a moment in seconds since 1970; without a zone it is one of UTC.

    Raises:
        InvalidValueError: It is none; `name` says which.
    """
    try:
        number = float(text)
        found = number / 1000 if abs(number) >= _MILLISECONDS else number
    except ValueError:
        found = _parse_date(text)
    if not 0 <= found < _LATEST:
        rule = "must be seconds since 1970, or a date such as 2026-07-01 12:00:00"
        raise InvalidValueError(name, rule, text)
    return found


def is_time(text: str) -> bool:
    """Return whether a text can be read as a moment by `parse_time`."""
    try:
        parse_time(text, "time")
    except InvalidValueError:
        return False
    return True


def _parse_date(text: str) -> float:
    """Return a date in seconds since 1970; NaN if it is none."""
    try:
        moment = datetime.fromisoformat(text.strip())
        return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    except (ValueError, OverflowError):
        return math.nan


def regular_period(readings: Readings) -> float:
    """Return the seconds from one to the next, if nearly all are as far apart, or 0."""
    if readings.every or readings.times is None or len(readings.times) < 2:
        return readings.every
    try:
        gaps = np.diff(seconds_of(readings))
    except InvalidValueError:
        return 0.0
    period = float(np.median(gaps))
    near = np.abs(gaps - period) <= _NEARLY * period
    return round(period, 6) if near.mean() >= 1 - _NEARLY else 0.0
