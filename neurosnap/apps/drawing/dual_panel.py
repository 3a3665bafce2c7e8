"""Draws the dual: squares as tiles, parallel edges in one colour, vertices.

What is farther from the eye is drawn first and shines through what is nearer; an edge
that passes in front of another interrupts it. A square's tile is smaller than the
square, so that it is plain which edges it lies between.
"""

from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.label_placement import place_labels
from neurosnap.apps.drawing.layout_cost import Floats
from neurosnap.apps.drawing.model import Mark, Model
from neurosnap.apps.drawing.panel import INK, LINE, PALE, STATE, Panel, say, text_width
from neurosnap.poc.dual.cubing import Cubing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point: TypeAlias = tuple[float, float]

NAMED = 48
"""The most vertices that are named."""

RING = "#d4521a"
PUNCTURE = "#c1121f"
RADIUS = 0.062
THICK, THIN = 3.0, 1.3
"""Widths of edges that are shown, and of those that are not."""
SHINE = 0.62
"""How opaque a square's tile is."""
_MARKED = 0.115
_LABEL = 8.5
_GAP = 0.55


def unit_of(view: View) -> float:
    """Return how long an average edge is drawn."""
    extent = float(np.ptp(view.points, axis=0).max(initial=1.0))
    if len(view.corners) > NAMED:
        return float(np.clip(9.0 / extent, 0.4, 0.9))
    longest = max(len(view.name(k)) for k in range(len(view.corners)))
    return float(np.clip(8.0 / extent, 0.85, 0.92 + 0.03 * min(longest, 14)))


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
    main = Drawing(model, view, unit, chosen)
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
        for drawing, shift, caption in drawings:
            moved = shift + np.array([x, y]) - low
            drawing.on(axes, moved)
            if caption:
                left, top = drawing.low[0] + moved[0], drawing.high[1] + moved[1]
                say(axes, left, top + 0.13, caption, 9, PALE, ha="left")

    return Panel(float(high[0] - low[0]), float(high[1] - low[1]), draw, main.nameless)


def _projected(
    model: Model, view: View, unit: float, names: tuple[str, ...]
) -> "Drawing":
    """Return the drawing of the dual of some of the sensors, in the same directions."""
    poc = model.poc.restricted(names)
    part = View.of(poc, list(Cubing(poc).vertices()), view)
    return Drawing(Model(model.name, "", poc), part, unit, None)


class Drawing:
    """A dual, measured: places in inches, labels placed.

    Attributes:
        low: The lower left corner of all that is drawn.
        high: The upper right corner.
        nameless: How many vertices there was no room to name.
    """

    def __init__(
        self, model: Model, view: View, unit: float, chosen: NDArray[np.bool_] | None
    ) -> None:
        count = len(view.corners)
        everything = np.ones(count, np.bool_)
        self._view, self._model = view, model
        self._shown = everything if chosen is None else chosen
        self._points = view.points * unit
        self._deep = view.layout.depths(view.corners)
        self._edges = np.flatnonzero(self._shown[view.edges].all(1))
        self._squares = np.flatnonzero(self._shown[view.squares].all(1))
        seen, possible = model.witnessed, model.possible
        self._seen = everything if seen is None else view.among(seen)
        self._possible = ~everything if possible is None else view.among(possible)
        self._marks = {view.find(mark.vertex): mark for mark in model.marks}
        self._names: dict[int, tuple[str, Floats]] = {}
        self.nameless = count
        if count <= NAMED:
            self._name()
        boxes = [self._points[self._shown] + side for side in (-0.14, 0.14)]
        for name, spot in self._names.values():
            half = np.array([_size(name)]) / 2
            boxes += [spot - half, spot + half]
        self.low: Floats = np.concatenate(boxes).min(0)
        self.high: Floats = np.concatenate(boxes).max(0)

    def _name(self) -> None:
        """Place the vertices' names."""
        self.nameless = 0
        shown = np.flatnonzero(self._shown)
        order = np.cumsum(self._shown) - 1
        names = [self._view.name(k) for k in shown.tolist()]
        radii = [
            _MARKED if k in self._marks or self._possible[k] else RADIUS
            for k in shown.tolist()
        ]
        spots = place_labels(
            self._points[shown],
            order[self._view.edges[self._edges]],
            np.array([_size(name) for name in names]),
            np.array(radii),
        )
        for k, name, spot in zip(shown.tolist(), names, spots, strict=True):
            if spot is None:
                self.nameless += 1
            else:
                self._names[k] = name, np.array(spot)

    def on(self, axes: "Axes", shift: Floats) -> None:
        """Draw it."""
        points = self._points + shift
        self._flesh(axes, points)
        self._target(axes, points)
        for k in np.flatnonzero(self._shown).tolist():
            x, y = points[k].tolist()
            self._vertex(axes, (x, y), k)
        for name, spot in self._names.values():
            x, y = spot + shift
            text = say(axes, x, y, name, _LABEL, layer=9, halo=True)
            text.set_gid("label")

    def _flesh(self, axes: "Axes", points: Floats) -> None:
        """Draw squares and edges, the farthest first."""
        view, deep = self._view, self._deep
        things = [(float(deep[view.squares[s]].mean()), 0, s) for s in self._squares]
        things += [
            (float(deep[view.edges[e]].mean()) + 0.02, 1, e) for e in self._edges
        ]
        for layer, (_, kind, number) in enumerate(sorted(things)):
            at = 1 + 4 * layer / len(things)
            (self._edge if kind else self._square)(axes, points, int(number), at)

    def _square(self, axes: "Axes", points: Floats, number: int, at: float) -> None:
        from matplotlib.patches import Polygon

        ring = points[self._view.squares[number]]
        middle = ring.mean(0)
        whole = self._seen[self._view.squares[number]].all()
        colour = self._view.tint(number, strong=bool(whole))
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
        ends = self._view.edges[number]
        colour = self._view.colours[self._view.crossed[number]]
        x, y = points[ends].T
        wide = THICK if self._seen[ends].all() else THIN
        axes.plot(x, y, color="white", lw=wide + 2.4, zorder=at - 1e-4)
        axes.plot(x, y, color=colour, lw=wide, zorder=at, solid_capstyle="round")

    def _target(self, axes: "Axes", points: Floats) -> None:
        """Draw where a morphism's dual leads the edges of its target's dual."""
        numbers = [self._view.find(mark.vertex) for mark in self._model.marks]
        for i, j in self._model.joined:
            x, y = points[[numbers[i], numbers[j]]].T
            axes.plot(x, y, color=RING, lw=10, alpha=0.3, zorder=5.5)

    def _vertex(self, axes: "Axes", at: Point, k: int) -> None:
        if self._possible[k]:
            halo(axes, at)
        dot(axes, at, seen=bool(self._seen[k]))
        if k in self._marks:
            put_mark(axes, at, self._marks[k])


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
            ring = Circle(
                point, _MARKED, fill=False, edgecolor=PUNCTURE, lw=2, zorder=8
            )
            axes.add_patch(ring)
        case _:
            colour = RING if mark.kind in ("median", "image") else INK
            disc = Circle(point, _MARKED, facecolor=colour, edgecolor="white", zorder=8)
            axes.add_patch(disc)
            say(axes, x, y, mark.sign, 9, "white", layer=8.5, weight="bold")


def _size(name: str) -> tuple[float, float]:
    """Return how wide and how high a vertex's name is."""
    return text_width(name, _LABEL) + 0.03, LINE * 0.75
