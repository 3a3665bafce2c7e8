"""Rings of bits: which of the last ticks, one bit a tick.

Tick ``t``, counted from 0, is bit ``t % 64`` of word ``t // 64 % W``; so a ring of
``W`` words keeps ``R = 64 W`` ticks, and the next takes the place of the oldest.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from neurosnap.poc.order.literals import Words

_ONE, _TOP = np.uint64(1), np.uint64(63)


def following(ring: Words, ticks: int) -> Words:
    """Return the ticks that follow those of a ring.

    Args:
        ring: ``(W,)`` or ``(W, n)``.
        ticks: How many there were so far.

    Returns:
        As `ring`. The oldest tick that is kept follows one that is not known.
    """
    later: Words = (ring << _ONE) | np.roll(ring >> _TOP, 1, axis=0)
    return _without_oldest(later, ticks)


def preceding(ring: Words, ticks: int) -> Words:
    """Return the ticks that those of a ring follow, see `following`."""
    ring = _without_oldest(ring.copy(), ticks)
    earlier: Words = (ring >> _ONE) | np.roll(ring << _TOP, -1, axis=0)
    return earlier


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
