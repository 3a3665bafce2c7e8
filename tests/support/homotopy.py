"""Tests whether the punctured dual has the homotopy type of its space.

[GK] thm:homotopy type asks for contractible open neighbourhoods of the sets ``X_C`` of
points that witness a cube ``C``, meeting exactly where these sets meet. As printed no
connected space with two consistent vertices can have them: the ``X_v`` of vertices
partition the space, so disjoint open neighbourhoods would tear it apart. What the
theorem is after, and what its examples have, is for a finite space:

1. every ``X_C``, ``C`` a cube of the punctured dual, is contractible;
2. points in each other's closure, a whole chain of them, witness a common cube.

Then the space and the punctured dual have the same weak homotopy type. For by 2 every
chain of points has a smallest cube its points witness; this is a monotone map from
chains to cubes, the chains sent into ``C`` are those of ``X_C``, and a monotone map
with contractible preimages is a homotopy equivalence (Quillen's Theorem A).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import ShapeError
from neurosnap.poc.dual.homology import cubes_among
from neurosnap.poc.dual.realization import Realization, corners
from neurosnap.poc.order.pocset import PocSet
from tests.support.finite_space import FiniteSpace
from tools.paper.spaces import Example


def space_of(example: Example) -> FiniteSpace:
    """Return the space of the points of a model space's realisation."""
    return FiniteSpace.of_cells(example.cells)


@dataclass(frozen=True, slots=True)
class Richness:
    """Whether sensors are rich enough to carry over the shape of a space.

    Attributes:
        tangled: The cubes whose witnesses are not contractible, each as its literals:
            those all its vertices share, of one sensor for each proper element.
        torn: Chains of points that witness no common cube, by name.
    """

    tangled: tuple[tuple[str, ...], ...]
    torn: tuple[tuple[str, ...], ...]

    @property
    def holds(self) -> bool:
        """Whether the punctured dual has the weak homotopy type of the space."""
        return not self.tangled and not self.torn


def richness(
    realization: Realization, space: FiniteSpace, poc: PocSet | None = None
) -> Richness:
    """Return whether a realisation carries the shape of a finite space, and why not.

    [GK] thm:homotopy type, in the form this module begins with.

    Args:
        realization: Over the points of the space.
        space: How the points lie.
        poc: Whose punctured dual; the realisation's own poc set without it. Points
            that show no vertex of it witness no cube.

    Returns:
        What fails; nothing if the condition holds.

    Raises:
        ShapeError: The space has another number of points.

    Example:
        >>> from tools.paper.spaces import six_arcs
        >>> arcs = six_arcs()
        >>> richness(arcs.realization, space_of(arcs)).holds
        True
    """
    if len(space) != len(realization.points):
        rule = f"must have {len(realization.points)} points"
        raise ShapeError("space", rule, len(space))
    order = realization.poc_set() if poc is None else poc
    known = corners(order, realization.vertices(order))
    shown = corners(order, [realization.vertex(x) for x in range(len(space))])
    coherent = (shown[:, np.newaxis] == known).all(axis=2).any(axis=1)
    names = [order.name(a) for a in order.heads.tolist() if not a & 1]
    tangled = []
    for corner, spanned in cubes_among(known):
        within = ((shown == corner) | spanned).all(axis=1)
        if not space.is_contractible(within & coherent):
            tangled.append(_literals(names, corner, spanned))
    vertices = {tuple(row) for row in known.tolist()}
    torn = [
        tuple(realization.points[x] for x in chain)
        for chain in space.chains()
        if not _together(shown[chain], vertices)
    ]
    return Richness(tuple(tangled), tuple(torn))


def _together(rows: NDArray[np.bool_], vertices: set[tuple[bool, ...]]) -> bool:
    """Whether all corners of the smallest cube around some rows are vertices."""
    (varies,) = (rows != rows[0]).any(axis=0).nonzero()
    corner = rows[0].copy()
    for number in range(1 << len(varies)):
        corner[varies] = [bool(number >> k & 1) for k in range(len(varies))]
        if tuple(corner.tolist()) not in vertices:
            return False
    return True


def _literals(
    names: list[str], corner: NDArray[np.bool_], spanned: NDArray[np.bool_]
) -> tuple[str, ...]:
    """Return the names of the literals that all vertices of a cube share."""
    bits = zip(names, corner.tolist(), spanned.tolist(), strict=True)
    return tuple(name + "*" * (not on) for name, on, wide in bits if not wide)
