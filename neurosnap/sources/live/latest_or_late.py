"""The latest reading of every sensor: which readings are late, which are still valid.

No clock and no threads: every time is an argument, in seconds on one clock that never
goes back. It holds one reading a sensor, however many come.

What is known at a time `now`:

- A sensor that never read is unknown, and so is one whose latest reading says so.
- A reading is believed until it is `stale_after` seconds old; from then on the sensor
  is unknown. Without a bound it is believed for ever.
- A reading older than the one held is late: it is dropped. Of two equally
  old ones the one that comes last is held.
- A reading cannot be younger than its arrival: one from the future was stamped by a
  clock that is ahead, and is taken as of its arrival. To refuse it would silence a
  sensor for the error of a clock; to believe its stamp would make every honest reading
  after it late.
- A sensor with `heard_within` does not say what it reads, only that it is there: it is
  on until that many seconds after any message, and off otherwise. Silence means that it
  is off only once it was listened to for that long; until then it is unknown.
"""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.sensorium import Sensorium

Bits: TypeAlias = NDArray[np.bool_]
Spans: TypeAlias = float | Sequence[float | None] | None
"""Seconds, one for all sensors or one a sensor; None if there is no such bound."""
TOLERANCE = 1.0
"""Seconds that clocks may differ by before one was put right."""


class LatestReadings:
    """The latest reading of each sensor; not to be used from two threads at once.

    Args:
        sensors: Their names, as `Sensorium` takes them.
        stale_after: Seconds after which a reading is believed no more, above 0.
        heard_within: For sensors that are on while messages come: for how many seconds
            after one, above 0. Staleness means nothing for these.

    Raises:
        InvalidValueError: There is no sensor, a name is none, or a span is not above 0.
        ShapeError: There are spans, but not one a sensor.
    """

    def __init__(
        self,
        sensors: Sequence[str],
        *,
        stale_after: Spans = None,
        heard_within: Spans = None,
    ) -> None:
        self.sensors: tuple[str, ...] = Sensorium(sensors).names
        if not self.sensors:
            raise InvalidValueError("sensors", "must be one at least", self.sensors)
        count = len(self.sensors)
        stale = _spans("stale_after", stale_after, count)
        seen = _spans("heard_within", heard_within, count)
        self._seen: Bits = np.isfinite(seen)
        self._span = np.where(self._seen, seen, stale)
        self._at = np.full(count, -np.inf)
        self._on_until = np.full(count, -np.inf)
        self._off_until = np.full(count, -np.inf)
        self._silent_from = np.full(count, np.inf)

    def start_listening(self, now: float) -> None:
        """Begin to count silence: from now on every message is received."""
        self._silent_from = np.where(self._seen, now + self._span, np.inf)

    def stop_listening(self) -> None:
        """Ignore silence until `start_listening`: no message is received."""
        self._silent_from[:] = np.inf
        self._on_until[self._seen] = -np.inf

    def update(self, sensor: int, on: bool | None, at: float, now: float) -> bool:
        """Update a sensor by one reading. O(1).

        Args:
            sensor: Whose, in [0, N).
            on: What it read; None if it says that it does not know. A sensor with
                `heard_within` is there whatever it says.
            at: When it was read.
            now: When it came, never before any time given earlier.

        Returns:
            Whether it was taken; a late one is not.
        """
        at = min(at, now)
        if at < self._at[sensor]:
            return False
        self._at[sensor] = at
        until = at + float(self._span[sensor])
        if self._seen[sensor]:
            on = True
        self._on_until[sensor] = until if on is True else -np.inf
        self._off_until[sensor] = until if on is False else -np.inf
        return True

    def update_all(self, on: Bits, some: Bits, at: float, now: float) -> None:
        """Update every sensor, as `update` would one after the other. O(N).

        Args:
            on: ``(N,)``, what they read; False where they do not know.
            some: ``(N,)``, which of them know.
            at: When they were read.
            now: When they came, never before any time given earlier.
        """
        at = min(at, now)
        taken = at >= self._at
        self._at[taken] = at
        until = at + self._span
        self._on_until[taken] = np.where(on | self._seen, until, -np.inf)[taken]
        off = some & ~on & ~self._seen
        self._off_until[taken] = np.where(off, until, -np.inf)[taken]

    def observation(self, now: float) -> tuple[Bits, Bits]:
        """Return what is read, and what of it is known. O(N).

        Returns:
            The readings and which are known: ``(N,)`` each, new arrays; a reading that
            is not known is 0.
        """
        on, off = now < self._on_until, now < self._off_until
        return on, on | off | (now >= self._silent_from)

    def next_change(self, now: float) -> float | None:
        """Return when `observation` changes next if nothing comes; None if never."""
        turns = np.concatenate((self._on_until, self._off_until, self._silent_from))
        ahead = turns[(turns > now) & np.isfinite(turns)]
        return float(ahead.min()) if ahead.size else None


def _spans(name: str, given: Spans, count: int) -> NDArray[np.float64]:
    """Return one span a sensor, infinite where there is none."""
    each = given if isinstance(given, Sequence) else [given] * count
    if len(each) != count:
        raise ShapeError(name, f"must be {count}, one a sensor", len(each))
    spans = np.array([np.inf if span is None else span for span in each], np.float64)
    wrong = ~(spans > 0)
    if wrong.any():
        raise InvalidValueError(name, "must be above 0", float(spans[wrong][0]))
    return spans


class ClockMapping:
    """Converts senders' timestamps to the receiver's clock; their order is preserved.

    The difference of the two clocks is kept until the wall clock was clearly put right:
    taken anew for each timestamp it would jitter, and give equal ones some order.

    Args:
        now: The clock that never goes back.
        wall: Seconds since the epoch, at the same moment.
    """

    def __init__(self, now: float, wall: float) -> None:
        self._offset = now - wall

    def on_our_clock(self, at: float, now: float, wall: float) -> float:
        """Return what our clock showed at `at`, in seconds since the epoch."""
        offset = now - wall
        if abs(offset - self._offset) > TOLERANCE:
            self._offset = offset
        return at + self._offset
