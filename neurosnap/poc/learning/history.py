"""The last readings of every sensor, as bits.

A sensor that is grown later is a function of what was read before. With the history its
weights can start as if it had been there as long as the history goes back.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.order.literals import Words

LENGTH = 8192
"""Ticks kept unless told otherwise: 2 kB a sensor."""
_ONE = np.uint64(1)


class Newborn(NamedTuple):
    """What is known of a sensor that is grown, of its pairs with those before it."""

    ticks: int
    """How long the history is."""
    squares: NDArray[Any]
    """``(4, sensor)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*``, itself first."""
    codes: NDArray[np.uint8]
    """``(sensor,)``: what follows from them; see `neurosnap.poc.learning.pair_codes`.
    """


class History:
    """A ring of observations: which sensors read on, and which read off.

    Tick ``t``, counted from 0, is bit ``t % 64`` of word ``t // 64 % W``. A reading
    that was unknown is in neither.

    Args:
        sensors: How many there are.
        length: Ticks kept, a multiple of 64.

    Attributes:
        on: ``(W, N)``: the ticks at which each sensor read on.
        off: ``(W, N)``: at which it read off.

    Raises:
        InvalidValueError: `length` is no multiple of 64 from 64 up.
    """

    def __init__(self, sensors: int, length: int = LENGTH) -> None:
        if length < 64 or length % 64:
            rule = "must be a multiple of 64 from 64 up"
            raise InvalidValueError("history", rule, length)
        self.on: Words = np.zeros((length // 64, sensors), np.uint64)
        self.off = self.on.copy()
        self._next = 0

    @property
    def length(self) -> int:
        """How many ticks it keeps."""
        return 64 * len(self.on)

    @property
    def ticks(self) -> int:
        """How many ticks it holds."""
        return min(self._next, self.length)

    def enter(
        self, bits: NDArray[np.bool_], known: NDArray[np.bool_] | None = None
    ) -> None:
        """Take in an observation in the place of the oldest. O(N) time.

        Args:
            bits: ``(N,)``.
            known: ``(N,)``; None: all.
        """
        word, place = self._next // 64 % len(self.on), np.uint64(self._next % 64)
        off = ~bits
        if known is not None:
            bits, off = bits & known, off & known
        for ring, flags in (self.on, bits), (self.off, off):
            row = ring[word]
            row &= ~(_ONE << place)
            row |= flags.astype(np.uint64) << place
        self._next += 1

    def ticks_of(self, literal: int) -> Words:
        """Return ``(W,)``, the ticks at which `literal` was read."""
        return (self.off if literal & 1 else self.on)[:, literal >> 1]

    def after(self, ring: Words) -> Words:
        """Return the ticks that follow ticks of a ring.

        Args:
            ring: ``(W, n)``.

        Returns:
            ``(W, n)``. The oldest tick that is kept follows one that is not known.
        """
        carried = np.roll(ring >> np.uint64(63), 1, axis=0)
        later: Words = (ring << _ONE) | carried
        oldest = self._next % self.length
        later[oldest // 64] &= ~(_ONE << np.uint64(oldest % 64))
        return later

    def grow(
        self, sensor: int, literals: Sequence[int], before: Sequence[int] = ()
    ) -> None:
        """Let a sensor have read what one does that is on iff all of some literals are.

        It has read on when all of them were read, and off when the complement of one
        was.

        Args:
            sensor: Its number.
            literals: Those of the same tick.
            before: Those of the tick before.
        """
        tick, last = list(literals), list(before)
        members = [self.ticks_of(a) for a in tick]
        complements = [self.ticks_of(a ^ 1) for a in tick]
        members += [self.after(self.ticks_of(a)) for a in last]
        complements += [self.after(self.ticks_of(a ^ 1)) for a in last]
        self.on[:, sensor] = np.bitwise_and.reduce(members)
        self.off[:, sensor] = np.bitwise_or.reduce(complements)

    def unrolled(self, ring: Words) -> NDArray[np.bool_]:
        """Return bits of a ring in the order of time.

        Args:
            ring: ``(W, n)``.

        Returns:
            ``(ticks, n)``, the oldest first.
        """
        octets = np.ascontiguousarray(ring.T).astype("<u8").view(np.uint8)
        flat = np.unpackbits(octets, axis=1, bitorder="little").T
        first = self._next % self.length if self._next > self.length else 0
        return np.roll(flat, -first, axis=0)[: self.ticks].astype(np.bool_)

    def arrays(self) -> Arrays:
        """Return all there is to know, by name."""
        return {"on": self.on, "off": self.off, "next": np.array(self._next, np.int64)}

    @classmethod
    def from_arrays(cls, arrays: Arrays) -> Self:
        """Return the history that has these arrays.

        Raises:
            ValueError: They make no sense.
        """
        on = arrays.get("on")
        words, sensors = on.shape if on is not None and on.ndim == 2 else (0, 0)
        if not words:
            raise ValueError("on: must be (W, N)")
        history = cls(sensors, 64 * words)
        history.on[:] = entry(arrays, "on", (words, sensors), np.uint64)
        history.off[:] = entry(arrays, "off", (words, sensors), np.uint64)
        history._next = entry(arrays, "next", (), np.int64).item()
        if history._next < 0 or (history.on & history.off).any():
            raise ValueError("on, off: must exclude each other")
        return history

    def check(self, sensors: int) -> None:
        """Refuse a history of another number of sensors.

        Raises:
            ShapeError: It is.
        """
        if self.on.shape[1] != sensors:
            rule = f"must be of {sensors} sensors"
            raise ShapeError("history", rule, self.on.shape[1])
