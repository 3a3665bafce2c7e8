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

**Shares.** A share of the pairs is of its own sensors with those before them. None of
the ones is in a group with one of the others: so what a new group copies is all in the
share, whichever side it is on. A new group of own sensors is a new row, behind the
others; one of sensors before the share is a new *column*, a place in each row. For
columns there is room before the rows; when it is full, all is laid out anew with half
as much room again.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

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
_ROOM = 8  # columns more than needed, at least


class Parted(NamedTuple):
    """What became of the groups when some of them parted."""

    source: NDArray[np.int64]
    """``(G,)``: the number each had, or had what it was part of; -1: there is none."""
    columns: NDArray[np.int64]
    """The new groups of sensors before the share."""
    rows: range
    """The new ones of the share."""
    first: int
    """The first row that there was."""
    moved: int
    """By how many places the rows that there were have moved."""

    def of_groups(self, values: Numbers) -> Numbers:
        """Return an array whose last axis is the groups, for those there are now."""
        found = values[..., self.source]
        found[..., self.source < 0] = 0
        return found

    def of_pairs(
        self, values: Numbers, size: int, own: Numbers, turned: Numbers | None = None
    ) -> Numbers:
        """Return an array of the pairs, for those there are now.

        Args:
            values: ``(P,)``; where no row changes its place, it may be updated.
            size: How many pairs there are now; 0 where none are kept.
            own: ``(G,)``, of the pair of two parts, by the group that they were.
            turned: What a value is in a pair whose groups change places, by the value;
                the same, if None.
        """
        if not size:
            return values
        first, moved = self.first + self.moved, self.moved > 0
        found = np.zeros(size, values.dtype) if moved else longer(values, size)
        begin, turned = first if moved else self.rows.start, _same(turned, values)
        changed = first, begin, self.columns
        copy_pairs(self.source, changed, found, (values, self.first), own, turned)
        return found

    @property
    def before(self) -> int:
        """How many numbers there were, those of the room included."""
        return self.rows.start - self.moved


class Twins:
    """The groups of twins among some sensors.

    Args:
        labels: ``(S,)``: sensors with the same one are in a group.
        start: The first sensor of the share, if none before it is in a group with any
            from it on.

    Attributes:
        of: ``(S,)``: the group of each sensor.
        heads: ``(G,)``: the first sensor of each group; 0 where there is none.
        first: The first group of the share.
        former: How many groups there are before it; behind them is room.
        literals: ``(2S,)``: for each literal, that of its group.
    """

    def __init__(self, labels: NDArray[np.int64], start: int = 0) -> None:
        self._start = start
        names = 2 * labels + (np.arange(len(labels)) >= start)
        _, heads, of = np.unique(names, return_index=True, return_inverse=True)
        order = np.argsort(heads)
        self.heads: NDArray[np.int64] = heads[order]
        self.of: NDArray[np.int64] = np.argsort(order)[of]
        self.first = self.former = int((self.heads < start).sum())
        self.literals = literals_of(self.of)

    def __len__(self) -> int:
        """Return the number of groups, with the room for more."""
        return len(self.heads)

    @property
    def rows(self) -> range:
        """The groups of the share."""
        return range(self.first, len(self.heads))

    @property
    def are_apart(self) -> bool:
        """Whether each sensor is a group by itself, of its own number."""
        if len(self.heads) != len(self.of):
            return False
        return bool((self.of == np.arange(len(self.of))).all())

    @property
    def in_order(self) -> NDArray[np.int64]:
        """The numbers of the groups that there are, in the order of `heads`."""
        there = np.append(np.arange(self.former), np.arange(self.first, len(self)))
        return there[np.argsort(self.heads[there])]

    @property
    def ranks(self) -> NDArray[np.int64]:
        """``(S,)``: the group of each sensor, if they were numbered by `heads`."""
        ranks = np.zeros(len(self), np.int64)
        order = self.in_order
        ranks[order] = np.arange(len(order))
        return ranks[self.of]

    def places_of(
        self, heads: NDArray[np.int64]
    ) -> Iterator[tuple[int, NDArray[np.int64], NDArray[np.int64]]]:
        """Yield where the pairs of some sensors with those before them are.

        Args:
            heads: ``(H,)``, ascending: each the first of its group, and these numbered
                in that order. The pairs of those in the share are here.

        Yields:
            The latter sensor, the former ones, and where each pair is in an array.
        """
        for k, head in enumerate(heads.tolist()):
            if self._start <= head < len(self.of):
                former = heads[:k]
                place = place_of(int(self.of[head]), self.first)
                yield head, former, place + self.of[former]

    def of_groups(self, values: Numbers) -> Numbers:
        """Return what the first sensor of each group has, 0 where there is none."""
        found = values[self.heads]
        found[self.former : self.first] = 0
        return found

    def part(self, bits: NDArray[np.uint8]) -> Parted | None:
        """Part the groups of which not all read the same; None if all do.

        Args:
            bits: ``(N,)``, 0 or 1.
        """
        there = self.former + len(self.rows)
        if there == len(self.of) or _agree(bits, self.of, self.heads):
            return None
        read = bits[: len(self.of)]
        gone = np.flatnonzero(read != read[self.heads][self.of])
        parents, begin, which = np.unique(
            self.of[gone], return_index=True, return_inverse=True
        )
        new = int((parents < self.first).sum())  # those before the share
        columns, before = self.former + np.arange(new), len(self)
        self.former += new
        first, moved = self.first, 0
        if self.former > first:
            moved = self.former + self.former // 2 + _ROOM - first
        rows = range(before + moved, before + moved + len(parents) - new)
        source = np.full(rows.stop, -1)
        source[: self.former] = np.arange(self.former)
        source[first + moved : before + moved] = np.arange(first, before)
        numbers = np.append(columns, np.arange(rows.start, rows.stop))
        source[numbers] = parents
        parted = Parted(source, columns, rows, first, moved)
        self.of[self.of >= first] += moved
        self.first += moved
        self.heads = parted.of_groups(self.heads)
        self.of[gone], self.heads[numbers] = numbers[which], gone[begin]
        self.literals = literals_of(self.of)
        return parted

    def of_sensors(
        self, values: Numbers, own: Numbers, turned: Numbers | None = None
    ) -> Numbers:
        """Return an array of the pairs of sensors from one of the pairs of groups.

        Args:
            values: ``(P,)``, of pairs of groups.
            own: ``(G,)``, of a pair of sensors in a group.
            turned: As in `Parted.of_pairs`.
        """
        return self._taken(self.of, self._start, values, own, turned)

    def ordered(self, values: Numbers, turned: Numbers | None = None) -> Numbers:
        """Return an array of the pairs of groups, numbered in the order of `heads`."""
        order = self.in_order
        if len(order) == len(self) and (np.diff(order) > 0).all():
            return values
        own = np.zeros(len(self), values.dtype)  # none is in a pair with itself
        return self._taken(order, self.former, values, own, turned)

    def _taken(
        self,
        source: NDArray[np.int64],
        first: int,
        values: Numbers,
        own: Numbers,
        turned: Numbers | None,
    ) -> Numbers:
        size = place_of(len(source), first)
        found, changed = np.empty(size, values.dtype), (first, first, source[:0])
        turned = _same(turned, values)
        copy_pairs(source, changed, found, (values, self.first), own, turned)
        return found

    @property
    def names(self) -> NDArray[np.int64]:
        """``(2G,)``: for each literal of a group, that of its first sensor."""
        return literals_of(self.heads)


def literals_of(of: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return ``(2S,)``: for each literal of sensors, that of what stands for it."""
    return (2 * of[:, None] + np.arange(2)).reshape(-1)


def _same(turned: Numbers | None, values: Numbers) -> Numbers:
    return values[:0] if turned is None else turned


@njit()
def _agree(
    bits: NDArray[np.uint8], of: NDArray[np.int64], heads: NDArray[np.int64]
) -> bool:
    """Return whether every sensor reads as the first of its group."""
    for sensor in range(of.shape[0]):  # noqa: SIM110 - compiled
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
def copy_pairs(
    source: NDArray[np.int64],
    changed: tuple[int, int, NDArray[np.int64]],
    values: Numbers,
    there: tuple[Numbers, int],
    own: Numbers,
    turned: Numbers,
) -> None:
    """Write what has changed in an array of pairs whose sensors or groups others are.

    Args:
        source: ``(G,)``: what each was in the array that there is; -1: nothing.
        changed: The first row; the first of those that are written whole; and which
            columns of the rows before that are.
        values: ``(P,)``; updated. It may be the array that there is, if what is
            written is not read.
        there: That array, and its first row.
        own: What the pair of two that were one has, by what they were.
        turned: What a value is where the two change places; empty if it is the same.
    """
    first, begin, columns = changed
    old, start = there
    for i in range(first, source.shape[0]):
        whole, row = i >= begin, place_of(i, first)
        for k in range(i if whole else columns.shape[0]):
            j = k if whole else columns[k]
            p, q = source[i], source[j]
            if q < 0:
                values[row + j] = 0
            elif p == q:
                values[row + j] = own[p]
            elif p > q:
                values[row + j] = old[place_of(p, start) + q]
            else:
                value = old[place_of(q, start) + p]
                values[row + j] = turned[value] if turned.shape[0] else value


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
