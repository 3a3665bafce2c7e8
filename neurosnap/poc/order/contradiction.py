"""Explains why an observation contradicts what was learned, and names suspects.

An observation is incoherent iff it holds some ``a`` and ``b`` with ``a <= b*``: the
order says ``a`` implies ``b*``, and ``b`` is what was seen. The pairs of sensors that
clash so make a graph; leaving out the sensors of a vertex cover of it leaves a coherent
observation, and nothing less does. So the fewest sensors that can be to blame are a
smallest vertex cover. That the fewest are to blame is an assumption, and the only one.

To find a smallest vertex cover is NP-hard. What meets more edges than vertices suffice
is in every one: of a few sensors that clash with many, nothing else is left to decide.
What is left depends, after some decisions, only on which vertices are undecided, so a
cover is found by taking one vertex or all its neighbours, remembered by the set of the
undecided, part by connected part: paths, cliques and nested neighbourhoods are quick.
The exact routines at hand (`networkx.max_weight_clique` of the complement) have no
bound, and want whole weights.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.conflicts import (
    conflict_rows,
    forced,
    greedy,
    labels,
    shortest_chains,
    without_spares,
)
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import Literals, Words, as_literals, to_words
from neurosnap.poc.order.masks import members, to_mask
from neurosnap.sensorium import complement

PATIENCE = 2_000
"""Vertices looked at, over all sets of the undecided, before the rest is covered
greedily: about as many microseconds."""
CHAINS = 1_024
"""The most chains that are listed."""
_LOOKS = 20_000  # literals looked at on the way of chains


@dataclass(frozen=True, slots=True)
class Contradiction:
    """How an observation breaks an order ([GK] defn:coherence); empty if it does not.

    An implication ``a -> c`` is broken iff ``a <= c`` while ``a`` and ``c*`` were
    observed. It stands for its contrapositive ``c* -> a*`` too: of the two it is the
    one with the smaller source.
    """

    chains: tuple[tuple[int, ...], ...]
    """Why: for each broken ``a -> c`` that follows from no other two, a shortest way
    from ``a`` to ``c`` along `PocGraph.hasse`, through sensors without a reading. It is
    two literals, a learned implication, wherever every sensor has one."""
    more: int
    """For how many such implications, at least, none is listed."""
    culprits: tuple[int, ...]
    """Sensors, ascending: the fewest to leave out that the rest is coherent."""
    candidates: tuple[int, ...]
    """Sensors, ascending: all that are in some such set of the fewest."""
    exact: bool
    """Whether the search was complete. If not, leaving out the culprits helps and
    leaving out fewer of them does not, but others may do with fewer; and candidates
    may be too many."""

    @property
    def coherent(self) -> bool:
        """Whether there is none."""
        return not self.culprits


def contradiction(
    graph: PocGraph,
    observed: Literals,
    suspicion: ArrayLike | None = None,
    *,
    patience: int = PATIENCE,
) -> Contradiction:
    """Return how an observation contradicts an order.

    Args:
        graph: The order.
        observed: A *-selection: one literal of every sensor that has a reading.
        suspicion: ``(N,)``, finite: of several smallest sets of culprits, the one with
            the largest sum is returned; of several of those, the first in order. If
            None, all are alike.
        patience: As for `smallest_cover`: beyond it, culprits are found greedily.

    Cost:
        O(N²/64) time if it is coherent. If not, O(k N/64) for ``k`` literals in
        conflict, O(1) for each two of them, and the search for the culprits.

    Raises:
        ShapeError: `observed` or `suspicion` has another shape.
        InvalidValueError: `observed` holds a literal and its complement, or an entry
            that is no literal; or `suspicion` is not finite.

    Examples:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> found = contradiction(g, [0, 3, 5])
        >>> found.chains, found.culprits
        (((0, 2),), (0,))
        >>> contradiction(g, [0, 5]).chains
        ((0, 2, 4),)
    """
    seen = as_literals("observed", observed, len(graph))
    both = seen[::2] & seen[1::2]
    if both.any():
        rule = "must not hold a literal and its complement"
        raise InvalidValueError("observed", rule, int(2 * both.argmax()))
    worth = _checked(suspicion, graph.sensors)
    # Whatever is below the complement of something seen has it above its own.
    clashing = (seen & complement(graph.up(seen))).nonzero()[0]
    if not len(clashing):
        return Contradiction((), 0, (), (), exact=True)
    rows = conflict_rows(graph.closed, clashing, to_words(complement(seen)))
    vertices = np.arange(len(rows))
    # A literal below its own complement is to blame by itself.
    alone = rows[vertices, vertices >> 6] >> (vertices & 63).astype(np.uint64) & 1 > 0
    if alone.any():
        rows &= ~to_words(alone)
        rows[alone] = 0
    sensors = clashing >> 1
    cover = smallest_cover(rows, worth[sensors], patience)
    edges = graph.wire_list("hasse")
    literals, ends, more = shortest_chains(
        np.searchsorted(edges, np.arange(len(graph) + 1) << 32),
        edges & 0xFFFFFFFF,
        clashing,
        seen,
        CHAINS,
        _LOOKS,
    )
    mask, way, stops = to_mask(alone), literals.tolist(), [0, *ends.tolist()]
    return Contradiction(
        chains=tuple(tuple(way[low:high]) for low, high in pairwise(stops)),
        more=int(more),
        culprits=tuple(sensors[list(members(mask | cover.chosen))].tolist()),
        candidates=tuple(sensors[list(members(mask | cover.candidates))].tolist()),
        exact=cover.exact,
    )


def _checked(suspicion: ArrayLike | None, sensors: int) -> NDArray[np.float64]:
    """Return the suspicion as an array."""
    if suspicion is None:
        return np.zeros(sensors)
    worth = np.asarray(suspicion, np.float64)
    if worth.shape != (sensors,):
        raise ShapeError("suspicion", f"must be ({sensors},)", worth.shape)
    if not np.isfinite(worth).all():
        value = worth[~np.isfinite(worth)][0].item()
        raise InvalidValueError("suspicion", "must be finite", value)
    return worth


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

    Examples:
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
