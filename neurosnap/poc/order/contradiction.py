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

Sets are packed as in `neurosnap.poc.order.literals`. The graph has a vertex for each
literal that clashes, in ascending order; its rows are packed the same way, a bit for
each vertex.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.kernels import lowest
from neurosnap.poc.order.literals import Literals, Words, as_literals, to_words
from neurosnap.poc.order.masks import members, to_mask
from neurosnap.sensorium import complement
from neurosnap.system.compiled import njit

PATIENCE = 2_000
"""Vertices looked at, over all sets of the undecided, before the rest is covered
greedily: about as many microseconds."""
CHAINS = 1_024
"""The most chains that are listed."""
_LOOKS = 20_000  # literals looked at on the way of chains
Ints = NDArray[np.int64]
_ONE = np.uint64(1)


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
    suspicion: NDArray[np.float64],
    *,
    patience: int = PATIENCE,
) -> Contradiction:
    """Return how an observation contradicts an order.

    Args:
        graph: The order.
        observed: A *-selection: one literal of every sensor that has a reading.
        suspicion: ``(N,)``, finite: of several smallest sets of culprits, the one with
            the largest sum is returned; of several of those, the first in order.
        patience: As for `smallest_cover`: beyond it, culprits are found greedily.

    Cost:
        O(N²/64) time if it is coherent. If not, O(k N/64) for ``k`` literals in
        conflict, O(1) for each two of them, and the search for the culprits.

    Examples:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> found = contradiction(g, [0, 3, 5], np.zeros(3))
        >>> found.chains, found.culprits
        (((0, 2),), (0,))
        >>> contradiction(g, [0, 5], np.zeros(3)).chains
        ((0, 2, 4),)
    """
    seen = as_literals("observed", observed, len(graph))
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
    cover = smallest_cover(rows, suspicion[sensors], patience)
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


@njit()
def conflict_rows(closed: Words, clashing: Ints, denied: Words) -> Words:
    """Return which of the literals that clash are in conflict with each other.

    Args:
        closed: ``(2N, w)``: bit ``b`` of row ``a`` iff ``a <= b``.
        clashing: ``(k,)``, ascending: literals seen that are below one denied.
        denied: ``(w,)``: the complements of what was seen.

    Returns:
        ``(k, ceil(k / 64))``, symmetric; a bit on the diagonal is a literal below its
        own complement. O(k w) time, and O(1) for each bit.
    """
    count, width = clashing.shape[0], denied.shape[0]
    place = np.full(64 * width, -1, np.int64)
    for vertex in range(count):
        place[clashing[vertex] ^ 1] = vertex
    rows = np.zeros((count, (count + 63) // 64), np.uint64)
    for vertex in range(count):
        a = clashing[vertex]
        for k in range(width):
            found = closed[a, k] & denied[k]
            while found:
                other = place[64 * k + lowest(found)]
                rows[vertex, other >> 6] |= _ONE << np.uint64(other & 63)
                found &= found - _ONE
    return rows


@njit()
def labels(rows: Words, alive: NDArray[np.bool_]) -> Ints:
    """Return the connected part of each vertex, named by its first; -1 if not alive.

    Args:
        rows: ``(k, w)``, symmetric.
        alive: ``(k,)``: the vertices there are.

    Returns:
        ``(k,)``. O(k w) time.
    """
    count, width = rows.shape
    part = np.full(count, -1, np.int64)
    fresh = _packed(alive, width)
    queue = np.empty(count, np.int64)
    for root in range(count):
        if not (fresh[root >> 6] >> np.uint64(root & 63)) & _ONE:
            continue
        fresh[root >> 6] ^= _ONE << np.uint64(root & 63)
        queue[0], first, last = root, 0, 1
        while first < last:
            v = queue[first]
            first += 1
            part[v] = root
            for k in range(width):
                found = rows[v, k] & fresh[k]
                fresh[k] ^= found
                while found:
                    queue[last] = 64 * k + lowest(found)
                    last += 1
                    found &= found - _ONE
    return part


@njit()
def greedy(rows: Words, degrees: Ints, alive: NDArray[np.bool_], rank: Ints) -> Ints:
    """Cover all edges by what meets most of those left, again and again.

    Args:
        rows: ``(k, w)``, symmetric, no bit on the diagonal.
        degrees: ``(k,)``, of the vertices alive, among these; changed.
        alive: ``(k,)``; what is taken is no longer.
        rank: ``(k,)``: of two that meet as many, the one of higher rank is taken.

    Returns:
        What was taken, in order. O(k) time for each, and O(1) an edge.
    """
    count = rows.shape[0]
    taken = np.empty(count, np.int64)
    number = 0
    while True:
        best = -1
        for v in range(count):
            if not alive[v] or degrees[v] == 0:
                continue
            more = 1 if best < 0 else degrees[v] - degrees[best]
            if more > 0 or (more == 0 and rank[v] > rank[best]):
                best = v
        if best < 0:
            return taken[:number]
        taken[number] = best
        number += 1
        remove_vertex(rows, degrees, alive, best)


@njit()
def remove_vertex(rows: Words, degrees: Ints, alive: NDArray[np.bool_], v: int) -> None:
    """Remove a vertex and its edges from a graph; see `greedy`."""
    alive[v] = False
    degrees[v] = 0
    for k in range(rows.shape[1]):
        found = rows[v, k]
        while found:
            u = 64 * k + lowest(found)
            found &= found - _ONE
            if alive[u]:
                degrees[u] -= 1


@njit()
def forced(
    rows: Words,
    degrees: Ints,
    alive: NDArray[np.bool_],
    part: Ints,
    most: Ints,
) -> None:
    """Take out what every smallest cover has.

    That is what meets more edges than its connected part needs vertices: without it,
    all its neighbours would have to be in the cover. (A rule of S. Buss, see Downey and
    Fellows, Parameterized Complexity, 1999.)

    `part` and `most` are ``(k,)``: the part of each vertex, as `labels` says, and for
    each part a number of vertices that suffice. The rest is as in `greedy`; all but
    `rows` and `part` is changed.
    """
    changed = True
    while changed:
        changed = False
        for v in range(rows.shape[0]):
            if alive[v] and degrees[v] > most[part[v]]:
                most[part[v]] -= 1
                remove_vertex(rows, degrees, alive, v)
                changed = True


@njit()
def without_spares(
    rows: Words, inside: NDArray[np.bool_], taken: Ints, order: Ints
) -> NDArray[np.bool_]:
    """Return a cover without those of it whose neighbours are all in it.

    Args:
        rows: ``(k, w)``, symmetric.
        inside: ``(k,)``: the vertices to be looked at, taken or not.
        taken: The cover.
        order: ``(k,)``, all vertices: the first are given up first.

    Returns:
        ``(k,)``. O(k w) time.
    """
    count, width = rows.shape
    chosen = np.zeros(count, np.bool_)
    for v in taken:
        chosen[v] = True
    outside = _packed(inside & ~chosen, width)
    for v in order:
        if not chosen[v]:
            continue
        spare = True
        for k in range(width):
            spare &= not rows[v, k] & outside[k]
        if spare:
            chosen[v] = False
            outside[v >> 6] |= _ONE << np.uint64(v & 63)
    return chosen


@njit()
def shortest_chains(
    starts: Ints,
    targets: Ints,
    clashing: Ints,
    seen: NDArray[np.bool_],
    most: int,
    looks: int,
) -> tuple[Ints, Ints, int]:
    """Return a shortest way from each literal that clashes to each that it denies.

    Along any way from something seen to something denied there is a last literal seen
    before the first one denied: between those two lie sensors without a reading.

    Args:
        starts: ``(2N + 1,)``: where in `targets` the covers of each literal begin.
        targets: The covers of all literals, those of each ascending.
        clashing: ``(k,)``: literals seen, ascending.
        seen: ``(2N,)``.
        most: How many to list; then the others are counted where one cover leads there.
        looks: At how many literals to look on the way; then likewise.

    Returns:
        The literals of all ways, one after the other; where each ends in it; and how
        many more there are, at least.
    """
    total = starts.shape[0] - 1
    came = np.empty(total, np.int64)
    walk = np.full(total, -1, np.int64)  # on whose walk each was met last
    queue = np.empty(total, np.int64)
    literals = np.empty(1024, np.int64)
    ends = np.empty(1024, np.int64)
    length = listed = more = 0
    for start in clashing:
        walks = listed < most and looks > 0
        walk[start] = start
        queue[0], first, last = start, 0, 1
        while first < last:
            a = queue[first]
            first += 1
            looks -= 1
            for b in targets[starts[a] : starts[a + 1]]:
                if walk[b] == start or seen[b]:
                    continue
                if not seen[b ^ 1]:
                    if walks:
                        walk[b], came[b] = start, a
                        queue[last] = b
                        last += 1
                    continue
                walk[b], came[b] = start, a
                if start > b ^ 1:
                    continue
                if not walks or listed >= most:
                    more += 1
                    continue
                hops, at = 1, b
                while at != start:
                    at = came[at]
                    hops += 1
                while length + hops > literals.shape[0]:
                    literals = np.append(literals, np.empty_like(literals))
                at = b
                for step in range(hops):
                    literals[length + hops - 1 - step] = at
                    at = came[at]
                length += hops
                if listed == ends.shape[0]:
                    ends = np.append(ends, np.empty_like(ends))
                ends[listed] = length
                listed += 1
    return literals[:length], ends[:listed], more


@njit()
def _packed(chosen: NDArray[np.bool_], width: int) -> Words:
    words = np.zeros(width, np.uint64)
    for v in range(chosen.shape[0]):
        if chosen[v]:
            words[v >> 6] |= _ONE << np.uint64(v & 63)
    return words
