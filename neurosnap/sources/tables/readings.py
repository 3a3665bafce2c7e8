"""Readings that are there as a whole, and when they were."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from neurosnap.poc.learning.columns import Columns


@dataclass(frozen=True, eq=False)
class Readings:
    """Columns, and the moment of each tick where the data say it."""

    columns: Columns
    times: Sequence[str] | None = None
    """``(T,)``, as the data have them, or in UTC; None: there are none."""

    def moment(self, tick: int) -> str:
        """Return when a tick from 1 on was; nothing, if that is not known."""
        if self.times is None or not 1 <= tick <= len(self.times):
            return ""
        return self.times[tick - 1]


def utc(seconds: float) -> str:
    """Return a moment as text, to the second.

    Args:
        seconds: Since 1970.

    Example:
        >>> utc(1203898814)
        '2008-02-25 00:20:14Z'
    """
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}Z"
