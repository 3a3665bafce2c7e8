"""The last readings of every sensor, as bits, and counts over them.

A sensor that is grown later is a function of what was read before. With the history its
weights can start as if it had been there as long as the history goes back.

A *ring* says which of the last ticks something was so, one bit a tick. Tick ``t``,
counted from 0, is bit ``t % 64`` of word ``t // 64 % W``; so a ring of ``W`` words
keeps ``R = 64 W`` ticks, and the next takes the place of the oldest.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.history_questions import Answer, Count, Question
from neurosnap.poc.order.literal_sets import Words

_ONE, _TOP = np.uint64(1), np.uint64(63)


class Newborn(NamedTuple):
    """The weights of a new sensor's pairs with earlier sensors, and what they imply."""

    ticks: int
    """How long the history is."""
    squares: NDArray[Any]
    """``(4, sensor)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*``, itself first."""
    codes: NDArray[np.uint8]
    """``(sensor,)``: what follows from them; see `neurosnap.poc.learning.pairs`.
    """


class History:
    """The last observations: which sensors read on, and which off, as rings of bits.

    Both are rings. A reading that was unknown is in neither.

    Args:
        sensors: How many there are.
        length: Ticks kept, a multiple of 64.

    Attributes:
        on: ``(W, N)``: the ticks at which each sensor read on.
        off: ``(W, N)``: at which it read off.
        begun: ``(W,)``: the ticks that follow none, as a trajectory begins at them.
        over: ``(W,)``: those of them before which another had come to its own end.
        tick: The last tick it holds, counted from 1; 0: none.

    Raises:
        InvalidValueError: `length` is no multiple of 64 from 64 up.
    """

    def __init__(self, sensors: int, length: int) -> None:
        if length < 64 or length % 64:
            rule = "must be a multiple of 64 from 64 up"
            raise InvalidValueError("history", rule, length)
        self.on: Words = np.zeros((length // 64, sensors), np.uint64)
        self.off = self.on.copy()
        self.begun: Words = np.zeros(length // 64, np.uint64)
        self.over: Words = self.begun.copy()
        self.tick = 0

    @property
    def length(self) -> int:
        """How many ticks it keeps."""
        return 64 * len(self.on)

    @property
    def ticks(self) -> int:
        """How many ticks it holds."""
        return min(self.tick, self.length)

    def record(
        self,
        bits: NDArray[np.bool_],
        known: NDArray[np.bool_] | None = None,
        begins: bool = False,
        ended: bool = False,
    ) -> None:
        """Record an observation, ``(N,)``, in the place of the oldest. O(N) time.

        It `begins` a trajectory if it does not follow the one before; then a trajectory
        may have `ended` by itself.
        """
        word, place = self.tick // 64 % len(self.on), np.uint64(self.tick % 64)
        off = ~bits
        if known is not None:
            bits, off = bits & known, off & known
        for ring, flags in (self.on, bits), (self.off, off):
            row = ring[word]
            row &= ~(_ONE << place)
            row |= flags.astype(np.uint64) << place
        for marks, so in (self.begun, begins), (self.over, ended):
            marks[word] &= ~(_ONE << place)
            marks[word] |= np.uint64(so) << place
        self.tick += 1

    def double(self) -> None:
        """Keep twice as many ticks, before it has come round."""
        self.on, self.off, self.begun, self.over = (
            np.concatenate([ring, np.zeros_like(ring)])
            for ring in (self.on, self.off, self.begun, self.over)
        )

    def ticks_of(self, literal: int) -> Words:
        """Return ``(W,)``, the ticks at which `literal` was read."""
        return (self.off if literal & 1 else self.on)[:, literal >> 1]

    def rings(self, literals: NDArray[np.int64]) -> Words:
        """Return ``(W, n)``, the ticks at which each of ``n`` literals was read."""
        sensors, off = literals >> 1, (literals & 1).astype(np.bool_)
        rings = self.on[:, sensors]
        if off.any():
            rings[:, off] = self.off[:, sensors[off]]
        return rings

    def last_ticks(self, literals: NDArray[np.int64]) -> Words:
        """Return ``(n,)``, at which of the last 64 ticks each literal was read.

        Bit ``63 - k`` stands for ``k`` ticks ago; ticks before the last beginning are
        left out.
        """
        word, place = divmod((self.tick - 1) % self.length, 64)
        newest, older = np.uint64(63 - place), np.uint64(place)
        both = self.rings(literals), self.begun[:, np.newaxis]
        read, begun = (
            ring[word] << newest | (ring[word - 1] >> older) >> _ONE for ring in both
        )
        first = max(int(begun[0]).bit_length() - 1, 0)
        kept: Words = read >> np.uint64(first) << np.uint64(first)
        return kept

    def latest(self, ticks: int) -> Words:
        """Return ``(W,)``, so many of the last ticks. O(W) time."""
        ages = (self.tick - 1 - np.arange(self.length)) % self.length
        bits = np.packbits(ages < ticks, bitorder="little")
        words: Words = bits.view("<u8").astype(np.uint64)
        return words

    def occasions_held(
        self,
        sources: NDArray[np.int64],
        targets: NDArray[np.int64],
        within: Words | None = None,
    ) -> NDArray[np.int64]:
        """Return on how many occasions implications were tested, and held.

        As in the table of relations, ``a -> b`` is tested where ``a`` is on, and where
        ``b`` is off; the test that was made less often counts. O(W n) time.

        Args:
            sources: ``(n,)`` literals.
            targets: ``(n,)``: what each of them implies.
            within: ``(W, n)``, the ticks at which an occasion may begin; None: all.

        Returns:
            ``(n,)``; 0 for two literals of the same sensor.
        """

        def begun(a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
            both = self.rings(a) & self.rings(b)
            both &= ~following(both, self.tick)
            if within is not None:
                both &= within
            runs: NDArray[np.int64] = np.bitwise_count(both).sum(axis=0, dtype=np.int64)
            return runs

        return np.minimum(begun(sources, targets), begun(sources ^ 1, targets ^ 1))

    def answer(self, question: Question) -> Answer:
        """Answer a question. O(W n) time for ``n`` literals counted."""
        return Answer(
            {literal: self.ticks_of(literal) for literal in question.readings},
            tuple(self._counted(count) for count in question.counts),
        )

    def _counted(self, count: Count) -> NDArray[Any]:
        rings = self.rings(count.literals)
        rings &= count.within[:, np.newaxis]
        counted: NDArray[Any] = np.bitwise_count(rings).sum(axis=0)
        return counted

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name; without words not reached yet."""
        used = slice(-(-self.ticks // 64))
        return {
            "on": self.on[used],
            "off": self.off[used],
            "begun": self.begun[used],
            "over": self.over[used],
            "next": np.array(self.tick, np.int64),
        }

    @classmethod
    def from_arrays(cls, arrays: Arrays, sensors: int, length: int) -> Self:
        """Return the history of so many sensors, and ticks, that has these arrays.

        Raises:
            ValueError: They make no sense.
        """
        history = cls(sensors, length)
        history.tick = entry(arrays, "next", (), np.int64).item()
        used = max(0, -(-history.ticks // 64))
        history.on[:used] = entry(arrays, "on", (used, sensors), np.uint64)
        history.off[:used] = entry(arrays, "off", (used, sensors), np.uint64)
        history.begun[:used] = entry(arrays, "begun", (used,), np.uint64)
        history.over[:used] = entry(arrays, "over", (used,), np.uint64)
        if history.tick < 0 or (history.on & history.off).any():
            raise ValueError("on, off: must exclude each other")
        return history


def following(ring: Words, ticks: int) -> Words:
    """Return the ticks that follow those of a ring, after so many ticks in all.

    ``(W,)`` or ``(W, n)``. The oldest tick that is kept follows one that is not known.
    """
    later: Words = (ring << _ONE) | np.roll(ring >> _TOP, 1, axis=0)
    return _without_oldest(later, ticks)


def preceding(ring: Words, ticks: int) -> Words:
    """Return the ticks that those of a ring follow, see `following`."""
    ring = _without_oldest(ring.copy(), ticks)
    earlier: Words = (ring >> _ONE) | np.roll(ring << _TOP, -1, axis=0)
    return earlier


def window(
    read: Mapping[int, Words],
    literals: Sequence[int],
    span: tuple[int, int],
    begun: Words,
    ticks: int,
) -> tuple[Words, Words]:
    """Return when a sensor was on, and off, that is on iff all was read for a while.

    Args:
        read: The ticks at which each of the literals, and of their complements, was.
        literals: Those.
        span: From how many ticks ago, and to how many.
        begun: ``(W,)``: the ticks that follow none.
        ticks: How many there were so far.

    Returns:
        ``(W,)`` each.
    """
    since, until = span
    whole, broken = ([read[a ^ k] for a in literals] for k in (0, 1))
    moved = np.bitwise_and.reduce(whole), np.bitwise_or.reduce(broken)
    on, off = ~np.zeros_like(begun), np.zeros_like(begun)
    for ago in range(since + 1):
        if ago >= until:
            on, off = on & moved[0], off | moved[1]
        moved = (
            following(moved[0], ticks) & ~begun,
            following(moved[1], ticks) & ~begun,
        )
    return on, off


def in_order(rings: Sequence[Words], ticks: int) -> NDArray[np.bool_]:
    """Return the bits of rings from the oldest tick to the newest, ``(rings, ticks)``.

    Args:
        rings: ``(W,)`` each.
        ticks: How many there were so far.
    """
    stacked = np.stack(rings).astype("<u8").view(np.uint8)
    bits = np.unpackbits(stacked, axis=1, bitorder="little").astype(np.bool_)
    length = bits.shape[1]
    return bits[:, np.arange(max(0, ticks - length), ticks) % length]


def as_ring(bits: NDArray[np.bool_], ticks: int, words: int) -> Words:
    """Return a ring, ``(W,)``, whose bits from the oldest tick to the newest are given.

    After so many ticks in all; the inverse of `in_order`.
    """
    ring = np.zeros(64 * words, np.bool_)
    ring[np.arange(ticks - len(bits), ticks) % len(ring)] = bits
    return np.packbits(ring, bitorder="little").view("<u8").astype(np.uint64)


def latch(
    read: Mapping[int, Words], literal: int, reset: int, begun: Words, ticks: int
) -> tuple[Words, Words]:
    """Return when a sensor was on, and off, that stays on once a literal was read.

    It is on from then until its reset is read and the literal is not. What it was
    before a beginning is unknown, and so is what depends on an unknown reading.

    Args:
        read: The ticks at which each of both, and of their complements, was.
        literal: What switches it on.
        reset: What switches it off.
        begun: The ticks that begin a trajectory.
        ticks: How many there were so far.

    Returns:
        ``(W,)`` each.
    """
    rings = begun, *(read[a] for a in (literal, literal ^ 1, reset, reset ^ 1))
    found = np.zeros((2, min(ticks, 64 * len(begun))), np.bool_)
    on = off = False
    rows = in_order(rings, ticks).T.tolist()
    for place, (begins, yes, no, ends, stays) in enumerate(rows):
        if begins:
            on = off = False
        on, off = yes or (on and stays), no and (ends or off)
        found[:, place] = on, off
    return as_ring(found[0], ticks, len(begun)), as_ring(found[1], ticks, len(begun))


def _without_oldest(ring: Words, ticks: int) -> Words:
    """Clear the bit of the oldest tick."""
    word, bit = divmod(ticks % (64 * len(ring)), 64)
    ring[word] &= ~(_ONE << np.uint64(bit))
    return ring


def conjunction(
    read: Mapping[int, Words], now: Sequence[int], before: Sequence[int], ticks: int
) -> tuple[Words, Words]:
    """Return when a sensor was on, and off, that is on iff all of some literals are.

    It has read on when all of them were read, and off when the complement of one was.

    Args:
        read: The ticks at which each of the literals, and of their complements, was.
        now: Those of the same tick.
        before: Those of the tick before.
        ticks: How many there were so far.

    Returns:
        ``(W,)`` each.
    """
    members = [read[a] for a in now] + [following(read[a], ticks) for a in before]
    others = [read[a ^ 1] for a in now]
    others += [following(read[a ^ 1], ticks) for a in before]
    return np.bitwise_and.reduce(members), np.bitwise_or.reduce(others)
