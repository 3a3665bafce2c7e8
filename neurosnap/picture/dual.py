"""The dual as a panel: tiles for squares, parallel edges in one colour, vertices.

What is farther from the eye is drawn first and shines through what is nearer; an edge
that passes in front of another interrupts it. A square's tile is smaller than the
square, so that it is plain which edges it lies between.
"""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.picture.labels import place_labels
from neurosnap.picture.layout import Floats
from neurosnap.picture.model import Mark, Model
from neurosnap.picture.panel import INK, LINE, Panel, say, text_width
from neurosnap.picture.view import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMED = 48
"""The most vertices that are named."""

RING = "#d4521a"
STATE = "#ffd23f"
_RADIUS = 0.062
_LABEL = 8.5


def unit_of(view: View) -> float:
    """Return how long an average edge is drawn."""
    extent = float(np.ptp(view.points, axis=0).max(initial=1.0))
    longest = max((len(view.name(k)) for k in range(len(view.corners))), default=1)
    if len(view.corners) > NAMED:
        return min(0.9, max(9.0 / extent, 0.4))
    return min(0.92 + 0.03 * min(longest, 14), max(8.0 / extent, 0.85))


def dual_panel(
    model: Model, view: View, unit: float, chosen: NDArray[np.bool_] | None = None
) -> Panel:
    """Return the drawing of a dual.

    Args:
        model: What is marked.
        view: The dual.
        unit: How long an average edge is.
        chosen: ``(vertices,)`` bool: only these vertices, and what they span.
    """
    drawing = _Drawing(model, view, unit, chosen)
    low, high = drawing.bounds()

    def draw(axes: "Axes", x: float, y: float) -> None:
        drawing.on(axes, np.array([x, y]) - low)

    return Panel(float(high[0] - low[0]), float(high[1] - low[1]), draw)


class _Drawing:
    """A dual, measured: places in inches, labels placed."""

    def __init__(
        self, model: Model, view: View, unit: float, chosen: NDArray[np.bool_] | None
    ) -> None:
        count = len(view.corners)
        self._view, self._model = view, model
        self._shown = np.ones(count, np.bool_) if chosen is None else chosen
        self._points = view.points * unit
        self._deep = view.layout.depths(view.corners)
        self._edges = np.flatnonzero(self._shown[view.edges].all(1))
        self._squares = np.flatnonzero(self._shown[view.squares].all(1))
        self._seen = (
            np.ones(count, np.bool_)
            if model.witnessed is None
            else view.among(model.witnessed)
        )
        self._marks = {view.find(mark.vertex): mark for mark in model.marks}
        self._names = [""] * count
        named = np.flatnonzero(self._shown)
        if count <= NAMED:
            for k in named.tolist():
                self._names[k] = view.name(k)
        sizes = np.array(
            [(text_width(self._names[k], _LABEL) + 0.04, LINE * 0.8) for k in named]
        ).reshape(-1, 2)
        order = np.cumsum(self._shown) - 1
        spots = place_labels(
            self._points[named], order[view.edges[self._edges]], sizes, _RADIUS
        )
        self._spots = {
            k: (spot, size)
            for k, spot, size in zip(named.tolist(), spots, sizes, strict=True)
            if spot is not None and self._names[k]
        }

    def bounds(self) -> tuple[Floats, Floats]:
        """Return the lower left and the upper right corner of all it draws."""
        here = self._points[self._shown]
        boxes = [here - 0.14, here + 0.14]
        for spot, size in self._spots.values():
            boxes += [np.array([spot]) - size / 2, np.array([spot]) + size / 2]
        every = np.concatenate(boxes)
        return every.min(0), every.max(0)

    def on(self, axes: "Axes", shift: Floats) -> None:
        """Draw it."""
        points = self._points + shift
        self._flesh(axes, points)
        self._map_edges(axes, points)
        for k in np.flatnonzero(self._shown).tolist():
            self._vertex(axes, points[k], k)
        for k, (spot, _) in self._spots.items():
            x, y = np.array(spot) + shift
            say(axes, x, y, self._names[k], _LABEL, layer=9).set_gid("label")

    def _flesh(self, axes: "Axes", points: Floats) -> None:
        """Draw squares and edges, the farthest first."""
        view = self._view
        deep = self._deep
        things = [(float(deep[view.squares[s]].mean()), 0, s) for s in self._squares]
        things += [
            (float(deep[view.edges[e]].mean()) + 0.02, 1, e) for e in self._edges
        ]
        for layer, (_, kind, number) in enumerate(sorted(things)):
            at = 1 + 4 * layer / max(len(things), 1)
            if kind:
                self._edge(axes, points, int(number), at)
            else:
                self._square(axes, points, int(number), at)

    def _square(self, axes: "Axes", points: Floats, number: int, at: float) -> None:
        from matplotlib.patches import Polygon

        ring = points[self._view.squares[number]]
        middle = ring.mean(0)
        one, two = (_rgb(self._view.colours[k]) for k in self._view.sides[number])
        colour = 0.66 + 0.34 * (one + two) / 2
        axes.add_patch(
            Polygon(
                middle + 0.86 * (ring - middle),
                facecolor=colour.tolist(),
                alpha=0.6,
                lw=0,
                zorder=at,
            )
        )

    def _edge(self, axes: "Axes", points: Floats, number: int, at: float) -> None:
        ends = self._view.edges[number]
        colour = self._view.colours[self._view.crossed[number]]
        x, y = points[ends].T
        wide = 3.0 if self._seen[ends].all() else 1.3
        axes.plot(x, y, color="white", lw=wide + 2.4, zorder=at - 1e-4)
        axes.plot(x, y, color=colour, lw=wide, zorder=at, solid_capstyle="round")

    def _map_edges(self, axes: "Axes", points: Floats) -> None:
        """Draw where a morphism's dual leads the edges of its target's dual."""
        numbers = [self._view.find(mark.vertex) for mark in self._model.marks]
        for i, j in self._model.joined:
            x, y = points[[numbers[i], numbers[j]]].T
            axes.plot(x, y, color=RING, lw=9, alpha=0.28, zorder=5.5)

    def _vertex(self, axes: "Axes", point: Floats, k: int) -> None:
        from matplotlib.patches import Circle

        state, mark = self._model.state, self._marks.get(k)
        if state is not None and not (state[list(self._view.own)] & ~self._view.corners[k]).any():
            off = state[[a ^ 1 for a in self._view.own]]
            if not (off & self._view.corners[k]).any():
                axes.add_patch(
                    Circle(point, 0.125, facecolor=STATE, edgecolor=INK, lw=0.8, zorder=6)
                )
        face = INK if self._seen[k] else "white"
        axes.add_patch(
            Circle(point, _RADIUS, facecolor=face, edgecolor=INK, lw=1.3, zorder=7)
        )
        if mark is not None:
            _mark(axes, point, mark)


def _mark(axes: "Axes", point: Floats, mark: Mark) -> None:
    """Draw a mark over a vertex."""
    from matplotlib.patches import Circle

    x, y = point
    match mark.kind:
        case "puncture":
            for way in (1, -1):
                ends = [x - 0.11, x + 0.11], [y - 0.11 * way, y + 0.11 * way]
                axes.plot(*ends, color="white", lw=5, zorder=7.5)
                axes.plot(*ends, color="#c1121f", lw=2.6, zorder=8)
        case "split":
            ring = Circle(point, 0.12, fill=False, edgecolor="#c1121f", lw=2, zorder=8)
            axes.add_patch(ring)
        case _:
            colour = RING if mark.kind in ("median", "image") else INK
            disc = Circle(point, 0.115, facecolor=colour, edgecolor="white", zorder=8)
            axes.add_patch(disc)
            say(axes, x, y, mark.sign, 9, "white", layer=8.5, weight="bold")


def _rgb(colour: str) -> Floats:
    """Return ``#rrggbb`` as three numbers in [0, 1]."""
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
