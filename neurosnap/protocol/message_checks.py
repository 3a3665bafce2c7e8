"""Checks on incoming messages: bounds that cells, workers and the coordinator share.

Each check raises `MessageError` if a message cannot be right. The coordinator numbers
waves and wirings one by one, and its messages arrive in order, so a number far beyond
the last one heard cannot be genuine: a part that accepted it would have to store
anything. Before the first number there is nothing to compare with, since a resumed run
continues with the numbers it had.

Cell processes import this module: it needs neither numpy nor numba.
"""

from collections.abc import Collection
from typing import Generic, TypeVar

from neurosnap import wire
from neurosnap.errors import MessageError
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


def check_number(what: str, number: int, heard: int) -> None:
    """Refuse a number that is too far ahead; see `is_far`.

    Raises:
        MessageError: It is.
    """
    if is_far(number, heard):
        rule = f"must be at most {AHEAD} beyond {heard}"
        raise MessageError(f"{what} {rule}, got {number}")


def check_room(name: str, number: int, waves: Collection[int]) -> None:
    """Refuse a wave for which there is no room beside those known.

    Raises:
        MessageError: There are `WAVES` already.
    """
    if number not in waves and len(waves) >= WAVES:
        rule = f"must be of {WAVES} waves in all"
        raise MessageError(f"{name}: {rule}, got wave {number} too")


def check_start(start: wire.WaveStart) -> None:
    """Refuse a wave start that contradicts itself.

    Raises:
        MessageError: It does.
    """
    if start.credit > DEEPEST:
        rule = f"must have credit up to {DEEPEST}"
        raise MessageError(f"wavestart: {rule}, got {start.credit}")
    # A wave cannot settle waves newer than itself.
    if start.settled_below > start.wave:
        rule = f"must settle only what is before wave {start.wave}"
        raise MessageError(f"wavestart: {rule}, got all below {start.settled_below}")


def check_readings(observation: wire.Observation | wire.Learn) -> None:
    """Refuse an observation whose two masks contradict each other.

    An observation without any known reading is refused, too: it would start no wave.

    Raises:
        MessageError: They do.
    """
    if not observation.known:
        return
    size, got = len(observation.bits), len(observation.known)
    if got != size:
        rule = f"must say which of {size} bytes are known"
        raise MessageError(f"observation: {rule}, got {got} bytes")
    bits, known = (
        int.from_bytes(packed, "little")
        for packed in (observation.bits, observation.known)
    )
    if not known:
        raise MessageError("observation: must hold a reading that is known, got none")
    if beyond := bits & ~known:
        sensor = beyond.bit_length() - 1
        rule = "must be 0 where it is not known"
        raise MessageError(f"observation: {rule}, got sensor {sensor} on")


class RecentReadings(Generic[T]):
    """The readings of the latest ticks, by tick."""

    def __init__(self) -> None:
        self._readings: dict[int, T] = {}
        self._tick = 0  # the last that was joined

    def __contains__(self, tick: int) -> bool:
        return tick in self._readings

    def __getitem__(self, tick: int) -> T:
        return self._readings[tick]

    def check_tick(self, name: str, tick: int) -> None:
        """Refuse a tick that is too far ahead.

        Raises:
            MessageError: It is.
        """
        if 0 < self._tick < tick - READINGS:
            rule = f"must be at most {READINGS} ticks after {self._tick}"
            raise MessageError(f"{name}: tick {rule}, got {tick}")

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
