"""Decides when a tick is due: by the clock, or on a change.

Both are pure: they are told the time, in seconds on a clock that never goes back, and
return for how many seconds to wait for the next tick if nothing changes: 0 if it is
due, None if it never is. A source gives no tick while nothing at all is known.
"""

from typing import Annotated, TypeAlias

import msgspec

from neurosnap.errors import InvalidValueError

Seconds: TypeAlias = Annotated[float, msgspec.Meta(gt=0, le=31_536_000)]


SLACK = 1.0
"""Seconds that a tick may be late."""


class Clocked:
    """A tick every `interval` seconds, above 0, the first one at once.

    A tick that is late, since the swarm was busy or nothing was known, is given as soon
    as it can be. Further ones that were due meanwhile are skipped, not caught up on:
    they would all show the same. The next is due when it would have been anyway, so
    lateness does not add up.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self.slack = min(SLACK, interval / 2)
        self._began = 0.0
        self._next = 0

    def begin(self, now: float) -> None:
        """Let the first tick be due `now`; nothing else is asked before."""
        self._began, self._next = now, 0

    def wait(self, now: float, changed: bool) -> float | None:
        """Return the time left; whether anything `changed` does not matter."""
        return max(0.0, self._began + self._next * self._interval - now)

    def due(self, now: float) -> float:
        """Return since when a tick that is given now may have been due."""
        return min(now, self._began + self._next * self._interval)

    def given(self, now: float) -> None:
        """Go on to the first tick due later than `now`, if one is due at all."""
        if self.wait(now, changed=True):
            return
        following = max(int((now - self._began) // self._interval), self._next) + 1
        if self._began + following * self._interval <= now:  # the division was inexact
            following += 1
        self._next = following


class OnChange:
    """A tick as soon as something differs from what the last one gave.

    What changes and changes back before a tick could be given is no change.

    Args:
        min_interval: Seconds between two ticks at least, 0 or more.
        max_interval: Seconds between two ticks at most, changed or not; above 0, and
            `min_interval` or more; None if there is no tick without change.
    """

    def __init__(
        self, min_interval: float = 0.0, max_interval: float | None = None
    ) -> None:
        self._least = min_interval
        self.slack = min(SLACK, min_interval or SLACK)
        self._most = max_interval
        self._last: float | None = None

    def begin(self, now: float) -> None:
        """Let the first tick be due with the first change."""
        self._last = None

    def wait(self, now: float, changed: bool) -> float | None:
        """Return the time left until a change may show, or none has to.

        `changed` means that something differs from what the last tick gave.
        """
        if self._last is None:
            return 0.0 if changed else None
        span = self._least if changed else self._most
        return None if span is None else max(0.0, self._last + span - now)

    def due(self, now: float) -> float:
        """Return since when a tick that is given now may have been due."""
        return now if self._last is None else min(now, self._last + self._least)

    def given(self, now: float) -> None:
        """Count both intervals from `now`."""
        self._last = now


TickSchedule: TypeAlias = Clocked | OnChange
"""Says when the next tick is due."""


class TickRule(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """When a tick happens: by the clock, or on change."""

    interval: Seconds | None = None
    """Seconds from tick to tick; None for a tick whenever a reading has changed."""
    min_interval: Annotated[float, msgspec.Meta(ge=0, le=31_536_000)] = 0.0
    """Without `interval`: seconds between two ticks at least."""
    max_interval: Seconds | None = None
    """Without `interval`: seconds between two ticks at most; None for no limit."""

    def __post_init__(self) -> None:
        if self.max_interval is None:
            return
        if self.interval is not None:
            rule = "must not come with max_interval"
            raise InvalidValueError("interval", rule, self.interval)
        if self.max_interval < self.min_interval:
            rule = "must be min_interval or more"
            raise InvalidValueError("max_interval", rule, self.max_interval)

    def schedule(self) -> TickSchedule:
        """Return what decides so."""
        if self.interval is not None:
            return Clocked(self.interval)
        return OnChange(self.min_interval, self.max_interval)
