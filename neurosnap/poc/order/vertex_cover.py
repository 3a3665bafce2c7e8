"""A smallest vertex cover, within a bound on the search.

To find one is NP-hard. What meets more edges than vertices suffice is in every smallest
cover: of a few sensors that clash with many, nothing else is left to decide. What is
left depends, after some decisions, only on which vertices are undecided, so a cover is
found by taking one vertex or all its neighbours, remembered by the set of the
undecided, part by connected part: paths, cliques and nested neighbourhoods are quick.
The exact routines at hand (`networkx.max_weight_clique` of the complement) have no
bound, and want whole weights.
"""

import math
from collections.abc import Iterator
from functools import reduce
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.conflicts import (
    forced,
    greedy,
    labels,
    without_spares,
)
from neurosnap.poc.order.literals import Words
from neurosnap.poc.order.masks import members, to_mask

PATIENCE = 2_000
"""Vertices looked at, over all sets of the undecided, before the rest is covered
greedily: about as many microseconds."""


class Cover(NamedTuple):
    """A set of vertices that meets every edge; sets are masks, bit `v` for vertex `v`.

    Where the search ran out of patience `chosen` is still a cover that needs each of
    its vertices, and `candidates` are all vertices of that part of the graph.
    """

    chosen: int
    """Of the smallest covers the one of most worth; of those, the first in order."""
    candidates: int
    """Every vertex that is in some smallest cover."""
    exact: bool
    """Whether all that is certain."""


_NOTHING = Cover(0, 0, exact=True)


def smallest_cover(
    rows: Words, worth: NDArray[np.float64], patience: int = PATIENCE
) -> Cover:
    """Return a smallest vertex cover.

    Args:
        rows: ``(k, ceil(k / 64))``, packed: which vertices are next to each; symmetric,
            and no vertex is next to itself.
        worth: ``(k,)``, finite: the more, the rather a vertex is chosen.
        patience: How many vertices to look at.

    Cost:
        O(k²) time and O(1) an edge, compiled; and a few operations on masks for each
        vertex looked at.

    Example:
        >>> rows = np.array([[0b10], [0b101], [0b10]], np.uint64)
        >>> smallest_cover(rows, np.zeros(3))
        Cover(chosen=2, candidates=2, exact=True)
        >>> smallest_cover(rows[:2] & np.uint64(0b11), np.array([0.0, 1.0]))
        Cover(chosen=2, candidates=3, exact=True)
    """
    count = len(rows)
    degrees = np.bitwise_count(rows).sum(axis=1, dtype=np.int64)
    order = np.lexsort((-np.arange(count), worth))
    rank = np.empty(count, np.int64)
    rank[order] = np.arange(count)
    alive = degrees > 0
    part = labels(rows, alive)
    taken = greedy(rows, degrees.copy(), alive.copy(), rank)
    most = np.bincount(part[taken], minlength=max(1, count)).astype(np.int64)
    forced(rows, degrees, alive, part, most)
    needed = to_mask((part >= 0) & ~alive)
    alive &= degrees > 0
    part = labels(rows, alive)
    cover = Cover(needed, needed, exact=True)
    for first in np.unique(part[alive]).tolist():
        inside = part == first
        search = _Search(rows, worth, inside)
        patience = search.solve(patience)
        if patience >= 0:
            cover = _joined(cover, search.best[search.wanted])
            continue
        patience = 0
        chosen = without_spares(rows, inside, taken[inside[taken]], order)
        cover = _joined(cover, Cover(to_mask(chosen), search.wanted, exact=False))
    return cover


def _joined(one: Cover, other: Cover) -> Cover:
    """Return what covers two parts without an edge in between."""
    return Cover(
        one.chosen | other.chosen,
        one.candidates | other.candidates,
        one.exact and other.exact,
    )


class _Search:
    """The covers of a connected part; `best` has that of each set solved."""

    def __init__(
        self, rows: Words, worth: NDArray[np.float64], inside: NDArray[np.bool_]
    ) -> None:
        self.wanted = to_mask(inside)
        self.best: dict[int, Cover] = {0: _NOTHING}
        self._worth = worth.tolist()
        self._rows = rows
        self._neighbours: dict[int, int] = {}

    def solve(self, patience: int) -> int:
        """Enter the best cover; return the patience left, below 0 if it ran out.

        An explicit stack: a chain of decisions is as long as there are vertices.
        """
        if self.wanted.bit_count() > patience:
            return -1
        for v in members(self.wanted):
            around = int.from_bytes(self._rows[v].tobytes(), "little")
            self._neighbours[v] = around & self.wanted
        pending = [self.wanted]
        while pending:
            free = pending[-1]
            if free in self.best:
                pending.pop()
                continue
            patience -= free.bit_count()
            if patience < 0:
                break
            parts = list(self._parts(free))
            if len(parts) == 1:
                pending += self._branch(free, parts[0])
                continue
            missing = [part for part in parts if part not in self.best]
            if not missing:
                covers = (self.best[part] for part in parts)
                self.best[free] = reduce(_joined, covers, _NOTHING)
            pending += missing
        return patience

    def _parts(self, free: int) -> Iterator[int]:
        """Yield the connected parts of a set that have an edge."""
        while free:
            part = ring = free & -free
            while ring:
                lowest = ring & -ring
                fresh = self._neighbours[lowest.bit_length() - 1] & free & ~part
                part |= fresh
                ring = (ring ^ lowest) | fresh
            if part & (part - 1):
                yield part
            free &= ~part

    def _branch(self, free: int, part: int) -> list[int]:
        """Enter the best cover by one vertex, or return what that still takes."""
        v = self._pivot(part)
        around = self._neighbours[v] & part
        one, other = part & ~(1 << v), part & ~(around | 1 << v)
        missing = [rest for rest in (one, other) if rest not in self.best]
        if not missing:
            with_it = _joined(self.best[one], Cover(1 << v, 1 << v, exact=True))
            without = _joined(self.best[other], Cover(around, around, exact=True))
            chosen = min(with_it.chosen, without.chosen, key=self._cost)
            # A smallest cover has the vertex or all around it: nothing is left out.
            size = chosen.bit_count()
            candidates = 0
            for side in (with_it, without):
                if side.chosen.bit_count() == size:
                    candidates |= side.candidates
            self.best[free] = Cover(chosen, candidates, exact=True)
        return missing

    def _pivot(self, part: int) -> int:
        """Return the vertex that meets most edges; then of most worth; then first."""

        def weight(v: int) -> tuple[int, float, int]:
            return (self._neighbours[v] & part).bit_count(), self._worth[v], -v

        return max(members(part), key=weight)

    def _cost(self, cover: int) -> tuple[int, float, list[int]]:
        """Return what a cover is compared by; the sum is rounded once, in any order."""
        chosen = list(members(cover))
        return len(chosen), -math.fsum(self._worth[v] for v in chosen), chosen
