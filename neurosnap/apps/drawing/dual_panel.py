"""Draws the dual: squares as tiles, parallel edges in one colour, vertices.

What is farther from the eye is drawn first and shines through what is nearer; an edge
that passes in front of another interrupts it. A square's tile is smaller than the
square, so that it is plain which edges it lies between.
"""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_places import LABEL, MARKED, RADIUS, DualPlaces
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.layout_cost import Floats
from neurosnap.apps.drawing.model import Mark, Model
from neurosnap.apps.drawing.panel import INK, PALE, STATE, Panel, say, text_width
from neurosnap.poc.dual.cubing import Cubing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point: TypeAlias = tuple[float, float]

RING = "#d4521a"
PUNCTURE = "#c1121f"
THICK, THIN = 3.0, 1.3
"""Widths of edges that are shown, and of those that are not."""
SHINE = 0.62
"""How opaque a square's tile is."""
_GAP = 0.55


def dual_panel(
    model: Model, view: View, unit: float, chosen: NDArray[np.bool_] | None = None
) -> Panel:
    """Return the drawing of a dual.

    Args:
        model: What is marked; the first of its parts is projected to below the dual,
            the second to the right of it.
        view: The dual.
        unit: How long an average edge is.
        chosen: ``(vertices,)`` bool: only these vertices, and what they span.
    """
    main = DualPlaces(model, view, unit, chosen, text_width)
    low, high = main.low, main.high
    drawings = [(main, np.zeros(2), "")]
    for number, (caption, names) in enumerate(model.parts if chosen is None else ()):
        part = _projected(model, view, unit, names)
        shift = np.array([0.0, main.low[1] - part.high[1] - _GAP])
        if number:
            shift = np.array([main.high[0] - part.low[0] + _GAP, 0.0])
        drawings.append((part, shift, f"projection to {caption}"))
        low = np.minimum(low, part.low + shift)
        high = np.maximum(high, part.high + shift + [0.0, 0.25])

    def draw(axes: "Axes", x: float, y: float) -> None:
        for places, shift, caption in drawings:
            moved = shift + np.array([x, y]) - low
            Drawing(places).on(axes, moved)
            if caption:
                left, top = places.low[0] + moved[0], places.high[1] + moved[1]
                say(axes, left, top + 0.13, caption, 9, PALE, ha="left")

    return Panel(float(high[0] - low[0]), float(high[1] - low[1]), draw, main.nameless)


def _projected(
    model: Model, view: View, unit: float, names: tuple[str, ...]
) -> DualPlaces:
    """Return the dual of some of the sensors, in the same directions."""
    poc = model.poc.restricted(names)
    part = View.of(poc, list(Cubing(poc).vertices()), view)
    return DualPlaces(Model(model.name, "", poc), part, unit, None, text_width)


class Drawing:
    """Draws a dual that is measured.

    Args:
        places: The dual.
    """

    def __init__(self, places: DualPlaces) -> None:
        self._places = places

    def on(self, axes: "Axes", shift: Floats) -> None:
        """Draw it."""
        points = self._places.points + shift
        self._flesh(axes, points)
        self._target(axes, points)
        for k in np.flatnonzero(self._places.shown).tolist():
            x, y = points[k].tolist()
            self._vertex(axes, (x, y), k)
        for name, spot in self._places.names.values():
            x, y = spot + shift
            text = say(axes, x, y, name, LABEL, layer=9, halo=True)
            text.set_gid("label")

    def _flesh(self, axes: "Axes", points: Floats) -> None:
        """Draw squares and edges, the farthest first."""
        things = self._places.flesh()
        for layer, (is_edge, number) in enumerate(things):
            at = 1 + 4 * layer / len(things)
            (self._edge if is_edge else self._square)(axes, points, number, at)

    def _square(self, axes: "Axes", points: Floats, number: int, at: float) -> None:
        from matplotlib.patches import Polygon

        ring = points[self._places.view.squares[number]]
        middle = ring.mean(0)
        whole = self._places.seen[self._places.view.squares[number]].all()
        colour = self._places.view.tint(number, strong=bool(whole))
        axes.add_patch(
            Polygon(
                middle + 0.86 * (ring - middle),
                facecolor=colour,
                alpha=SHINE,
                lw=0,
                zorder=at,
            )
        )

    def _edge(self, axes: "Axes", points: Floats, number: int, at: float) -> None:
        ends = self._places.view.edges[number]
        colour = self._places.view.colours[self._places.view.crossed[number]]
        x, y = points[ends].T
        wide = THICK if self._places.seen[ends].all() else THIN
        axes.plot(x, y, color="white", lw=wide + 2.4, zorder=at - 1e-4)
        axes.plot(x, y, color=colour, lw=wide, zorder=at, solid_capstyle="round")

    def _target(self, axes: "Axes", points: Floats) -> None:
        """Draw where a morphism's dual leads the edges of its target's dual."""
        for pair in self._places.joined:
            x, y = points[list(pair)].T
            axes.plot(x, y, color=RING, lw=10, alpha=0.3, zorder=5.5)

    def _vertex(self, axes: "Axes", at: Point, k: int) -> None:
        if self._places.possible[k]:
            halo(axes, at)
        dot(axes, at, seen=bool(self._places.seen[k]))
        if k in self._places.marks:
            put_mark(axes, at, self._places.marks[k])


def dot(axes: "Axes", point: Point, *, seen: bool) -> None:
    """Draw a vertex."""
    from matplotlib.patches import Circle

    face = INK if seen else "white"
    shape = Circle(point, RADIUS, facecolor=face, edgecolor=INK, lw=1.3, zorder=7)
    axes.add_patch(shape)


def halo(axes: "Axes", point: Point) -> None:
    """Draw what shows that the current state leaves a vertex possible."""
    from matplotlib.patches import Circle

    shape = Circle(point, 0.13, facecolor=STATE, edgecolor=INK, lw=0.8, zorder=6)
    axes.add_patch(shape)


def put_mark(axes: "Axes", point: Point, mark: Mark) -> None:
    """Draw a mark over a vertex."""
    from matplotlib.patches import Circle

    x, y = point
    match mark.kind:
        case "puncture":
            for way in (1, -1):
                ends = [x - 0.1, x + 0.1], [y - 0.1 * way, y + 0.1 * way]
                axes.plot(*ends, color="white", lw=5, zorder=7.5)
                axes.plot(*ends, color=PUNCTURE, lw=2.6, zorder=8)
        case "split":
            ring = Circle(point, MARKED, fill=False, edgecolor=PUNCTURE, lw=2, zorder=8)
            axes.add_patch(ring)
        case _:
            colour = RING if mark.kind in ("median", "image") else INK
            disc = Circle(point, MARKED, facecolor=colour, edgecolor="white", zorder=8)
            axes.add_patch(disc)
            say(axes, x, y, mark.sign, 9, "white", layer=8.5, weight="bold")
