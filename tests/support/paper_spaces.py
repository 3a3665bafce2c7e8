"""The paper's model spaces as poc sets, used to test its theorems.

Where the paper's text and its figure disagree the figure is followed; the docstring
says so. Sizes are the figures' where those are known.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet, RelationLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A model space and what belongs to it.

    Attributes:
        poc: The poc set.
        realization: A realisation of it.
        cells: The points of the realisation as cells, each by its vertices.
        marked: Names of the literals of a vertex of its dual that its figure marks.
    """

    poc: PocSet
    realization: Realization
    cells: tuple[tuple[int, ...], ...] = ()
    marked: tuple[str, ...] = ()

    def mark(self) -> NDArray[np.bool_]:
        """Return the marked vertex as a ``(2N,)`` bool array."""
        vertex = np.zeros(self.poc.minimum, np.bool_)
        vertex[[self.poc.element(name) for name in self.marked]] = True
        return vertex


def thresholds(length: int = 6) -> Example:
    """Return the path of [GK] example:N-path: ``a_k`` is on left of ``k / N``.

    Examples:
        >>> thresholds(2).realization.poc_set() == thresholds(2).poc
        True
    """
    cells = _segment(3 * length)
    rows = [
        [max(cell) <= 3 * k and min(cell) < 3 * k for cell in cells]
        for k in range(1, length + 1)
    ]
    poc = chain("a", length)
    realization = Realization(rows, poc.sensorium)
    return Example(poc=poc, realization=realization, cells=tuple(cells))


def beacons(length: int = 6) -> Example:
    """Return the starfish of [GK] example:N-path: ``a_k`` is on near ``k / N``.

    The printed relations stop short of the last beacon; all exclude each other. The
    marked vertex is the one whose witnesses are not connected.
    """
    cells = _segment(3 * length)
    names = [f"a{k}" for k in range(1, length + 1)]
    rows = [
        [abs(min(cell) - 3 * k + (len(cell) - 1) / 2) < 1 for cell in cells]
        for k in range(1, length + 1)
    ]
    return Example(
        poc=PocSet(names, exclusive(names)),
        realization=Realization(rows, names),
        cells=tuple(cells),
        marked=tuple(f"{name}*" for name in names),
    )


def six_arcs() -> Example:
    """Return agent 1 of [GK] example:N-cycle: arcs of a third of the circle.

    The marked vertex is the one that no point of the circle witnesses.
    """
    return _compass(2, (2, 3, 4))


def six_wide_arcs() -> Example:
    """Return agent 2 of [GK] example:N-cycle: arcs of half the circle.

    Taking the marked vertex out of the dual leaves a sphere, not a circle as the text
    has it: all inconsistent vertices have to go.
    """
    return _compass(3, (3,))


def path_with_motion(length: int = 5) -> Example:
    """Return [GK] example:path with motion: positions, and three exclusive actions.

    The realisation's points are a position before and what is done there: nothing,
    which leaves the agent where it is, or an action. (As sets of transitions alone the
    actions would not exclude each other: at the ends moving is waiting.)
    """
    steps = {"fwd": 1, "back": -1, "wait": 0}
    positions = [f"a{k}" for k in range(1, length + 1)]
    points = [(x, act) for x in range(length + 1) for act in ("", *steps)]
    after = [min(max(x + steps.get(act, 0), 0), length) for x, act in points]
    rows = [[y < k for y in after] for k in range(1, length + 1)]
    rows += [[act == own for _, act in points] for own in steps]
    relations: list[RelationLike] = list(exclusive(list(steps)))
    relations += [f"{a} < {b}" for a, b in itertools.pairwise(positions)]
    relations += ["fwd < a1*", f"back < a{length}"]
    names = [*positions, *steps]
    realization = Realization(rows, names)
    return Example(poc=PocSet(names, relations), realization=realization)


def grid_with_holes(
    columns: int = 5, rows: int = 5, holes: tuple[tuple[int, int], ...] = ((2, 2),)
) -> Example:
    """Return [GK] "A Punctured Grid": thresholds on a grid with places missing.

    The space has a cell for each place, each pair of neighbours and each four of them
    in a square; a sensor says of a cell what it says of the cell's first place.
    """
    poc = chain("x", columns - 1) | chain("y", rows - 1)
    places = {(x, y) for x in range(columns) for y in range(rows)} - set(holes)
    shapes = [((0, 0),), ((0, 0), (1, 0)), ((0, 0), (0, 1))]
    shapes.append(((0, 0), (1, 0), (0, 1), (1, 1)))
    cells = []
    for shape in shapes:
        moved = (tuple((x + i, y + j) for i, j in shape) for x, y in sorted(places))
        cells += [cell for cell in moved if places.issuperset(cell)]
    number = {place: k for k, place in enumerate(sorted(places))}
    numbered = tuple(tuple(number[place] for place in cell) for cell in cells)
    bits = [[c[0][0] < k for c in cells] for k in range(1, columns)]
    bits += [[c[0][1] < k for c in cells] for k in range(1, rows)]
    realization = Realization(bits, poc.sensorium)
    return Example(poc=poc, realization=realization, cells=numbered)


def chain(name: str, length: int) -> PocSet:
    """Return ``name1 < name2 < ...``, whose dual is a path of that many edges.

    Examples:
        >>> chain("a", 3)
        PocSet.parse('a1, a2, a3 : a1 < a2, a2 < a3')
    """
    names = [f"{name}{k}" for k in range(1, length + 1)]
    return PocSet(names, [f"{a} < {b}" for a, b in itertools.pairwise(names)])


def exclusive(names: list[str]) -> list[RelationLike]:
    """Return the relations by which no two of some sensors are on together."""
    return [(a, "<", f"{b}*") for k, a in enumerate(names) for b in names[:k]]


def _compass(reach: int, apart: tuple[int, ...]) -> Example:
    """Return six arcs of a circle of 12 vertices and 12 edges, half-units long."""
    names = [f"a{k}" for k in range(6)]
    cells = [(k,) for k in range(12)] + [(k, (k + 1) % 12) for k in range(12)]

    def on(k: int, cell: tuple[int, ...]) -> bool:
        off = [min((m - 2 * k) % 12, (2 * k - m) % 12) for m in cell]
        return max(off) < reach if len(cell) == 1 else max(off) <= reach

    rows = [[on(k, cell) for cell in cells] for k in range(6)]
    relations = [
        (names[i], "<", f"{names[(i + x) % 6]}*") for i in range(6) for x in apart
    ]
    return Example(
        poc=PocSet(names, relations),
        realization=Realization(rows, names),
        cells=tuple(cells),
        marked=tuple(f"{name}*" for name in names),
    )


def _segment(edges: int) -> list[tuple[int, ...]]:
    """Return the cells of a line of vertices and edges."""
    cells: list[tuple[int, ...]] = [(k,) for k in range(edges + 1)]
    return cells + [(k, k + 1) for k in range(edges)]
