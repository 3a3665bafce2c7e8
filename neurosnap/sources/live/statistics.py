"""Counts of a live source's readings: received, used in a tick, rejected, lost.

What is rejected or lost is named in the log without flooding it.
"""

import logging
from collections.abc import Callable, Mapping
from typing import Literal, Self, TypeAlias

import msgspec

from neurosnap import wire
from neurosnap.sensorium import visible
from neurosnap.system.local_time import local


class Statistics(msgspec.Struct, frozen=True):
    """The counts of one run's source, over all restarts."""

    received: wire.Received
    """What was received, by what it became."""
    after: int = 0
    """Readings since the last row: they changed nothing, or the run had its ticks."""

    @classmethod
    def of(cls, received: wire.Received, in_rows: int, deaf: bool) -> Self:
        """Return the counts, where rows show so many, and now it listens or is deaf."""
        outages, after = received.outages + deaf, received.shown - in_rows
        shown = msgspec.structs.replace(received, shown=in_rows, outages=outages)
        return cls(shown, after)


_FATES = {
    "shown": "in ticks",
    "kept": "kept for a resumed run",
    "after": "after the last tick",
    "late": "late",
    "refused": "refused",
    "dropped": "dropped, since too many waited",
}


def received_line(counts: Mapping[str, int]) -> str:
    """Return the line about received readings: how many were shown, late or refused.

    Examples:
        >>> received_line({"shown": 706, "dropped": 0, "kept": 447})
        'readings: 1,153 received = 706 in ticks + 447 kept for a resumed run'
    """
    found = {say: counts.get(kind, 0) for kind, say in _FATES.items()}
    parts = " + ".join(f"{count:,} {say}" for say, count in found.items() if count)
    return f"readings: {sum(found.values()):,} received = {parts or '0'}"


def outage_line(outage: wire.Outage, zone: str) -> str:
    """Return the line about an outage: when it was, by the clock of a zone, and why."""
    since, until = (
        local(at, zone).isoformat(" ", "milliseconds")
        for at in (outage.since, outage.until)
    )
    return f"did not listen from {since} to {until}: {visible(outage.why)}"


Fate: TypeAlias = Literal["shown", "late", "refused", "dropped"]
"""What becomes of a reading, as `wire.Received` counts it."""
EVERY = 1.0
"""Seconds between two lines about bad input."""
_logger = logging.getLogger(__name__)


class Refusals:
    """Logs refused and lost readings, one line a second at most; used under a lock.

    Args:
        clock: Seconds that never go back.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._next = float("-inf")
        self._untold, self._last = 0, ""

    def refuse(self, text: str) -> None:
        """Log one, as ``name: rule, got value``, unless the last line is too recent."""
        now = self._clock()
        if now < self._next:
            self._untold, self._last = self._untold + 1, text
            return
        self.flush()
        self._next = now + EVERY
        _logger.warning("%s", text)

    def flush(self) -> None:
        """Log how many were not logged since the last line, if any."""
        if self._untold:
            _logger.warning("%d more refused, the last: %s", self._untold, self._last)
            self._untold = 0
