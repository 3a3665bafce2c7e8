"""Finds which part of a swarm holds up ticks that are behind their readings.

A tick is behind if what it shows was there for longer than the source allows before the
swarm took it (`wire.Observation.due`). What counts is which part was waited for most
since then. A message ends a wait for one part. Of a recorder that takes nothing the
cells are the first to suffer, since they say most.
"""

from collections import deque

import msgspec

from neurosnap import wire

_WAITS = 256  # that count, at most
_ENDS: dict[type[wire.Message], str] = {
    wire.Observation: "world",
    wire.WaveStart: "coordinator",
    wire.Decision: "coordinator",
    wire.State: "cells",
    wire.Reached: "cells",
    wire.Recalled: "cells",
    wire.Learned: "workers",
}
"""Whom a message ends the wait for; a coordinator learns and derives."""


class Behind(msgspec.Struct, frozen=True):
    """How far a run was behind its readings at a tick, and which part held it up."""

    tick: int
    seconds: float
    """For which the oldest reading that the tick shows had waited."""
    waiting: int
    """Ticks whose readings waited behind it."""
    part: str
    """The part that took most of the time since."""
    share: float
    """Its share of that."""

    def line(self) -> str:
        """Return it in words.

        Examples:
            >>> Behind(7, 12.3, 1024, "cells", 0.8).line()
            '12.3 s behind, 1,024 ticks wait; the cells took 80% of the time'
        """
        more = f", {self.waiting:,} ticks wait" if self.waiting else ""
        held = f"the {self.part} took {self.share:.0%} of the time"
        return f"{self.seconds:.1f} s behind{more}; {held}"


def further(one: Behind | None, other: Behind | None) -> Behind | None:
    """Return which of two is further behind."""
    return max((one, other), key=lambda each: 0.0 if each is None else each.seconds)


class TickTimes:
    """Follows the messages of the world and the coordinator, tick by tick."""

    def __init__(self) -> None:
        self._last = 0.0  # when a wait ended
        # When each ended, for whom it was, and how many seconds it took.
        self._waits: deque[tuple[float, str, float]] = deque(maxlen=_WAITS)
        self._seen: tuple[wire.Observation, float] | None = None

    def take(self, message: wire.Message, at: float) -> Behind | None:
        """Take in what was sent, or came, then, in seconds since the epoch.

        Returns:
            Of a decision: how far its tick was behind; None if it was not.
        """
        part = _ENDS.get(type(message))
        if part is None:
            return None
        if self._last:
            self._waits.append((at, part, at - self._last))
        self._last = at
        if isinstance(message, wire.Observation):
            self._seen = message, at
        if not isinstance(message, wire.Decision) or self._seen is None:
            return None
        (seen, came), self._seen = self._seen, None
        if not seen.due:
            return None
        spent = dict[str, float]()
        for end, who, seconds in self._waits:
            spent[who] = spent.get(who, 0.0) + max(0.0, min(seconds, end - seen.due))
        most = max(spent, key=lambda each: spent[each])
        share = spent[most] / (sum(spent.values()) or 1.0)
        return Behind(seen.tick, max(0.0, came - seen.due), seen.waiting, most, share)
