"""Positions of a dual's vertices in the plane: a linear image of the cube.

Every element has one direction, and a vertex lies at the sum of the directions of the
elements it has on. So edges that cross the same hyperplane are parallel and equally
long, squares are parallelograms and cubes look like cubes, whatever the dimension.

The directions make distances in the plane follow hop distances (restricted stress
majorisation), then keep vertices off each other and off edges they do not belong to,
then elements that are nested and almost parallel become parallel, so that a path is
straight and a grid is a grid. Of several fixed starts the one that reads best is kept:
the same dual always looks the same.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.layout_cost import Floats, Indices, Strain, families_of

_STARTS = 6
_TURNED = 4  # families that are tried the other way around
_ALIGNED = (np.deg2rad(12), np.deg2rad(40))
_PARALLEL = np.deg2rad(1)


@dataclass(frozen=True, slots=True)
class Layout:
    """A linear image of a dual.

    Attributes:
        directions: ``(n, 2)``: where each element's being on leads.
        heights: ``(n,)``: how much nearer to the eye that is.
        families: ``(n,)``: elements with the same number are parallel.
    """

    directions: Floats
    heights: Floats
    families: Indices

    def points(self, corners: NDArray[np.bool_]) -> Floats:
        """Return where vertices are: ``(vertices, 2)`` of ``(vertices, n)`` bool."""
        return corners.astype(np.float64) @ self.directions

    def depths(self, corners: NDArray[np.bool_]) -> Floats:
        """Return how near to the eye vertices are: ``(vertices,)``."""
        return corners.astype(np.float64) @ self.heights


def lay_out(
    corners: NDArray[np.bool_],
    edges: Indices,
    crossing: NDArray[np.bool_],
    seen: NDArray[np.bool_],
    level: int | None = None,
) -> Layout:
    """Return a layout of a dual.

    Args:
        corners: ``(vertices, n)`` bool, one column an element.
        edges: ``(edges, 2)``: the vertices each edge joins.
        crossing: ``(n, n)`` bool: which elements cross.
        seen: ``(vertices,)`` bool: which vertices should be seen best.
        level: The element whose edges lie level; one of the most frequent direction
            without it.

    Returns:
        Its average edge is one long. O(starts · vertices²) time for small duals; large
        ones are looked at in part.
    """
    strain = Strain.of(corners, edges, crossing, seen)
    count = corners.shape[1]
    starts = _STARTS if len(corners) * len(edges) <= 4000 else 2
    tries = [strain.settled(_start(count, number)) for number in range(starts)]
    even = [strain.straightened(t, angle) for t in tries for angle in _ALIGNED]
    # Exactly parallel if it costs next to nothing; of equals the first.
    ranked = [(round(strain.cost(t), 6), t) for t in even]
    ranked += [(round(strain.cost(t) + 0.05, 6), t) for t in tries]
    _, best = min(ranked, key=lambda entry: entry[0])
    best = min(_turned(best, ~crossing), key=lambda t: round(strain.cost(t), 6))
    return _posed(best, crossing, level)


def _start(count: int, number: int) -> Floats:
    """Return directions to begin with: fans first, then drawn from a fixed seed."""
    if number == 0:
        angles = np.arange(count) * 2 * np.pi / max(count, 1)
    elif number == 1:
        angles = np.arange(count) * np.pi / max(count, 1)
    else:
        angles = np.random.default_rng(number).uniform(0, 2 * np.pi, count)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _turned(directions: Floats, nested: NDArray[np.bool_]) -> list[Floats]:
    """Return directions, and the same with some families the other way around.

    What is symmetric, a block of cubes, then shows its front or its back.
    """
    families = families_of(directions, nested, _PARALLEL)
    found = [directions]
    for family in range(min(int(families.max(initial=-1)) + 1, _TURNED)):
        signs = np.where(families == family, -1.0, 1.0)[:, None]
        found += [signs * before for before in found]
    return found


def _posed(
    directions: Floats, crossing: NDArray[np.bool_], level: int | None
) -> Layout:
    """Return a layout turned upright, its average edge one long."""
    families = families_of(directions, ~crossing, _PARALLEL)
    if not len(directions):
        return Layout(directions, np.zeros(0), families)
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions / lengths.mean()
    largest = int(np.bincount(families).argmax())
    lead = directions[families == largest][0] if level is None else directions[level]
    angle = -np.arctan2(lead[1], lead[0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    directions = directions @ turn
    lengths = np.linalg.norm(directions, axis=1)
    reach = 1.15 * lengths.max()
    towards = np.where(directions @ [0.4, 1.0] > 0, -1.0, 1.0)
    heights = towards * np.sqrt(np.maximum(reach**2 - lengths**2, 0))
    return Layout(directions, heights, families)
