"""The duality theory by brute force: tries every selection and every subset.

Nothing here uses the code under test. Literals are ints, sets are sets, an order is the
set of its pairs; a vertex is a frozen set of literals.
"""

import itertools
from collections.abc import Collection, Iterable, Iterator
from functools import cached_property
from typing import TypeAlias

from tests.support import oracles
from tests.support.oracles import Edges

Vertex: TypeAlias = frozenset[int]
Vertices: TypeAlias = frozenset[Vertex]


def closed(n: int, edges: Iterable[tuple[int, int]]) -> Edges:
    """The order that edges and their contrapositives generate."""
    given = set(edges)
    return oracles.below_or_equal(n, given | {(b ^ 1, a ^ 1) for a, b in given})


def included(fields: list[list[bool]]) -> Edges:
    """Which literals are on only where which others are."""
    on = [
        {x for x, bit in enumerate(field) if bit == sign}
        for field in fields
        for sign in (True, False)
    ]
    literals = range(len(on))
    return {(a, b) for a in literals for b in literals if on[a] <= on[b]}


def selections(n: int) -> Iterator[Vertex]:
    """All complete *-selections."""
    for bits in itertools.product((0, 1), repeat=n // 2):
        yield frozenset(2 * sensor + bit for sensor, bit in enumerate(bits))


def subsets(items: Iterable[Vertex]) -> Iterator[Vertices]:
    """All sets of some vertices."""
    listed = list(items)
    for size in range(len(listed) + 1):
        for chosen in itertools.combinations(listed, size):
            yield frozenset(chosen)


class Model:
    """A poc set and its dual, each thing straight from its definition."""

    def __init__(self, n: int, edges: Iterable[tuple[int, int]]) -> None:
        self.n = n
        self.literals = range(n)
        self.order = closed(n, edges)

    def equal(self, a: int, b: int) -> bool:
        return {(a, b), (b, a)} <= self.order

    def head(self, a: int) -> int:
        """The first literal equal to `a`."""
        return self._head[a]

    @cached_property
    def _head(self) -> list[int]:
        # Asked for each literal of each two vertices.
        return [
            next(b for b in self.literals if self.equal(a, b)) for a in self.literals
        ]

    def negligible(self, a: int) -> bool:
        return (a, a ^ 1) in self.order

    def proper(self, a: int) -> bool:
        return not self.negligible(a) and not self.negligible(a ^ 1)

    def crosses(self, a: int, b: int) -> bool:
        """Proper, and none of the four relations."""
        both = self.proper(a) and self.proper(b)
        signs = itertools.product((a, a ^ 1), (b, b ^ 1))
        return both and not any(pair in self.order for pair in signs)

    @cached_property
    def heads(self) -> list[int]:
        """One literal of each proper element."""
        return [a for a in self.literals if self.proper(a) and self.head(a) == a]

    def up(self, literals: Iterable[int]) -> set[int]:
        return {b for a in literals for b in self.literals if (a, b) in self.order}

    def coherent(self, literals: Iterable[int]) -> bool:
        return oracles.coherent(self.order, set(literals))

    @cached_property
    def vertices(self) -> list[Vertex]:
        return [u for u in selections(self.n) if self.coherent(u)]

    def apart(self, u: Vertex, v: Vertex) -> set[int]:
        """The elements of `u` that are not in `v`."""
        return {self.head(a) for a in u - v}

    @cached_property
    def joined(self) -> dict[Vertex, list[Vertex]]:
        return {
            u: [v for v in self.vertices if len(self.apart(u, v)) == 1]
            for u in self.vertices
        }

    @cached_property
    def hops(self) -> dict[Vertex, dict[Vertex, int]]:
        """Hop distances, by breadth-first search."""
        found: dict[Vertex, dict[Vertex, int]] = {}
        for start in self.vertices:
            reached, ring = {start: 0}, [start]
            while ring:
                here = ring.pop(0)
                for there in self.joined[here]:
                    if there not in reached:
                        reached[there] = reached[here] + 1
                        ring.append(there)
            found[start] = reached
        return found

    def interval(self, u: Vertex, v: Vertex) -> Vertices:
        d = self.hops
        return frozenset(w for w in self.vertices if d[u][w] + d[w][v] == d[u][v])

    def medians(self, u: Vertex, v: Vertex, w: Vertex) -> Vertices:
        return self.interval(u, v) & self.interval(v, w) & self.interval(u, w)

    def convex(self, chosen: Vertices) -> bool:
        return all(self.interval(u, v) <= chosen for u in chosen for v in chosen)

    def hull(self, chosen: Vertices) -> Vertices:
        while not self.convex(chosen):
            pairs = itertools.combinations(chosen, 2)
            chosen = chosen.union(*(self.interval(u, v) for u, v in pairs))
        return chosen

    def h(self, literals: Iterable[int]) -> Vertices:
        wanted = set(literals)
        return frozenset(u for u in self.vertices if wanted <= u)

    def nearest(self, u: Vertex, among: Vertices) -> Vertices:
        """The vertices of a set at least distance from `u`."""
        least = min(self.hops[u][v] for v in among)
        return frozenset(v for v in among if self.hops[u][v] == least)

    def projection(self, source: Vertices, goal: Vertices) -> Vertices:
        return frozenset(v for u in source for v in self.nearest(u, goal))

    def separators(self, k: Vertices, m: Vertices) -> set[int]:
        """One literal of each element that all of `k` holds and none of `m`."""
        return {
            a
            for a in self.literals
            if self.head(a) == a
            and all(a in u for u in k)
            and all(a ^ 1 in v for v in m)
        }

    def cubes(self, among: Iterable[Vertex]) -> set[Vertices]:
        """The sets of vertices of cubes: all that agree off a set of directions."""
        kept, own = set(among), [a for a in self.heads if not a & 1]
        found = set()
        for size in range(len(own) + 1):
            for ways in itertools.combinations(own, size):
                free = {
                    b for a in self.literals for b in (a, a ^ 1) if self.head(a) in ways
                }
                sides: dict[Vertex, set[Vertex]] = {}
                for u in kept:
                    sides.setdefault(u - free, set()).add(u)
                found |= {frozenset(s) for s in sides.values() if len(s) == 2**size}
        return found


def face_counts(cubes: Iterable[Collection[object]]) -> tuple[int, ...]:
    """How many cubes have 1, 2, 4, … vertices."""
    sizes = [len(cube).bit_length() - 1 for cube in cubes]
    return tuple(sizes.count(d) for d in range(max(sizes, default=-1) + 1))
