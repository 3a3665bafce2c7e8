"""Convex sets of coherent states, and the closest-point projection to them.

A convex set is kept as what its vertices share, so that it takes no more room than one
vertex however many it holds, and two are equal iff these literals are.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.mask_dual import LISTABLE, Dual
from neurosnap.poc.order.literal_sets import Literals


def nearest(dual: Dual, vertex: int, goal: int) -> int:
    """Return the closest vertex to one, of those that hold a closed set.

    [GK] cor:projection of a point, ``(u - down(T*)) | up(T)`` for ``h(T)``.
    """
    return vertex & ~dual.star(goal) | goal


def project(dual: Dual, source: int, goal: int) -> int:
    """Return literals of which the vertices are a convex set's projection to another.

    [GK] prop:general projection, ``h((up(S) | up(T)) - up(T)*)`` of ``h(S)`` to
    ``h(T)``.
    """
    return (source | goal) & ~dual.star(goal)


class ConvexSet:
    """The vertices that hold all of some literals ([GK] eqn:typical convex set).

    Made by the methods of `Cubing`; iterates over its vertices. What only a set with a
    vertex has raises `InvalidValueError` if it is empty.

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
