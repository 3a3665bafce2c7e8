"""The picture of a model: the Hasse diagram of its order, and its dual.

The dual is a linear image of the cube: every element has one direction, and a vertex
lies at the sum of the directions of the elements it has on. So edges that cross the
same hyperplane are parallel and equally long, and squares are parallelograms.
"""

import textwrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.hasse_layout import element_name, short
from neurosnap.apps.drawing.order_plot import INK, PALE, STATE, draw_order, text_width
from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.cubing import Cubing
from neurosnap.poc.dual.homology import cubes_among
from neurosnap.poc.dual.realization import corners
from neurosnap.poc.order.pocset import PocSet
from neurosnap.system.picture import HUES, canvas_type, mixed
from tools.paper.model import Model, Vertex

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 120
"""The most elements that are drawn: 60 sensors. Of more the names could not be read."""

Floats = NDArray[np.float64]

_MARK = "#c1121f"
_NAMED = 48  # the most vertices that are named
_LONGER = 0.13  # by which a chain's direction is longer than that of the one before
_TOP, _EDGE = 0.9, 0.6  # inches


def picture(model: Model) -> "Figure":
    """Return the picture of a model: order, dual if it is listed, and key.

    Raises:
        InvalidValueError: It has more than `MOST` elements.
        MissingExtraError: matplotlib is not installed.
    """
    elements = len(np.unique(model.poc.graph.representative))
    if elements > MOST:
        rule = f"must have at most {MOST} elements to be drawn; keep some with --only"
        raise InvalidValueError("model", rule, elements)
    figure = canvas_type("picture")(figsize=(1, 1))
    order, dual = figure.add_axes((0, 0, 1, 1)), figure.add_axes((0, 0, 1, 1))
    own = [a for a in model.poc.heads.tolist() if not a & 1]
    colours = dict(zip(own, _colours(len(own)), strict=True))
    width, height = draw_order(
        order, model.poc, model.state, lambda literal: colours.get(literal & ~1)
    )
    wide, high, key = 0.0, 0.0, 0.0
    if model.vertices is not None:
        wide, high, key = _draw_dual(dual, model, colours)
    else:
        dual.set_axis_off()
    heading = [model.title, *_wrapped(model), *model.measures()]
    across = width + wide + key + 2 * _EDGE
    size = max(across, 8.0), max(height, high) + _TOP + 2 * _EDGE
    figure.set_size_inches(*size)
    for axes, left, across, up in (
        (order, 0, width, height),
        (dual, width, wide, high),
    ):
        low = (size[1] - _TOP - up) / 2
        axes.set_position(
            ((left + _EDGE) / size[0], low / size[1], across / size[0], up / size[1])
        )
    text = "\n".join(heading)
    figure.text(0.02, 1 - 0.15 / size[1], text, va="top", parse_math=False, fontsize=9)
    return figure


def _wrapped(model: Model) -> list[str]:
    """Return the relations, where they fit into a line."""
    lines = textwrap.wrap(str(model.poc), 110)
    return lines if len(lines) == 1 else [f"{len(model.poc)} sensors"]


def _colours(count: int) -> list[str]:
    """Return a colour for each element: hues in turns, from dark to light."""
    steps = max(1, (count - 1) // len(HUES))
    return [mixed(*HUES[k % len(HUES)], k // len(HUES) / steps) for k in range(count)]


def _draw_dual(
    axes: "Axes", model: Model, colours: dict[int, str]
) -> tuple[float, float, float]:
    """Draw a dual; return how wide and high it is, and how wide its key, in inches."""
    vertices = model.vertices or []
    rows = corners(model.poc, vertices)
    number = {row.tobytes(): k for k, row in enumerate(rows)}
    edges, squares = _cells(rows, number)
    own = list(colours)
    points = rows @ directions_of(model.poc, own)
    points = points - (points.min(axis=0) if len(points) else 0)
    shown = _chosen(model.poc, number, model.witnessed)
    lit = _chosen(model.poc, number, _possible(model))
    for ring in squares:
        axes.fill(*points[ring].T, color=PALE, alpha=0.12, lw=0, zorder=1)
    for a, b, way in edges:
        wide = 2.6 if not shown or {a, b} <= shown else 1.1
        axes.plot(*points[[a, b]].T, color=colours[own[way]], lw=wide, zorder=2)
    middle = points.mean(axis=0)
    for k, (x, y) in enumerate(points.tolist()):
        fill = INK if not shown or k in shown else "white"
        edge, size = (STATE, 9) if k in lit else (INK, 6)
        axes.plot(x, y, "o", color=fill, mec=edge, mew=1.5, ms=size, zorder=3)
        if len(points) <= _NAMED:
            off = 9 * np.sign(np.round(points[k] - middle, 6) + 1e-9)
            axes.annotate(
                _name(model.poc, vertices[k]),
                (x, y),
                off.tolist(),
                textcoords="offset points",
                ha="left" if off[0] > 0 else "right",
                va="center",
                fontsize=8,
                parse_math=False,
            )
    for k in _chosen(model.poc, number, list(model.marked)):
        axes.plot(*points[k], "x", color=_MARK, ms=11, mew=2.5, zorder=4)
    for literal, colour in colours.items():
        axes.plot([], [], color=colour, lw=2.6, label=element_name(model.poc, literal))
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, frameon=False)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.2)
    axes.set_axis_off()
    span = np.ptp(points, axis=0) if len(points) else np.zeros(2)
    wide, high = np.clip(span, 1.5, 9.0) + 1.2
    names = [text_width(element_name(model.poc, literal), 8.0) for literal in colours]
    return float(wide), float(high), 0.6 + max(names)


def _cells(
    rows: NDArray[np.bool_], number: dict[bytes, int]
) -> tuple[list[tuple[int, int, int]], list[list[int]]]:
    """Return edges, with the element each crosses, and squares, around."""
    edges: list[tuple[int, int, int]] = []
    squares: list[list[int]] = []
    for corner, spanned in cubes_among(rows):
        ways = np.flatnonzero(spanned).tolist()
        if len(ways) > 2:
            break
        ring = [corner.copy()]
        for way in (*ways, *ways[:-1]):
            ring.append(ring[-1].copy())
            ring[-1][way] ^= True
        found = [number[each.tobytes()] for each in ring[: 2 * len(ways)]]
        if len(ways) == 1:
            edges.append((found[0], found[1], ways[0]))
        elif ways:
            squares.append(found)
    return edges, squares


def _possible(model: Model) -> list[Vertex] | None:
    """Return the vertices that the current state leaves possible, ``h(S)``."""
    if model.state is None:
        return None
    return list(Cubing(model.poc).convex_set(model.state))


def _chosen(
    poc: PocSet, number: dict[bytes, int], vertices: list[Vertex] | None
) -> set[int]:
    return {number[row.tobytes()] for row in corners(poc, vertices or [])}


def _name(poc: PocSet, vertex: Vertex) -> str:
    """Return what a vertex has on, less what follows from the rest of it."""
    on = [a for a in poc.heads.tolist() if not a & 1 and vertex[a]]
    least = [a for a in on if not any(poc.order[b, a] for b in on if b != a)]
    return " ".join(short(poc.name(a)) for a in least) or "∅"


def directions_of(poc: PocSet, elements: list[int]) -> Floats:
    """Return the direction of each element, ``(n, 2)``.

    A chain has one direction, so that a path is straight and a grid is a grid. Chains
    that exclude each other point all around, others upwards. Each is a little longer
    than the one before: no two sums of some of them fall together then.
    """
    chains: list[list[int]] = []
    for element in elements:
        for chain in chains:
            if all(poc.leq(element, b) or poc.leq(b, element) for b in chain):
                chain.append(element)
                break
        else:
            chains.append([element])
    tops = [next(a for a in c if all(poc.leq(b, a) for b in c)) for c in chains]
    apart = [sum(poc.leq(a, b ^ 1) for b in tops) for a in tops]
    around = min(apart, default=0) > len(tops) / 4
    ways = np.empty((len(elements), 2))
    for number, chain in enumerate(chains):
        angle = (2 if around else 1) * np.pi * number / len(chains)
        length = 1 if around else 1 + _LONGER * number
        for element in chain:
            ways[elements.index(element)] = (
                length * np.cos(angle),
                length * np.sin(angle),
            )
    return ways
