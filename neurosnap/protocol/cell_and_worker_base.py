"""The base of cell and worker: checks what they receive, bounds what they store.

A message that cannot be right is refused and changes nothing. The coordinator numbers
waves and wirings one by one, and its messages arrive in order, so a number far beyond
the last one heard cannot be genuine: a part that accepted it would have to store
anything. Before the first number there is nothing to compare with, since a resumed run
continues with the numbers it had.

It splits a wave's credit as well: a pulse carries a share ``2^-e`` as its exponent.

Cell processes import this module: it needs neither numpy nor numba.
"""

from collections.abc import Collection, Iterable
from typing import Generic, Protocol, TypeVar

import msgspec

from neurosnap import wire
from neurosnap.errors import MessageError

DEEPEST = 1 << 17
"""The most hops of a wave, bits of a share of its credit, and things in a report.

Each literal fires once a wave, so a wave over ``N`` sensors has at most ``2N`` hops and
its shares, split among at most ``2N`` each time, less than ``2N·log2(2N + 1)`` bits:
this does for 5,000 sensors in the worst order there is, and for a chain of 65,000. What
claims more would have to be computed with numbers of that many bits."""
READINGS = 8
"""Ticks that are remembered; a wave is never further behind, or ahead."""
AHEAD = 1 << 12
"""How far the waves in flight reach beyond the last that was announced to all."""
WAVES = 2 * AHEAD
"""Waves that are known of at once."""
REMEMBERED = 1 << 17
"""Pulses, or batches of them, that are remembered over all waves."""


class HostWave(Protocol):
    """The state of one wave in a cell or worker."""

    seen: set[tuple[int, int]]
    """What came, so that nothing counts twice."""


T = TypeVar("T")
W = TypeVar("W", bound=HostWave)


def is_far(number: int, heard: int) -> bool:
    """Tell whether a wave or a wiring is too far beyond the last heard of (0: none)."""
    return 0 < heard < number - AHEAD


def check_number(what: str, number: int, heard: int) -> None:
    """Raise MessageError for a number that is too far ahead; see `is_far`."""
    if is_far(number, heard):
        rule = f"must be at most {AHEAD} beyond {heard}"
        raise MessageError(f"{what} {rule}, got {number}")


def check_room(name: str, number: int, waves: Collection[int]) -> None:
    """Raise MessageError if a wave has no room beside the `WAVES` that are known."""
    if number not in waves and len(waves) >= WAVES:
        rule = f"must be of {WAVES} waves in all"
        raise MessageError(f"{name}: {rule}, got wave {number} too")


def check_readings(observation: wire.Observation | wire.Learn) -> None:
    """Raise MessageError if the two masks of an observation contradict each other.

    An observation without any known reading is refused, too: it would start no wave.
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


def split_evenly(credit: int, parts: int) -> list[int]:
    """Split the share ``2^-credit`` into `parts` shares that add up to it exactly.

    They are the leaf depths of a complete binary tree, so they differ by at most one
    and nothing is left over.

    Returns:
        The exponents of the shares, larger shares first.
    """
    depth = (parts - 1).bit_length()
    larger = (1 << depth) - parts
    smaller = parts - larger
    return [credit + depth - 1] * larger + [credit + depth] * smaller


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
        """Raise MessageError for a tick that is too far ahead."""
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


class Host(Generic[W, T]):
    """A cell, or a worker that has many of them.

    Args:
        who: Its name.
        literals: Those of its cells.
        size: The bytes of an observation; 0 if the first one is to say.
    """

    def __init__(self, who: str, literals: range, size: int = 0) -> None:
        self._who = who
        self._literals = literals
        self._bytes = size
        self._epoch = 0
        self._wired = True
        self._readings = RecentReadings[T]()
        self._waves: dict[int, W] = {}
        self._settled_below = 1
        self._fence = 0  # the newest wave announced to all, as far as received
        self._remembered = 0  # pulses or batches of them, in all waves
        self._out: list[wire.Message] = []  # of the batch that is worked on
        self.waiting = 0
        """Messages sent that may not have left yet, at most."""

    def receive(self, batch: Iterable[wire.Message]) -> list[wire.Message]:
        """Receive `batch` and return what is to be sent for it, in order.

        Pulses come before the report of their wave, because other hosts are waiting for
        them. Cost: proportional to the batch and to the out-edges of what fires; of a
        worker also to its cells, for each wave.
        """
        for message in batch:
            try:
                self._receive(message)
            except MessageError as error:
                self._out.append(wire.Fault(self._who, str(error)))
        self._finish()
        out, self._out = self._out, []
        self.waiting += len(out)
        return out

    def _receive(self, message: wire.Message) -> None:
        """Act on a message that can be right."""
        raise NotImplementedError

    def _finish(self) -> None:
        """Say what is left to say of what was received so far."""
        raise NotImplementedError

    def _counts(self, name: str, wave: int, fence: int) -> bool:
        """Tell whether pulses still count: not if their wave has settled."""
        check_number(f"{name}: wave", max(wave, fence), self._fence)
        if wave < self._settled_below:
            return False
        check_room(name, wave, self._waves)
        if self._remembered >= REMEMBERED:
            rule = f"must be one of {REMEMBERED} in flight"
            raise MessageError(f"{name}: {rule}, got one more")
        return True

    def _follow(self, start: wire.WaveStart) -> bool:
        """Forget what a wave start settles, and tell whether the wave itself counts."""
        if start.credit > DEEPEST:
            rule = f"must have credit up to {DEEPEST}"
            raise MessageError(f"wavestart: {rule}, got {start.credit}")
        # A wave cannot settle waves newer than itself.
        if start.settled_below > start.wave:
            rule = f"must settle only what is before wave {start.wave}"
            got = f"got all below {start.settled_below}"
            raise MessageError(f"wavestart: {rule}, {got}")
        self._readings.check_tick("wavestart", start.tick)
        check_number("wavestart: wave", max(start.wave, start.fence), self._fence)
        below = max(self._settled_below, start.settled_below)
        fence = max(self._fence, start.wave if start.cell < 0 else 0)
        left, counts = self._waves, start.wave >= below
        # The first announcement to all shows which waves cannot come about.
        if below > self._settled_below or (fence and not self._fence):
            left = {
                number: wave
                for number, wave in left.items()
                if number >= below and not is_far(number, fence)
            }
        if counts:
            check_room("wavestart", start.wave, left)
        if left is not self._waves:
            self._waves = left
            self._remembered = sum(len(wave.seen) for wave in left.values())
        self._settled_below, self._fence = below, fence
        if start.settled_below == start.wave:
            self.waiting = 0  # all waves before have settled: their reports have come
        return counts

    def _narrowed(self, start: wire.WaveStart) -> wire.WaveStart:
        """Return `start` with no more of its signal than is kept: its own, once."""
        if not start.signal:
            return start
        own = (literal for literal in start.signal if literal in self._literals)
        signal = tuple(dict.fromkeys(own))
        return msgspec.structs.replace(start, kind="signal", signal=signal)

    def _is_new(self, observation: wire.Observation | wire.Learn) -> bool:
        """Tell whether a tick was not read before."""
        size = len(observation.bits)
        if self._bytes and size != self._bytes:
            raise MessageError(
                f"observation: must hold {self._bytes} bytes, got {size}"
            )
        check_readings(observation)
        self._readings.check_tick("observation", observation.tick)
        if observation.tick in self._readings:
            return False
        self._bytes = size
        return True

    def _changes(self, wiring: wire.Wiring | wire.WorkerWiring) -> bool:
        """Begin the epoch of a wiring; tell whether it is a new one."""
        if wiring.epoch <= self._epoch:
            return False
        self._finish()  # what came before it was meant for the wiring before it
        if wiring.after not in (0, self._epoch):
            # A change was lost. Taking part with the wrong edges would give a wrong
            # state; staying silent makes the wave's deadline name this part.
            self._wired = False
            rule = f"must build on epoch {self._epoch}"
            raise MessageError(f"{wire.topic(wiring.key)}: {rule}, got {wiring.after}")
        self._epoch, self._wired = wiring.epoch, True
        return True
