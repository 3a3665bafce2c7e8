"""The space of all coherent states: its states, distances, medians and projections.

A vertex is a complete coherent *-selection, one literal of every sensor. The walk
decides one element after another: what is coherent so far always extends to a vertex,
so there are no dead ends, every decision that is not forced leads to at least two
vertices, and memory holds one path of decisions. Listing costs as much as there is to
list; what can be said without listing (counting, distances, medians, convex sets,
projections) is said without.
"""

from collections.abc import Iterable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.mask_dual import LISTABLE, Dual
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Literals, as_literals, members, to_mask
from neurosnap.poc.order.pocset import Element, PocSet

Vertex: TypeAlias = NDArray[np.bool_]
"""``(2N,)`` bool, a complete coherent *-selection."""


class ConvexSet:
    """The vertices that hold all of some literals ([GK] eqn:typical convex set).

    Made by the methods of `Cubing`; iterates over its vertices. It is kept as what its
    vertices share, so it takes no more room than one vertex however many it holds, and
    two are equal iff these literals are. What only a set with a vertex has raises
    `InvalidValueError` if it is empty.

    Args:
        dual: Where it lies.
        mask: What its vertices share, a closed set; None if it is empty.
    """

    __slots__ = ("dual", "mask")

    def __init__(self, dual: Dual, mask: int | None) -> None:
        self.dual = dual
        self.mask = mask

    @property
    def is_empty(self) -> bool:
        """Whether it has no vertex."""
        return self.mask is None

    @property
    def literals(self) -> NDArray[np.bool_]:
        """``(2N,)`` bool: the literals that all its vertices hold."""
        return self.dual.array(self.filled("convex set"))

    def vertices(self, limit: int | None = LISTABLE) -> Iterator[NDArray[np.bool_]]:
        """Yield the vertices, each a new ``(2N,)`` bool array, in a fixed order.

        Args:
            limit: The most there may be; if None, as many as there are.

        Raises:
            InvalidValueError: There are more than `limit`.
        """
        if self.mask is None:
            return
        for number, vertex in enumerate(self.dual.walk(self.mask)):
            if number == limit:
                rule = f"must have at most {limit} vertices, or set limit=None"
                raise InvalidValueError("dual", rule, "more")
            yield self.dual.array(vertex)

    def count(self) -> int:
        """Return the number of vertices, without listing them."""
        if self.mask is None:
            return 0
        return self.dual.counter.vertices(self.dual.free(self.mask))

    def first(self) -> NDArray[np.bool_]:
        """Return its first vertex."""
        return self.dual.array(next(self.dual.walk(self.filled("convex set"))))

    def filled(self, name: str) -> int:
        """Return its mask."""
        if self.mask is None:
            raise InvalidValueError(name, "must not be empty", self)
        return self.mask

    def __iter__(self) -> Iterator[NDArray[np.bool_]]:
        return self.vertices()

    def __len__(self) -> int:
        return self.count()

    def __bool__(self) -> bool:
        return self.mask is not None

    def __contains__(self, vertex: Literals) -> bool:
        given = self.dual.vertex("vertex", vertex)
        return self.mask is not None and not self.mask & ~given

    def __and__(self, other: "ConvexSet") -> "ConvexSet":
        """Return the vertices in both."""
        if other.dual is not self.dual:
            raise InvalidValueError("convex set", "must be of the same cubing", other)
        if self.mask is None or other.mask is None:
            return ConvexSet(self.dual, None)
        shared = self.mask | other.mask
        return ConvexSet(self.dual, self.dual.closed(self.dual.array(shared)))

    def __le__(self, other: "ConvexSet") -> bool:
        """Return whether all its vertices are in the other."""
        return (self & other) == self

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, ConvexSet):
            return NotImplemented
        return self.dual is other.dual and self.mask == other.mask

    def __hash__(self) -> int:
        return hash((id(self.dual), self.mask))

    def __repr__(self) -> str:
        if self.mask is None:
            return "ConvexSet(empty)"
        names = [self.dual.poc.name(a) for a in np.flatnonzero(self.literals).tolist()]
        return f"ConvexSet({{{', '.join(names)}}})"


Convex: TypeAlias = ConvexSet | Literals
"""A convex set, or literals for the vertices that hold them; a vertex is itself."""


class Cubing:
    """The dual cubing of a poc set, or of what a graph generates ([GK] defn:dual).

    Vertices are ``(2N,)`` bool arrays; two are joined if they differ in one element,
    which is one sensor and all sensors equal to it; pairwise crossing elements span
    cubes. Negligible literals are in no vertex, ubiquitous ones in all. What is said to
    be a vertex and is none, or is projected to or from an empty set, is refused by
    `InvalidValueError`.

    Examples:
        >>> c = Cubing(PocSet.parse("a, b, c : a < c*, b < c*"))
        >>> len(c), c.face_vector()
        (5, (5, 5, 1))
    """

    def __init__(self, poc: PocSet | PocGraph) -> None:
        if isinstance(poc, PocGraph):
            poc = PocSet.from_graph(poc)
        if not isinstance(poc, PocSet):
            raise InvalidValueError("poc", "must be a PocSet or a PocGraph", poc)
        self._dual = Dual(poc)

    @property
    def poc(self) -> PocSet:
        """The poc set it is the dual of."""
        return self._dual.poc

    def vertices(self, limit: int | None = LISTABLE) -> Iterator[Vertex]:
        """Yield the vertices, in a fixed order.

        Args:
            limit: The most there may be; if None, as many as there are.

        Yields:
            ``(2N,)`` bool, a new array each. O(N) set operations a vertex, O(N)
            memory.

        Raises:
            InvalidValueError: There are more than `limit`; raised once it is passed.

        Examples:
            >>> [v.tolist() for v in Cubing(PocSet(1)).vertices()]
            [[True, False], [False, True]]
        """
        return self.convex_set([]).vertices(limit)

    def count(self) -> int:
        """Return how many vertices there are, without listing them.

        Fast wherever decisions take the order apart: chains, trees, sums, and what
        falls into those. An order that stays in one piece may take time exponential
        in its width.
        """
        return self._dual.counter.vertices(self._dual.heads)

    def __len__(self) -> int:
        """Return the number of vertices; use `count` where ``sys.maxsize`` is less."""
        return self.count()

    def face_vector(self) -> tuple[int, ...]:
        """Return the number of cubes of each dimension, from 0 up; costs as `count`.

        Examples:
            >>> Cubing(PocSet(60)).face_vector()[:2] == (2**60, 60 * 2**59)
            True
        """
        return self._dual.counter.faces(self._dual.heads)

    @property
    def dimension(self) -> int:
        """The largest dimension of a cube."""
        return len(self.face_vector()) - 1

    def base(self) -> Vertex:
        """Return the first vertex: a sensor's own literal where there is a choice.

        Examples:
            >>> Cubing(PocSet.parse("a, b : a < b*")).base()
            array([ True, False, False,  True])
        """
        return self.convex_set([]).first()

    def is_vertex(self, literals: Literals) -> bool:
        """Return whether a set of literals is a vertex."""
        chosen = as_literals("literals", literals, self._dual.total)
        one_each = bool((chosen[::2] != chosen[1::2]).all())
        return one_each and self.poc.is_coherent(chosen)

    def minimal(self, u: Literals) -> NDArray[np.bool_]:
        """Return the proper literals of a vertex with nothing below them in it.

        [GK] lemma:flipping leaves out that they are proper: a ubiquitous literal may
        have nothing below it in `u`, but its complement is in no vertex.

        Returns:
            ``(2N,)`` bool; equal literals are in it together.
        """
        vertex, chosen = self._dual.vertex("u", u), 0
        for a in members(self._dual.minimal(vertex)):
            chosen |= self._dual.up[a] & self._dual.down[a]
        return self._dual.array(chosen)

    def neighbours(self, u: Literals) -> Iterator[Vertex]:
        """Yield the vertices joined to `u`: one minimal element flipped.

        [GK] lemma:flipping. In the order of the flipped literals.
        """
        vertex = self._dual.vertex("u", u)
        minimal = members(self._dual.minimal(vertex))
        return (self._dual.array(self._dual.flip(vertex, a)) for a in minimal)

    def flip(self, u: Literals, literals: Iterable[int]) -> Vertex:
        """Return `u` with some of its elements exchanged for their complements.

        Raises:
            InvalidValueError: `u` is no vertex, a literal is not in it, or what comes
                out is not coherent: one that stays is below one that goes.
        """
        vertex = self._dual.vertex("u", u)
        chosen = as_literals("literals", literals, self._dual.total)
        goes = 0
        for a in np.flatnonzero(chosen).tolist():
            if not vertex >> a & 1:
                raise InvalidValueError("literal", "must be in u", self.poc.name(a))
            goes |= self._dual.up[a] & self._dual.down[a]
        flipped = self._dual.array(vertex & ~goes | self._dual.star(goes))
        return self._dual.array(self._dual.vertex("flipped", flipped))

    def cubes_at(self, u: Literals) -> Iterator[tuple[int, ...]]:
        """Yield the cubes at a vertex: the crossing sets of its minimal elements.

        [GK] lemma:where cubes come from. The cube of a set of literals of `u` has as
        its vertices what `flip` makes of `u` with any of them.

        Yields:
            The literals, ascending, one for each element; ``()`` for `u` itself.
        """
        vertex = self._dual.vertex("u", u)
        return self._dual.crossing(self._dual.minimal(vertex))

    def cubes(
        self, dimension: int | None = None, limit: int | None = LISTABLE
    ) -> Iterator[tuple[Vertex, tuple[int, ...]]]:
        """Yield every cube once, from its corner with all its positive literals.

        Args:
            dimension: Only those of this dimension; if None, all.
            limit: As for `vertices`.

        Yields:
            A vertex and the literals that are flipped, as `cubes_at` has them.
        """
        for corner in self.vertices(limit):
            own = self._dual.minimal(to_mask(corner)) & self._dual.even
            for literals in self._dual.crossing(own):
                if dimension is None or len(literals) == dimension:
                    yield corner.copy(), literals

    def distance(self, u: Literals, v: Literals) -> int:
        """Return the hops from `u` to `v`: the elements they differ in.

        [GK] lemma:ellone metric is hop metric.
        """
        here, there = self._dual.vertex("u", u), self._dual.vertex("v", v)
        return (here & ~there & self._dual.heads).bit_count()

    def median(self, u: Literals, v: Literals, w: Literals) -> Vertex:
        """Return the majority vote ``(u & v) | (u & w) | (v & w)``.

        [GK] eqn:median formula; the only vertex between any two of the three.
        """
        named = (("u", u), ("v", v), ("w", w))
        x, y, z = (self._dual.vertex(name, given) for name, given in named)
        return self._dual.array(x & y | x & z | y & z)

    def convex_set(self, literals: Convex) -> ConvexSet:
        """Return ``h(B)``, the vertices that hold all of some literals.

        [GK] eqn:typical convex set; with a current state for `B` these are the
        vertices that remain possible. Empty if `B` is not coherent.

        Raises:
            InvalidValueError: A convex set of another cubing is given.

        Examples:
            >>> c = Cubing(PocSet.parse("a, b, c : a < b"))
            >>> len(c.convex_set([0])), len(c.convex_set([0, 3]))
            (2, 0)
        """
        if not isinstance(literals, ConvexSet):
            chosen = as_literals("literals", literals, self._dual.total)
            return ConvexSet(self._dual, self._dual.closed(chosen))
        if literals.dual is not self._dual:
            rule = "must be of the same cubing"
            raise InvalidValueError("convex set", rule, literals)
        return literals

    def halfspace(self, a: Element) -> ConvexSet:
        """Return ``h(a)``, the vertices that hold a literal; empty if negligible.

        Args:
            a: A literal by number or by name, or one of the bounds.
        """
        number = self.poc.element(a)
        if number == self.poc.minimum:
            return ConvexSet(self._dual, None)
        return self.convex_set([] if number == self.poc.maximum else [number])

    def interval(self, u: Literals, v: Literals) -> ConvexSet:
        """Return the vertices on shortest paths from `u` to `v`: ``h(u & v)``."""
        return self.convex_hull([u, v])

    def convex_hull(self, vertices: Iterable[Literals]) -> ConvexSet:
        """Return the smallest convex set that holds some vertices.

        Raises:
            InvalidValueError: There is none, or one is no vertex.
        """
        shared: int | None = None
        for given in vertices:
            vertex = self._dual.vertex("vertex", given)
            shared = vertex if shared is None else shared & vertex
        if shared is None:
            raise InvalidValueError("vertices", "must be at least one", vertices)
        return self.convex_set(self._dual.array(shared))

    def separators(self, k: Convex, m: Convex) -> NDArray[np.bool_]:
        """Return the literals that all of `k` holds and none of `m`, ``(2N,)`` bool.

        [GK] eqn:separator. Their elements are as many as the hops between the sets;
        equal literals are in it together.
        """
        here, there = self._filled("k", k), self._filled("m", m)
        return self._dual.array(here & self._dual.star(there))

    def nearest(self, u: Literals, onto: Convex) -> Vertex:
        """Return the vertex of a convex set closest to `u`: its projection.

        [GK] cor:projection of a point, ``(u - down(T*)) | up(T)`` for ``h(T)``.
        """
        vertex, goal = self._dual.vertex("u", u), self._filled("onto", onto)
        return self._dual.array(vertex & ~self._dual.star(goal) | goal)

    def project(self, what: Convex, onto: Convex) -> ConvexSet:
        """Return the closest-point projection of a convex set to another.

        `nearest` does it for a vertex.
        """
        return self._onto(self._filled("what", what), self._filled("onto", onto))

    def gate(self, k: Convex, m: Convex) -> tuple[Vertex, Vertex]:
        """Return a gate: a vertex of each set, as close to each other as any are.

        [GK] prop:gates exist: each is the other's projection, and they differ in
        exactly the separators of the sets. For a vertex `k` it is `k` and its
        projection.
        """
        here, there = self._filled("k", k), self._filled("m", m)
        near = self._onto(there, here).first()
        return near, self.nearest(near, m)

    def geodesic(self, u: Literals, onto: Convex) -> list[Vertex]:
        """Return a shortest path from `u` to a convex set, ends included.

        As [GK] prop:constructing geodesics has it: while a literal ``b`` of the target
        is missing, flip a minimal literal of `u` below ``b*``; the smallest numbers
        first. A vertex may be given for the target.

        Returns:
            The vertices; the last is ``nearest(u, onto)``.
        """
        here, goal = self._dual.vertex("u", u), self._filled("onto", onto)
        path = [here]
        while missing := goal & ~here:
            b = next(members(missing))
            c = next(members(self._dual.minimal(here) & self._dual.down[b ^ 1]))
            here = self._dual.flip(here, c)
            path.append(here)
        return [self._dual.array(vertex) for vertex in path]

    def __repr__(self) -> str:
        return f"Cubing({self.poc!r})"

    def _onto(self, source: int, goal: int) -> ConvexSet:
        """Return the projection of ``h(S)`` to ``h(T)``, of which masks are given.

        [GK] prop:general projection, ``h((up(S) | up(T)) - up(T)*)``.
        """
        shared = (source | goal) & ~self._dual.star(goal)
        return self.convex_set(self._dual.array(shared))

    def _filled(self, name: str, given: Convex) -> int:
        """Return what the vertices of a convex set share; it must not be empty."""
        convex = self.convex_set(given)
        if convex.mask is None and not isinstance(given, ConvexSet):
            chosen = as_literals(name, given, self._dual.total)
            rule = "must be coherent: no vertex holds all of it"
            raise InvalidValueError(name, rule, self._dual.clash(chosen))
        return convex.filled(name)
