"""The model spaces of the paper, by name, as poc sets.

Where the paper's text and its figure disagree the figure is followed; the docstring
says so. Sizes are the figures' where those are known.
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.morphism import PocMorphism
from neurosnap.poc.dual.realization import Realization
from neurosnap.poc.order.pocset import PocSet
from neurosnap.poc.order.relations import RelationLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Example:
    """A model space and what belongs to it.

    Attributes:
        title: What it is, in a line.
        poc: The poc set.
        marked: Vertices of its dual that its figure marks, as sets of literals.
        morphism: A morphism from or to it that the example is about.
        fields: A realisation of the poc set.
        cells: The points of the realisation as cells, each by its vertices.
    """

    title: str
    poc: PocSet
    marked: tuple[tuple[str, ...], ...] = ()
    morphism: PocMorphism | None = None
    fields: Realization | None = None
    cells: tuple[tuple[int, ...], ...] = ()

    @property
    def realization(self) -> Realization:
        """The realisation.

        Raises:
            InvalidValueError: The example has none.
        """
        if self.fields is None:
            raise InvalidValueError("example", "must have a realisation", self.title)
        return self.fields

    def marks(self) -> list[NDArray[np.bool_]]:
        """Return the marked vertices as ``(2N,)`` bool arrays."""
        found = []
        for names in self.marked:
            vertex = np.zeros(self.poc.minimum, np.bool_)
            vertex[[self.poc.element(name) for name in names]] = True
            found.append(vertex)
        return found


def simple() -> Example:
    """Return [GK] example:simple example of a dual: a square with a tail.

    Example:
        >>> simple().poc
        PocSet.parse('a, b, c : a < c*, b < c*')
    """
    poc = PocSet.parse("a, b, c : a < c*, b < c*")
    return Example(title="A simple poc set and its dual", poc=poc)


def grid(columns: int = 6, rows: int = 5) -> Example:
    """Return the grid of [GK] fig:median: two chains that cross, three marked vertices.

    The fourth marked vertex is the median of the first three. Needs at least 5 columns
    and 4 rows.
    """
    _at_least("columns", 5, columns)
    _at_least("rows", 4, rows)
    poc = chain("x", columns - 1) | chain("y", rows - 1)

    def place(x: int, y: int) -> tuple[str, ...]:
        across = [f"x{k}" + "*" * (x >= k) for k in range(1, columns)]
        up = [f"y{k}" + "*" * (y >= k) for k in range(1, rows)]
        return (*across, *up)

    marked = (place(0, 1), place(2, rows - 1), place(columns - 1, 0), place(2, 1))
    title = f"The median of three vertices in a {columns} by {rows} grid"
    return Example(title=title, poc=poc, marked=marked)


def thresholds(length: int = 6) -> Example:
    """Return the path of [GK] example:N-path: ``a_k`` is on left of ``k / N``.

    Example:
        >>> thresholds(2).realization.poc_set() == thresholds(2).poc
        True
    """
    _at_least("length", 1, length)
    cells = _segment(3 * length)
    rows = [
        [max(cell) <= 3 * k and min(cell) < 3 * k for cell in cells]
        for k in range(1, length + 1)
    ]
    poc = chain("a", length)
    fields = Realization(rows, poc.sensorium, map(_cell_name, cells))
    title = f"A path of length {length}, by thresholds"
    return Example(title=title, poc=poc, fields=fields, cells=tuple(cells))


def beacons(length: int = 6) -> Example:
    """Return the starfish of [GK] example:N-path: ``a_k`` is on near ``k / N``.

    The printed relations stop short of the last beacon; all exclude each other. The
    marked vertex is the one whose witnesses are not connected.
    """
    _at_least("length", 1, length)
    cells = _segment(3 * length)
    names = [f"a{k}" for k in range(1, length + 1)]
    rows = [
        [abs(min(cell) - 3 * k + (len(cell) - 1) / 2) < 1 for cell in cells]
        for k in range(1, length + 1)
    ]
    fields = Realization(rows, names, map(_cell_name, cells))
    poc = PocSet(names, exclusive(names))
    marked = (tuple(f"{name}*" for name in names),)
    title = f"The same path by {length} beacons: a starfish"
    return Example(
        title=title, poc=poc, marked=marked, fields=fields, cells=tuple(cells)
    )


def six_arcs() -> Example:
    """Return agent 1 of [GK] example:N-cycle: arcs of a third of the circle.

    The marked vertex is the one that no point of the circle witnesses.
    """
    return _compass(2, (2, 3, 4), "six arcs of a circle, each less than a third")


def six_wide_arcs() -> Example:
    """Return agent 2 of [GK] example:N-cycle: arcs of half the circle.

    Taking the marked vertex out of the dual leaves a sphere, not a circle as the text
    has it: all inconsistent vertices have to go.
    """
    return _compass(3, (3,), "six arcs of a circle, each less than a half")


def degeneration() -> Example:
    """Return [GK] example:degeneration: the identity to where ``a < b`` is learned."""
    poc = PocSet.parse("a, b, c : a < c, b < c")
    more = PocSet.parse("a, b, c : a < b < c")
    title = "A degeneration, dual to an embedding"
    return Example(title=title, poc=poc, morphism=PocMorphism.named(poc, more))


def bad_dual() -> Example:
    """Return [GK] example:bad dual: an edge goes to a diagonal.

    The text has ``a < b, b < c``, whose dual is a path without the square of the
    figure; with ``a < c, b < c`` there is one.
    """
    poc = PocSet.parse("a, b, c : a < c, b < c")
    morphism = PocMorphism(poc, PocSet.parse("x, y : x < y"), ["x", "x", "y"])
    title = "A poc morphism whose dual is no morphism of graphs"
    return Example(title=title, poc=poc, morphism=morphism)


def path_with_motion(length: int = 5) -> Example:
    """Return [GK] example:path with motion: positions, and three exclusive actions.

    The realisation's points are a position before and what is done there: nothing,
    which leaves the agent where it is, or an action. (As sets of transitions alone the
    actions would not exclude each other: at the ends moving is waiting.)
    """
    _at_least("length", 2, length)
    title = f"A path of length {length} with motion"
    return _motion(title, length, [])


def path_with_two_contexts(length: int = 5) -> Example:
    """Return [GK] fig:interval with motion, slight expansion: two contexts."""
    _at_least("length", 4, length)
    title = f"A path of length {length} with motion and two contextual sensors"
    return _motion(title, length, [("fwd", 2), ("back", 4)])


def path_with_all_contexts(length: int = 5) -> Example:
    """Return [GK] fig:interval with motion, full expansion: all contextual sensors."""
    _at_least("length", 2, length)
    contexts = [("fwd", k) for k in range(1, length)]
    contexts += [("back", k) for k in range(2, length + 1)]
    title = f"A path of length {length} with motion and all contextual sensors"
    return _motion(title, length, contexts)


def grid_with_holes(
    columns: int = 5, rows: int = 5, holes: tuple[tuple[int, int], ...] = ((2, 2),)
) -> Example:
    """Return [GK] "A Punctured Grid": thresholds on a grid with places missing.

    The space has a cell for each place, each pair of neighbours and each four of them
    in a square; a sensor says of a cell what it says of the cell's first place.

    Raises:
        InvalidValueError: A hole is outside the grid, or nothing is left.
    """
    _at_least("columns", 2, columns)
    _at_least("rows", 2, rows)
    for hole in holes:
        if not (0 <= hole[0] < columns and 0 <= hole[1] < rows):
            raise InvalidValueError("hole", f"must be in {columns} x {rows}", hole)
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
    fields = Realization(bits, poc.sensorium, map(str, cells))
    missing = f"{len(holes)} place{'' if len(holes) == 1 else 's'}"
    title = f"A {columns} by {rows} grid with {missing} missing"
    return Example(title=title, poc=poc, fields=fields, cells=numbered)


EXAMPLES: dict[str, Callable[[], Example]] = {
    make.__name__.replace("_", "-"): make
    for make in (
        simple,
        grid,
        thresholds,
        beacons,
        six_arcs,
        six_wide_arcs,
        degeneration,
        bad_dual,
        path_with_motion,
        path_with_two_contexts,
        path_with_all_contexts,
        grid_with_holes,
    )
}
"""Every named example, as what makes it."""


def chain(name: str, length: int) -> PocSet:
    """Return ``name1 < name2 < ...``, whose dual is a path of that many edges.

    Example:
        >>> chain("a", 3)
        PocSet.parse('a1, a2, a3 : a1 < a2, a2 < a3')
    """
    names = [f"{name}{k}" for k in range(1, length + 1)]
    return PocSet(names, [f"{a} < {b}" for a, b in itertools.pairwise(names)])


def exclusive(names: list[str]) -> list[RelationLike]:
    """Return the relations by which no two of some sensors are on together."""
    return [(a, "<", f"{b}*") for k, a in enumerate(names) for b in names[:k]]


def _compass(reach: int, apart: tuple[int, ...], what: str) -> Example:
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
    poc = PocSet(names, relations)
    return Example(
        title=f"A compass: {what}",
        poc=poc,
        marked=(tuple(f"{name}*" for name in names),),
        fields=Realization(rows, names, map(_cell_name, cells)),
        cells=tuple(cells),
    )


def _motion(title: str, length: int, contexts: list[tuple[str, int]]) -> Example:
    """Return a path with motion and some contextual sensors ``(action, k)``.

    A contextual sensor of ``fwd`` is about ``a_k*``, one of ``back`` about ``a_k``.
    """
    steps = {"fwd": 1, "back": -1, "wait": 0}
    positions = [f"a{k}" for k in range(1, length + 1)]
    names = [*positions, *steps]
    points = [(x, act) for x in range(length + 1) for act in ("", *steps)]
    after = [min(max(x + steps.get(act, 0), 0), length) for x, act in points]
    rows = [[y < k for y in after] for k in range(1, length + 1)]
    rows += [[act == own for _, act in points] for own in steps]
    relations: list[RelationLike] = list(exclusive(list(steps)))
    relations += [f"{a} < {b}" for a, b in itertools.pairwise(positions)]
    relations += ["fwd < a1*", f"back < a{length}"]
    for action, k in contexts:
        ahead = action == "fwd"
        name = _context(action, k)
        names.append(name)
        rows.append([act == action and (x >= k) == ahead for x, act in points])
        goal = f"a{k + 1}*" if ahead else f"a{k - 1}"
        relations += [(name, "<", action), (name, "<", goal)]
        weaker = (action, k - 1 if ahead else k + 1)
        if weaker in contexts:
            relations.append((name, "<", _context(*weaker)))
    called = [f"{x} {act}".strip() for x, act in points]
    fields = Realization(rows, names, called)
    return Example(title=title, poc=PocSet(names, relations), fields=fields)


def _context(action: str, k: int) -> str:
    """Return the name of a contextual sensor; a name must not end with a star."""
    return f"({action}∧a{k}{'*' if action == 'fwd' else ''})"


def _segment(edges: int) -> list[tuple[int, ...]]:
    """Return the cells of a line of vertices and edges."""
    cells: list[tuple[int, ...]] = [(k,) for k in range(edges + 1)]
    return cells + [(k, k + 1) for k in range(edges)]


def _cell_name(cell: tuple[int, ...]) -> str:
    """Return the name of a cell: its vertices."""
    return "–".join(map(str, cell))


def _at_least(name: str, least: int, value: int) -> None:
    """Refuse a size that is too small."""
    if value < least:
        raise InvalidValueError(name, f"must be at least {least}", value)
