"""Where the parts of a dual are: for any kind of picture."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.hasse_layout import Measure
from neurosnap.apps.drawing.label_placement import place_labels
from neurosnap.apps.drawing.model import Model

if TYPE_CHECKING:
    from neurosnap.apps.drawing.layout_cost import Floats

NAMED = 48
"""The most vertices that are named."""

LABEL = 8.5
"""The size of a vertex's name, in points."""
RADIUS = 0.062
"""Of a vertex, in inches."""
MARKED = 0.115
"""Of one that is marked."""
_HIGH = 0.131


def unit_of(view: View) -> float:
    """Return how long an average edge is drawn."""
    extent = float(np.ptp(view.points, axis=0).max(initial=1.0))
    if len(view.corners) > NAMED:
        return float(np.clip(9.0 / extent, 0.4, 0.9))
    longest = max(len(view.name(k)) for k in range(len(view.corners)))
    return float(np.clip(8.0 / extent, 0.85, 0.92 + 0.03 * min(longest, 14)))


class DualPlaces:
    """A dual, measured: places in inches, labels placed.

    Args:
        model: What is marked.
        view: The dual.
        unit: How long an average edge is.
        chosen: ``(vertices,)`` bool: only these vertices, and what they span.
        measure: How wide a name is.

    Attributes:
        view: The dual.
        shown: ``(vertices,)`` bool: what is drawn.
        points: ``(vertices, 2)``.
        seen: ``(vertices,)`` bool: what a point or an observation shows.
        possible: ``(vertices,)`` bool: what holds the current state.
        marks: By vertex.
        joined: Pairs of vertices: the images of a target's edges.
        names: The names that have room, and their middles; by vertex.
        low: The lower left corner of all that is drawn.
        high: The upper right corner.
        nameless: How many vertices there was no room to name.
    """

    def __init__(
        self,
        model: Model,
        view: View,
        unit: float,
        chosen: NDArray[np.bool_] | None,
        measure: Measure,
    ) -> None:
        count = len(view.corners)
        everything = np.ones(count, np.bool_)
        self.view, self._measure = view, measure
        self.shown = everything if chosen is None else chosen
        self.points = view.points * unit
        self._deep = view.layout.depths(view.corners)
        self._edges = np.flatnonzero(self.shown[view.edges].all(1))
        self._squares = np.flatnonzero(self.shown[view.squares].all(1))
        seen, possible = model.witnessed, model.possible
        self.seen = everything if seen is None else view.among(seen)
        self.possible = ~everything if possible is None else view.among(possible)
        self.marks = {view.find(mark.vertex): mark for mark in model.marks}
        self.joined = [
            (view.find(model.marks[i].vertex), view.find(model.marks[j].vertex))
            for i, j in model.joined
        ]
        self.names: dict[int, tuple[str, Floats]] = {}
        self.nameless = count
        if count <= NAMED:
            self._place_names()
        boxes = [self.points[self.shown] + side for side in (-0.14, 0.14)]
        for name, spot in self.names.values():
            half = np.array([self.extent(name)]) / 2
            boxes += [spot - half, spot + half]
        self.low: Floats = np.concatenate(boxes).min(0)
        self.high: Floats = np.concatenate(boxes).max(0)

    def _place_names(self) -> None:
        """Place the vertices' names."""
        self.nameless = 0
        shown = np.flatnonzero(self.shown)
        order = np.cumsum(self.shown) - 1
        names = [self.view.name(k) for k in shown.tolist()]
        radii = [
            MARKED if k in self.marks or self.possible[k] else RADIUS
            for k in shown.tolist()
        ]
        spots = place_labels(
            self.points[shown],
            order[self.view.edges[self._edges]],
            np.array([self.extent(name) for name in names]),
            np.array(radii),
        )
        for k, name, spot in zip(shown.tolist(), names, spots, strict=True):
            if spot is None:
                self.nameless += 1
            else:
                self.names[k] = name, np.array(spot)

    def extent(self, name: str) -> tuple[float, float]:
        """Return how wide and how high a vertex's name is."""
        return self._measure(name, LABEL) + 0.03, _HIGH

    def flesh(self) -> list[tuple[bool, int]]:
        """Return squares and edges, the farthest first: is it an edge, and which."""
        view, deep = self.view, self._deep
        things = [(float(deep[view.squares[s]].mean()), 0, s) for s in self._squares]
        things += [
            (float(deep[view.edges[e]].mean()) + 0.02, 1, e) for e in self._edges
        ]
        return [(bool(kind), int(number)) for _, kind, number in sorted(things)]
