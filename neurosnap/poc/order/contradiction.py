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

The graph has a vertex for each literal that clashes, in ascending order; for those of a
group of twins one together, which counts for as many: they clash with the same, so a
cover that needs each of its vertices has all of them or none. Sets of vertices are
masks, as in `neurosnap.poc.order.literal_sets`.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import or_
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import (
    Literals,
    as_literals,
    from_mask,
    from_words,
    members,
    to_mask,
    to_words,
)
from neurosnap.sensorium import complement
from neurosnap.system.compiled import njit

PATIENCE = 2_000
"""Vertices looked at, over all sets of the undecided, before the rest is covered
greedily: about as many microseconds."""
CHAINS = 1_024
"""The most chains that are listed."""
_LOOKS = 20_000  # literals looked at on the way of chains
_ROWS = 256  # literals that clash whose conflicts are found at a time
_MANY = 0.1  # share of words with conflicts, beyond which all are looked at
Ints = NDArray[np.int64]


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
    """The fewest sensors to leave out that the rest is coherent, most suspect first."""
    candidates: tuple[int, ...]
    """All that are in some such set of the fewest, most suspect first."""
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
    suspicion: Callable[[Ints], NDArray[np.float64]],
    *,
    patience: int = PATIENCE,
) -> Contradiction:
    """Return how an observation contradicts an order.

    Args:
        graph: The order.
        observed: A *-selection: one literal of every sensor that has a reading.
        suspicion: How suspect some sensors are, ``(n,)`` and finite: of several
            smallest sets of culprits, the one with the largest sum is returned; of
            several of those, the first in order.
        patience: As for `smallest_cover`: beyond it, culprits are found greedily.

    Cost:
        O(n²/64) time for ``n`` groups if it is coherent. If not, O(1) for each two of
        the groups in conflict, and the search for the culprits.

    Examples:
        >>> g = PocGraph.from_implications(3, [(0, 2), (2, 4)])
        >>> found = contradiction(g, [0, 3, 5], np.zeros_like)
        >>> found.chains, found.culprits
        (((0, 2),), (0,))
        >>> contradiction(g, [0, 5], np.zeros_like).chains
        ((0, 2, 4),)
    """
    seen = as_literals("observed", observed, len(graph))
    # Whatever is below the complement of something seen has it above its own.
    clashing = (seen & complement(graph.up(seen))).nonzero()[0]
    if not len(clashing):
        return Contradiction((), 0, (), (), exact=True)
    groups, which, sizes = _grouped(graph.groups[clashing])
    neighbours = conflicts(graph, groups)
    # A literal below its own complement is to blame by itself.
    mask = sum(1 << v for v, around in enumerate(neighbours) if around >> v & 1)
    left = [0 if mask >> v & 1 else n & ~mask for v, n in enumerate(neighbours)]
    sensors = clashing >> 1
    worth = suspicion(sensors)
    blame = np.bincount(which, worth).astype(np.float64)
    cover = smallest_cover(left, blame, sizes, patience)
    suspects = np.argsort(-worth, kind="stable")

    def named(some: int) -> tuple[int, ...]:
        chosen = from_mask(some, len(groups))[which]
        return tuple(sensors[suspects[chosen[suspects]]].tolist())

    edges = graph.wire_list("hasse")
    literals, ends, more = shortest_chains(
        np.searchsorted(edges, np.arange(len(graph) + 1) << 32),
        edges & 0xFFFFFFFF,
        clashing,
        seen,
        CHAINS,
        _LOOKS,
    )
    way, stops = literals.tolist(), [0, *ends.tolist()]
    return Contradiction(
        chains=tuple(tuple(way[low:high]) for low, high in pairwise(stops)),
        more=int(more),
        culprits=named(mask | cover.chosen),
        candidates=named(mask | cover.candidates),
        exact=cover.exact,
    )


def _grouped(groups: Ints) -> tuple[Ints, Ints, Ints]:
    """Return each group once, by its first literal; which it is of; how many each has.

    ``(k,)``, ``(n,)`` for as many groups as given, and ``(k,)``.
    """
    each, first, which, sizes = np.unique(
        groups, return_index=True, return_inverse=True, return_counts=True
    )
    order = np.argsort(first)
    return each[order], np.argsort(order)[which], sizes[order]


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
    neighbours: Sequence[int],
    worth: NDArray[np.float64],
    sizes: Ints,
    patience: int = PATIENCE,
) -> Cover:
    """Return a smallest vertex cover.

    Args:
        neighbours: ``(k,)``: which vertices are next to each, as masks; symmetric, and
            no vertex is next to itself.
        worth: ``(k,)``, finite: the more, the rather a vertex is chosen.
        sizes: ``(k,)``: for how many each vertex counts.
        patience: How many vertices to look at.

    Cost:
        O(k²) time; and a few operations on masks for each vertex looked at.

    Examples:
        >>> smallest_cover([0b10, 0b101, 0b10], np.zeros(3), np.ones(3, int))
        Cover(chosen=2, candidates=2, exact=True)
        >>> smallest_cover([0b10, 0b01], np.array([0.0, 1.0]), np.ones(2, int))
        Cover(chosen=2, candidates=3, exact=True)
        >>> smallest_cover([0b10, 0b01], np.array([0.0, 1.0]), np.array([1, 3]))
        Cover(chosen=1, candidates=1, exact=True)
    """
    count = len(neighbours)
    order = np.lexsort((np.arange(count), -worth))  # the first are chosen first
    search = _Search(neighbours, worth, sizes)
    met = np.array([*map(search.size, neighbours)], np.int64)
    taken = greedy(neighbours, order, met, sizes)
    needed = search.forced(taken, met)
    cover = Cover(needed, needed, exact=True)
    for part in search.parts(((1 << count) - 1) & ~needed):
        patience = search.solve(part, patience)
        if patience >= 0:
            cover = _joined(cover, search.best[part])
            continue
        patience = 0
        chosen = search.without_spares(part, taken & part, order[::-1].tolist())
        cover = _joined(cover, Cover(chosen, part, exact=False))
    return cover


def greedy(neighbours: Sequence[int], order: Ints, met: Ints, sizes: Ints) -> int:
    """Cover all edges by what meets most of those left, again and again.

    Of those that meet as many it is the first in order. How many each meets, and for
    how many it counts, is ``(k,)``. O(k) time for each.
    """
    taken, count = 0, len(neighbours)
    keys = count * met
    keys[order] += np.arange(count)[::-1]
    while keys.max(initial=0) >= max(count, 1):
        best = int(keys.argmax())
        taken |= 1 << best
        keys[best] = 0
        around = from_mask(neighbours[best], count) & (keys >= count)
        keys[around] -= count * sizes[best]
    return taken


def _joined(one: Cover, other: Cover) -> Cover:
    """Return what covers two parts without an edge in between."""
    return Cover(
        one.chosen | other.chosen,
        one.candidates | other.candidates,
        one.exact and other.exact,
    )


class _Search:
    """The covers of connected parts; `best` has that of each set solved."""

    def __init__(
        self, neighbours: Sequence[int], worth: NDArray[np.float64], sizes: Ints
    ) -> None:
        self.best: dict[int, Cover] = {0: _NOTHING}
        self._worth = worth.tolist()
        self._neighbours = neighbours
        self._sizes = sizes
        self._more = (sizes - 1).tolist()
        self._larger = to_mask(sizes > 1)

    def size(self, some: int) -> int:
        """Return for how many some vertices count."""
        more: int = sum(self._more[v] for v in members(some & self._larger))
        return some.bit_count() + more

    def forced(self, taken: int, met: Ints) -> int:
        """Return what every smallest cover has, where `taken` is some cover.

        That is what meets more edges than its part needs vertices: without it, all its
        neighbours would have to be in the cover. (A rule of S. Buss, see Downey and
        Fellows, Parameterized Complexity, 1999.) How many each meets is ``(k,)``.
        """
        count, met = len(met), met.copy()
        part, most = np.zeros(count, np.int64), [0]
        for number, each in enumerate(self.parts((1 << count) - 1), 1):
            part[[*members(each)]] = number
            most.append(self.size(taken & each))
        left, needed = np.ones(count, np.bool_), np.array(most)
        while len(over := np.flatnonzero(left & (met > needed[part]))):
            np.subtract.at(needed, part[over], self._sizes[over])
            left[over] = False
            for v in over.tolist():
                met[from_mask(self._neighbours[v], count)] -= self._sizes[v]
        return to_mask(~left)

    def without_spares(self, part: int, chosen: int, order: Sequence[int]) -> int:
        """Return a cover without those of it whose neighbours are all in it.

        The first in order are given up first.
        """
        for v in order:
            if chosen >> v & 1 and not self._neighbours[v] & part & ~chosen:
                chosen ^= 1 << v
        return chosen

    def solve(self, wanted: int, patience: int) -> int:
        """Enter the best cover; return the patience left, below 0 if it ran out.

        An explicit stack: a chain of decisions is as long as there are vertices.
        """
        if wanted.bit_count() > patience:
            return -1
        pending = [wanted]
        while pending:
            free = pending[-1]
            if free in self.best:
                pending.pop()
                continue
            patience -= free.bit_count()
            if patience < 0:
                break
            parts = list(self.parts(free))
            if len(parts) == 1:
                pending += self._branch(free, parts[0])
                continue
            missing = [part for part in parts if part not in self.best]
            if not missing:
                covers = (self.best[part] for part in parts)
                self.best[free] = reduce(_joined, covers, _NOTHING)
            pending += missing
        return patience

    def parts(self, free: int) -> Iterator[int]:
        """Yield the connected parts of a set that have an edge."""
        free &= reduce(or_, map(self._neighbours.__getitem__, members(free)), 0)
        while free:
            part = ring = free & -free
            while ring:
                lowest = ring & -ring
                fresh = self._neighbours[lowest.bit_length() - 1] & free & ~part
                part |= fresh
                ring = (ring ^ lowest) | fresh
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
            size = self.size(chosen)
            candidates = 0
            for side in (with_it, without):
                if self.size(side.chosen) == size:
                    candidates |= side.candidates
            self.best[free] = Cover(chosen, candidates, exact=True)
        return missing

    def _pivot(self, part: int) -> int:
        """Return the vertex that meets most edges; then of most worth; then first."""

        def weight(v: int) -> tuple[int, float, int]:
            return self.size(self._neighbours[v] & part), self._worth[v], -v

        return max(members(part), key=weight)

    def _cost(self, cover: int) -> tuple[int, float, list[int]]:
        """Return what a cover is compared by; the sum is rounded once, in any order."""
        chosen = list(members(cover))
        return self.size(cover), -math.fsum(self._worth[v] for v in chosen), chosen


def conflicts(graph: PocGraph, groups: Ints) -> list[int]:
    """Return which of the groups of literals that clash each is in conflict with.

    As masks, ``(k,)``, in the order of the groups: each is below the complement of
    another. O(k²) time.
    """
    closed = graph.closed_groups
    denied = np.zeros(len(closed), np.bool_)
    denied[groups ^ 1] = True
    words, place, masks = to_words(denied), np.cumsum(denied) - 1, list[int]()
    order = place[groups ^ 1]
    moved = bool((np.diff(order) < 0).any())
    for start in range(0, len(groups), _ROWS):
        rows = closed[groups[start : start + _ROWS]] & words
        row, word = rows.nonzero()
        if len(row) > rows.size * _MANY:
            block = from_words(rows, len(closed))[:, denied]
        else:  # as a rule most are in conflict with a few only
            block = np.zeros((len(rows), len(groups)), np.bool_)
            at, bit = from_words(rows[row, word][:, None], 64).nonzero()
            block[row[at], place[64 * word[at] + bit]] = True
        block = block[:, order] if moved else block
        packed = np.packbits(block, axis=1, bitorder="little")
        masks += (int.from_bytes(each.tobytes(), "little") for each in packed)
    return masks


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
