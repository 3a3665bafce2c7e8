"""A smallest vertex cover, within a bound on the search.

To find one is NP-hard. What is left to decide after some decisions depends only on
which vertices are undecided, so a cover is found by taking one vertex or all its
neighbours, remembered by the set of the undecided, part by connected part: stars,
paths, cliques and nested neighbourhoods are quick. The exact routines at hand
(`networkx.max_weight_clique` of the complement) have no bound, and want whole weights.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from typing import NamedTuple

from neurosnap.poc.order.masks import members

PATIENCE = 100_000
"""Vertices looked at in a connected part, over all sets of the undecided, before it is
covered greedily: 5000 sets of 20, or 500 of 200."""


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


def smallest_cover(
    neighbours: Mapping[int, int], worth: Sequence[float], patience: int = PATIENCE
) -> Cover:
    """Return a smallest vertex cover.

    Args:
        neighbours: Of each vertex with an edge, the mask of those next to it; no vertex
            is next to itself.
        worth: Of every vertex, finite: the more, the rather it is chosen.
        patience: How many vertices to look at in a connected part.

    Cost:
        At most `patience` vertices a connected part, a few operations on masks each.

    Example:
        >>> smallest_cover({0: 0b10, 1: 0b101, 2: 0b10}, [0, 0, 0])
        Cover(chosen=2, candidates=2, exact=True)
        >>> smallest_cover({0: 0b10, 1: 0b01}, [0, 1])
        Cover(chosen=2, candidates=3, exact=True)
    """
    search = _Search(neighbours, worth)
    cover = Cover(0, 0, exact=True)
    for part in search.parts(sum(1 << v for v in neighbours)):
        if search.solve(part, patience):
            cover = _joined(cover, search.best[part])
        else:
            cover = _joined(cover, Cover(search.greedy(part), part, exact=False))
    return cover


def _joined(one: Cover, other: Cover) -> Cover:
    """Return what covers two parts without an edge in between."""
    return Cover(
        one.chosen | other.chosen,
        one.candidates | other.candidates,
        one.exact and other.exact,
    )


class _Search:
    """What is known of a graph's covers; `best` has that of each set solved."""

    def __init__(self, neighbours: Mapping[int, int], worth: Sequence[float]) -> None:
        self.best: dict[int, Cover] = {0: Cover(0, 0, exact=True)}
        self._neighbours = neighbours
        self._worth = worth

    def solve(self, wanted: int, patience: int) -> bool:
        """Enter the best cover of a set; False if out of patience.

        An explicit stack: a chain of decisions is as long as there are vertices.
        """
        pending = [wanted]
        while pending:
            free = pending[-1]
            if free in self.best:
                pending.pop()
                continue
            patience -= free.bit_count()
            if patience < 0:
                return False
            parts = list(self.parts(free))
            if len(parts) == 1:
                pending += self._branch(free, parts[0])
                continue
            missing = [part for part in parts if part not in self.best]
            if not missing:
                covers = (self.best[part] for part in parts)
                self.best[free] = reduce(_joined, covers, self.best[0])
            pending += missing
        return True

    def parts(self, free: int) -> Iterator[int]:
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

    def greedy(self, part: int) -> int:
        """Return a cover that takes what meets most edges, and then gives up spares."""
        chosen, free = 0, part
        while left := next(self.parts(free), 0):
            taken = 1 << self._pivot(left)
            chosen |= taken
            free &= ~taken
        for v in sorted(members(chosen), key=lambda v: (self._worth[v], -v)):
            if not self._neighbours[v] & part & ~chosen:
                chosen &= ~(1 << v)
        return chosen

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
