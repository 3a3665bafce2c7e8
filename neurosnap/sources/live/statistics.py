"""Counts of a live source: received, used, rejected, lost.

Rejected input is counted, and named in the log without flooding it.
"""

import logging
from collections.abc import Callable

import msgspec


class Statistics(msgspec.Struct, frozen=True):
    """The counts of one source, since it was made."""

    late: int
    """Readings dropped because a younger one was there."""
    ahead: int
    """Readings stamped by a clock that is ahead."""
    refused: int
    """What was no reading, or of no sensor here."""
    dropped: int
    """Whole readings that lost their tick because too many waited."""
    skipped: int
    """Ticks that were due and not given; see `Clocked`."""
    missing: int = 0
    """Readings that the journal should hold and does not, since it was damaged."""

    @property
    def losses(self) -> str:
        """What got lost or came at a wrong time, in words; empty: nothing did."""
        counts = {
            "whole readings dropped": self.dropped,
            "readings missing from the journal": self.missing,
            "late readings dropped": self.late,
            "readings from a clock that is ahead": self.ahead,
            "ticks skipped": self.skipped,
        }
        return ", ".join(f"{count} {what}" for what, count in counts.items() if count)


EVERY = 1.0
"""Seconds between two lines about bad input."""

_logger = logging.getLogger(__name__)


class Refusals:
    """Counts what is refused; logs a line a second at most. To be used under a lock.

    Args:
        clock: Seconds that never go back.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self.count = 0
        self._clock = clock
        self._next = float("-inf")
        self._untold = 0

    def refuse(self, text: str) -> None:
        """Count one, and log it unless the last line is too recent.

        Args:
            text: What it was, as ``name: rule, got value``.
        """
        self.count += 1
        now = self._clock()
        if now < self._next:
            self._untold += 1
            return
        self.flush()
        self._next = now + EVERY
        _logger.warning("%s", text)

    def flush(self) -> None:
        """Log how many were not logged since the last line, if any."""
        if self._untold:
            _logger.warning("%d more were refused and are not shown", self._untold)
            self._untold = 0
