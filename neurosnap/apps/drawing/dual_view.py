"""The parts of a dual to be drawn: positions, edges, squares, colours, names."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_layout import Layout, lay_out
from neurosnap.apps.drawing.layout_cost import Floats, Indices
from neurosnap.apps.drawing.model import Vertex
from neurosnap.apps.drawing.panel import short
from neurosnap.poc.dual.homology import cubes_among
from neurosnap.poc.dual.realization import corners
from neurosnap.poc.order.pocset import PocSet
from neurosnap.system.palette import HUES, mixed, rgb


@dataclass(frozen=True, slots=True)
class View:
    """A dual, listed and laid out.

    Attributes:
        poc: The poc set.
        own: One positive literal for each element, in the order of the columns.
        corners: ``(vertices, n)`` bool.
        edges: ``(edges, 2)``: vertices.
        crossed: ``(edges,)``: the element each edge crosses.
        squares: ``(squares, 4)``: vertices, around.
        sides: ``(squares, 2)``: the elements each square crosses.
        layout: Directions.
        colours: One an element, as ``#rrggbb``.
    """

    poc: PocSet
    own: tuple[int, ...]
    corners: NDArray[np.bool_]
    edges: Indices
    crossed: Indices
    squares: Indices
    sides: Indices
    layout: Layout
    colours: tuple[str, ...]

    @classmethod
    def of(
        cls,
        poc: PocSet,
        vertices: list[Vertex],
        given: "View | None" = None,
        level: str | None = None,
        seen: list[Vertex] | None = None,
    ) -> "View":
        """List and lay out a dual.

        Args:
            poc: The poc set.
            vertices: All vertices of its dual.
            given: A view whose directions and colours to take, for sensors of the same
                names.
            level: The sensor whose edges lie level; the most frequent direction
                without it.
            seen: The vertices that should be seen best; all without them.
        """
        own = tuple(a for a in poc.heads.tolist() if not a & 1)
        rows = corners(poc, vertices)
        number = {row.tobytes(): k for k, row in enumerate(rows)}
        edges: list[tuple[int, ...]] = []
        squares: list[tuple[int, ...]] = []
        for corner, spanned in cubes_among(rows):
            ways = np.flatnonzero(spanned)
            if len(ways) in (1, 2):
                ring = [corner.copy()]
                for way in (*ways, *ways[:-1]):
                    ring.append(ring[-1].copy())
                    ring[-1][way] ^= True
                ring = ring[: 2 * len(ways)]
                found = [number[u.tobytes()] for u in ring]
                (edges if len(ways) == 1 else squares).append((*found, *ways))
            elif len(ways) > 2:
                break
        joined = np.array(edges, np.int64).reshape(-1, 3)
        spans = np.array(squares, np.int64).reshape(-1, 6)
        if given is None:
            chosen = rows if seen is None else corners(poc, seen)
            clear = {row.tobytes() for row in chosen}
            layout = lay_out(
                rows,
                joined[:, :2],
                _crossing(poc, own),
                np.array([row.tobytes() in clear for row in rows], np.bool_),
                None if level is None else own.index(poc.element(level)),
            )
            colours = _colours(layout)
        else:
            place = {given.poc.name(a): k for k, a in enumerate(given.own)}
            kept = [place[poc.name(a)] for a in own]
            old = given.layout
            layout = Layout(old.directions[kept], old.heights[kept], old.families[kept])
            colours = tuple(given.colours[k] for k in kept)
        return cls(
            poc=poc,
            own=own,
            corners=rows,
            edges=joined[:, :2],
            crossed=joined[:, 2],
            squares=spans[:, :4],
            sides=spans[:, 4:],
            layout=layout,
            colours=colours,
        )

    @property
    def points(self) -> Floats:
        """``(vertices, 2)``: where they lie; an average edge is one long."""
        return self.layout.points(self.corners)

    def row(self, vertex: Vertex) -> NDArray[np.bool_]:
        """Return a vertex as a row of `corners`."""
        return np.asarray(vertex)[list(self.own)]

    def find(self, vertex: Vertex) -> int:
        """Return the number of a vertex."""
        return int(np.flatnonzero((self.corners == self.row(vertex)).all(1))[0])

    def among(self, chosen: list[Vertex]) -> NDArray[np.bool_]:
        """Return which vertices are among some: ``(vertices,)`` bool."""
        rows = {self.row(vertex).tobytes() for vertex in chosen}
        return np.array([row.tobytes() in rows for row in self.corners], np.bool_)

    def name(self, vertex: int) -> str:
        """Return what a vertex has on, less what follows from the rest of it."""
        order = self.poc.order
        on = [a for a, bit in zip(self.own, self.corners[vertex], strict=True) if bit]
        least = [a for a in on if not any(order[b, a] for b in on if b != a)]
        return " ".join(short(self.poc.name(a)) for a in least) or "∅"

    def tint(self, square: int, *, strong: bool) -> tuple[float, float, float]:
        """Return a pale colour for a square: mostly of the rarer of its directions."""
        sizes = np.bincount(self.layout.families)
        one, two = sorted(
            self.sides[square].tolist(),
            key=lambda k: (sizes[self.layout.families[k]], -k),
        )
        between = np.array(rgb(mixed(self.colours[one], self.colours[two], 0.28)))
        share = 0.36 if strong else 0.17
        red, green, blue = (1 - share + share * between).tolist()
        return red, green, blue

    def element(self, k: int) -> str:
        """Return the name of an element: all literals that are equal."""
        return element_name(self.poc, self.own[k])

    def colour_of(self, literal: int) -> str | None:
        """Return the colour of a representative's element, if it is drawn."""
        positive = literal & ~1
        if positive not in self.own:
            return None
        return self.colours[self.own.index(positive)]


def element_name(poc: PocSet, literal: int) -> str:
    """Return the name of the element of a representative: all literals in its class."""
    same = poc.graph.representative == literal
    names = [poc.name(a) for a in np.flatnonzero(same).tolist()]
    if len(names) > 4:
        names = [*names[:3], f"{len(names) - 3} more"]
    return " = ".join(short(name) for name in names)


def _crossing(poc: PocSet, own: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return which elements cross: ``(n, n)`` bool."""
    pairs = [[poc.crosses(a, b) for b in own] for a in own]
    return np.array(pairs, np.bool_).reshape(len(own), len(own))


def _colours(layout: Layout) -> tuple[str, ...]:
    """Return colours: a hue for each way that elements' being on leads, in shades.

    Ways that share a hue have shades of their own, and elements of a way go from dark
    to light.
    """
    leads = {
        family: layout.directions[layout.families == family][0]
        for family in layout.families.tolist()
    }
    ways = [
        (family, bool(layout.directions[k] @ leads[family] > 0))
        for k, family in enumerate(layout.families.tolist())
    ]
    colours = [""] * len(ways)
    distinct = list(dict.fromkeys(ways))
    for number, (dark, light) in enumerate(HUES):
        place = -1.0
        places: dict[int, float] = {}
        for way in distinct[number :: len(HUES)]:
            for k in (k for k, other in enumerate(ways) if other == way):
                place += 1.0
                places[k] = place
            place += 0.5
        longest = max(place - 0.5, 1.0)
        for k, where in places.items():
            colours[k] = mixed(dark, light, where / longest)
    return tuple(colours)
