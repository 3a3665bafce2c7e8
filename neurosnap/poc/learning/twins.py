"""Twins: sensors that have read the same at every observation so far.

Twins have the same weights with every other sensor, and are equivalent ``w_ij* = w_i*j
= 0``. So one row of weights does for a *group* of twins. At the first observation at
which some of a group read otherwise than the rest these are a group by themselves, with
a row that begins as a copy of the one that they had in common. All codes, weights and
dates are those of a row for each sensor, bit for bit.

After `t` observations there are at most ``2^t`` groups, and at most one a sensor. A
machine of many sensors has far fewer for long, since most of them hardly ever change.

Groups are numbered as they come. An array of pairs is as in
`neurosnap.poc.learning.pairs`, with groups for sensors.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.graph_kernels import place_of
from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

Numbers = NDArray[Any]
_ONE = np.uint64(1)
EQUAL = 3
"""The code of two sensors that read the same."""
TURNED = np.array([0, 2, 1, 3, 4, *[0] * 3, 8, *[0] * 3, 12], np.uint8)
"""The code of a pair whose sensors change places, by its code."""


class Twins:
    """The groups of twins among some sensors.

    Args:
        of: ``(N,)``: the group of each sensor; each of ``0, 1, ...`` is there.

    Attributes:
        of: As given.
        heads: ``(G,)``: the first sensor of each group.
        literals: ``(2N,)``: for each literal, that of its group.
    """

    def __init__(self, of: NDArray[np.int64]) -> None:
        self.of = of
        self.heads: NDArray[np.int64] = np.unique(of, return_index=True)[1]
        self.literals = _literals(of)

    def __len__(self) -> int:
        """Return the number of groups."""
        return len(self.heads)

    @property
    def are_apart(self) -> bool:
        """Whether each sensor is a group by itself, of its own number."""
        if len(self.heads) < len(self.of):
            return False
        return bool((self.heads == np.arange(len(self.of))).all())

    def part(self, bits: NDArray[np.uint8]) -> NDArray[np.int64]:
        """Part the groups of which not all read the same.

        Args:
            bits: ``(N,)``, 0 or 1.

        Returns:
            The groups parted, ascending. What the first of them has lost is a group of
            the next number, and so on. O(N) time.
        """
        if len(self.heads) == len(self.of) or _agree(bits, self.of, self.heads):
            return _NONE
        gone = np.flatnonzero(bits != bits[self.heads][self.of])
        parents, first, which = np.unique(
            self.of[gone], return_index=True, return_inverse=True
        )
        self.of[gone] = len(self) + which
        self.heads = np.append(self.heads, gone[first])
        self.literals = _literals(self.of)
        return parents

    @property
    def names(self) -> NDArray[np.int64]:
        """``(2G,)``: for each literal of a group, that of its first sensor."""
        return _literals(self.heads)


_NONE = np.empty(0, np.int64)


def _literals(of: NDArray[np.int64]) -> NDArray[np.int64]:
    return (2 * of[:, None] + np.arange(2)).reshape(-1)


@njit()
def _agree(
    bits: NDArray[np.uint8], of: NDArray[np.int64], heads: NDArray[np.int64]
) -> bool:
    """Return whether every sensor reads as the first of its group."""
    for sensor in range(bits.shape[0]):
        if bits[sensor] != bits[heads[of[sensor]]]:
            return False
    return True


def longer(array: Numbers, size: int) -> Numbers:
    """Return a ``(size,)`` array that begins with these numbers.

    It may share their memory, which is twice as long as needed whenever it is taken
    anew: so what is never reached is never touched.
    """
    room = array if array.base is None else array.base
    if len(room) < size:
        room = np.empty(2 * size, array.dtype)
        room[: len(array)] = array
    return room[:size]


@njit()
def copy_pairs(row: int, like: int, values: Numbers, own: Any) -> None:  # noqa: ANN401
    """Let a row of an array of pairs be a copy of an earlier one.

    Args:
        row: Its group.
        like: The earlier group.
        values: ``(P,)`` or longer; updated.
        own: Of the pair of these two.
    """
    start, theirs = place_of(row, 0), place_of(like, 0)
    for j in range(row):
        if j < like:
            values[start + j] = values[theirs + j]
        else:
            values[start + j] = own if j == like else values[place_of(j, 0) + like]


def copy_codes(row: int, like: int, codes: NDArray[np.uint8]) -> None:
    """Do the same with codes, which say which of a pair's sensors is the latter."""
    copy_pairs(row, like, codes, np.uint8(EQUAL))
    behind = slice(place_of(row, 0) + like + 1, place_of(row + 1, 0))
    codes[behind] = TURNED[codes[behind]]


@njit()
def copy_edges(group: int, like: int, rows: Words) -> None:
    """Let the literals of a group have the edges of an earlier one's, and to and fro.

    Args:
        group: It has no edges yet.
        like: The earlier one.
        rows: ``(2G, w)``, closed under contraposition; updated.
    """
    for star in range(2):
        new, old = 2 * group + star, 2 * like + star
        for k in range(rows.shape[1]):
            rows[new, k] = rows[old, k]
        rows[new, old >> 6] |= _ONE << np.uint64(old & 63)
        rows[old, new >> 6] |= _ONE << np.uint64(new & 63)
    # What leads to the one leads to the other: of what its complement leads to.
    for star in range(2):
        new, old = 2 * group + star, 2 * like + star
        for literal in range(2 * group):
            if rows[literal, old >> 6] >> np.uint64(old & 63) & _ONE:
                rows[literal, new >> 6] |= _ONE << np.uint64(new & 63)


@njit()
def of_sensors(
    of: NDArray[np.int64], values: Numbers, own: Numbers, turned: Numbers
) -> Numbers:
    """Return an array of the pairs of sensors from one of the pairs of groups.

    Args:
        of: ``(N,)``, the group of each sensor.
        values: ``(P,)``, of pairs of groups.
        own: ``(G,)``, of a pair of sensors in a group.
        turned: What a value is where the groups are the other way round than the
            sensors; empty if it is the same.
    """
    found = np.empty(place_of(of.shape[0], 0), values.dtype)
    place = 0
    for i in range(of.shape[0]):
        for j in range(i):
            p, q = of[i], of[j]
            if p == q:
                found[place] = own[p]
            elif p > q:
                found[place] = values[place_of(p, 0) + q]
            else:
                value = values[place_of(q, 0) + p]
                found[place] = turned[value] if turned.shape[0] else value
            place += 1
    return found
