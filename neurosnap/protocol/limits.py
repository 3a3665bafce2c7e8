"""What a cell and a worker take alike: how far ahead, of how many at once, how long.

The coordinator's numbers grow one by one, and what it says comes in order. So what is
far beyond what was heard from it cannot have come about, and whoever kept it would
have to keep anything. Before the first there is no telling: a run that is resumed goes
on with the numbers it had.

Cell processes import this file: neither numpy nor numba is needed.
"""

from collections.abc import Collection
from typing import Generic, TypeVar

from neurosnap import wire
from neurosnap.protocol.wave import DEEPEST

T = TypeVar("T")

READINGS = 8
"""Ticks that are remembered; a wave is never further behind, or ahead."""
AHEAD = 1 << 12
"""How far the waves in flight reach beyond the last that was announced to all."""
WAVES = 2 * AHEAD
"""Waves that are known of at once."""


def is_far(number: int, heard: int) -> bool:
    """Tell whether a wave or a wiring is too far ahead to have come about.

    Args:
        number: Its number.
        heard: The last number heard of; 0: none.
    """
    return 0 < heard < number - AHEAD


def wrong_number(what: str, number: int, heard: int) -> str | None:
    """Return why a number is too far ahead, as in `is_far`; None: it is not."""
    if not is_far(number, heard):
        return None
    return f"{what} must be at most {AHEAD} beyond {heard}, got {number}"


def wrong_room(name: str, number: int, waves: Collection[int]) -> str | None:
    """Return why a wave would be one too many of those known; None: it is not."""
    if number in waves or len(waves) < WAVES:
        return None
    return f"{name}: must be of {WAVES} waves in all, got wave {number} too"


def wrong_start(start: wire.WaveStart) -> str | None:
    """Return why a wave cannot begin as it says; None: it may."""
    if start.credit > DEEPEST:
        return f"wave: must have credit up to {DEEPEST}, got {start.credit}"
    # Nobody is done with what has not begun.
    if start.settled_below > start.wave:
        rule = f"must settle only what is before wave {start.wave}"
        return f"wave: {rule}, got all below {start.settled_below}"
    return None


class Latch(Generic[T]):
    """The readings of the latest ticks, by tick."""

    def __init__(self) -> None:
        self._readings: dict[int, T] = {}
        self._tick = 0  # the last that was joined

    def __contains__(self, tick: int) -> bool:
        return tick in self._readings

    def __getitem__(self, tick: int) -> T:
        return self._readings[tick]

    def wrong_tick(self, name: str, tick: int) -> str | None:
        """Return why a tick is too far ahead to have come about; None: it is not."""
        if not 0 < self._tick < tick - READINGS:
            return None
        rule = f"must be at most {READINGS} ticks after {self._tick}"
        return f"{name}: tick {rule}, got {tick}"

    def keep(self, tick: int, reading: T) -> None:
        """Keep what was read at a tick, and of all no more than the latest."""
        self._readings[tick] = reading
        if len(self._readings) > READINGS:
            del self._readings[min(self._readings)]

    def join(self, tick: int) -> None:
        """Take note of a wave's tick; forget readings that were too far ahead of it."""
        if tick > self._tick:
            self._tick = tick
            self._readings = {
                read: reading
                for read, reading in self._readings.items()
                if read <= tick + READINGS
            }
