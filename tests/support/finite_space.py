"""Finite topological spaces, given by their specialisation order.

Every space with finitely many points that topology can tell apart is a partial order:
``x <= y`` iff `x` is in the closure of `y`. The faces of a complex of cells are one,
and it has the complex's homotopy groups (McCord 1966), so that a circle, a grid with
holes and whatever else is glued from cells is here with finitely many points.
"""

import itertools
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.dual.homology import CellComplex
from tests.support.simplices import simplicial


class FiniteSpace:
    """A finite space in which no two points have the same neighbourhoods (T0).

    Args:
        points: How many.
        below: Pairs ``(x, y)``: `x` is in the closure of `y`, as a face is of its
            cell. What follows by transitivity holds too.

    Example:
        >>> edge = FiniteSpace(3, [(0, 2), (1, 2)])
        >>> edge.is_contractible(), FiniteSpace(2).is_contractible()
        (True, False)
    """

    def __init__(self, points: int, below: Iterable[tuple[int, int]] = ()) -> None:
        order = np.eye(points, dtype=np.bool_)
        for pair in below:
            order[pair] = True
        for via in range(points):
            order |= order[:, via, np.newaxis] & order[via]
        order.flags.writeable = False
        self.order = order

    @classmethod
    def of_cells(cls, cells: Iterable[Iterable[int]]) -> "FiniteSpace":
        """Return the space of cells, each given by its vertices.

        A cell is in the closure of another iff its vertices are among the other's.

        Args:
            cells: All cells, vertices included; point ``k`` is the ``k``-th.

        Example:
            >>> FiniteSpace.of_cells([[0], [1], [0, 1]]).order[0, 2]
            np.True_
        """
        sets = [frozenset(cell) for cell in cells]
        pairs = itertools.permutations(range(len(sets)), 2)
        return cls(len(sets), [(x, y) for x, y in pairs if sets[x] <= sets[y]])

    def __len__(self) -> int:
        """Return the number of points."""
        return len(self.order)

    def chains(self, points: NDArray[np.bool_] | None = None) -> Iterator[list[int]]:
        """Yield the maximal chains among some points, each from the bottom up.

        Args:
            points: ``(n,)`` bool, or None for all. Chains may be exponentially many.
        """
        chosen = np.arange(len(self)) if points is None else np.flatnonzero(points)
        strict = self.order[np.ix_(chosen, chosen)] & ~np.eye(len(chosen), dtype=bool)
        covers = strict & ~((strict.astype(int) @ strict.astype(int)) > 0)
        pending = [[int(x)] for x in np.flatnonzero(~strict.any(axis=0))]
        while pending:
            chain = pending.pop()
            after = np.flatnonzero(covers[chain[-1]]).tolist()
            pending += [[*chain, x] for x in after]
            if not after:
                yield chosen[chain].tolist()

    def order_complex(self, points: NDArray[np.bool_] | None = None) -> CellComplex:
        """Return the simplices of chains: the space's homology, and more, is theirs."""
        return simplicial(self.chains(points))

    def is_contractible(self, points: NDArray[np.bool_] | None = None) -> bool:
        """Return whether the subspace of some points can be shrunk to one.

        Points with one nearest point above or below (beat points) are taken away as
        long as there are any; a space is contractible iff one point is left (Stong
        1966). O(n⁴) time.

        Args:
            points: ``(n,)`` bool, or None for all. The empty space is not contractible.
        """
        left = set(range(len(self)))
        if points is not None:
            left = set(np.flatnonzero(points).tolist())
        while True:
            beaten = next((x for x in left if self._beaten(x, left)), None)
            if beaten is None:
                return len(left) == 1
            left.discard(beaten)

    def _beaten(self, x: int, among: set[int]) -> bool:
        """Whether the points strictly above, or below, have a least, or a greatest."""
        others = among - {x}
        above = [y for y in others if self.order[x, y]]
        below = [y for y in others if self.order[y, x]]
        return any(self.order[y, above].all() for y in above) or any(
            self.order[below, y].all() for y in below
        )
