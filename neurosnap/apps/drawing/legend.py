"""The legend: direction and colour per sensor, and the meaning of the marks."""

from typing import TYPE_CHECKING

import numpy as np

from neurosnap.apps.drawing.dual_panel import (
    RING,
    SHINE,
    THIN,
    Point,
    dot,
    halo,
    put_mark,
)
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.model import Mark, Model
from neurosnap.apps.drawing.panel import (
    INK,
    PALE,
    Panel,
    beside,
    lines,
    say,
    stacked,
    text_width,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.axes import Axes

    Sign = Callable[["Axes", Point], None]

_ROW = 0.27
_SIGN = 0.52
_COLUMN = 18

_MEANINGS = {
    "puncture": ("taken out: no point shows it",),
    "split": ("its witnesses are not connected",),
    "median": ("median of the other three",),
    "corner": (),
    "image": ("vertex of the target's dual,", "and where the dual map leads it"),
}


def key_panel(model: Model, view: View, nameless: int, *, brief: bool) -> Panel:
    """Return the key of a dual.

    Args:
        model: What is marked.
        view: The dual.
        nameless: How many vertices there was no room to name.
        brief: Whether to say what the sensors are and no more.
    """
    sensors = [_entry(view.element(k), _arrow(view, k)) for k in range(len(view.own))]
    columns = [
        stacked(sensors[k : k + _COLUMN], 0) for k in range(0, len(sensors), _COLUMN)
    ]
    if brief:
        return beside(columns, 0.2)
    head = lines(
        [
            "An edge crosses the sensor of its",
            "direction and colour; it is on",
            "where the arrow leads.",
        ],
        8.5,
        PALE,
    )
    parts = [head, beside(columns, 0.2)]
    parts.append(stacked(_marks(model, view), 0))
    parts.append(lines(_words(nameless, len(view.corners)), 8.5, PALE))
    return stacked(parts, 0.16)


def _words(nameless: int, vertices: int) -> list[str]:
    """Return what the names of the vertices say."""
    if nameless == vertices:
        return ["Too many vertices to name them."]
    words = [
        "A vertex is named after what is on",
        "there, less what follows from that;",
        "∅: nothing is on.",
    ]
    if nameless:
        words.append(f"{nameless} had no room for a name.")
    return words


def _marks(model: Model, view: View) -> list[Panel]:
    """Return what the signs on vertices mean."""
    found: list[Panel] = []
    if model.witnessed is not None:
        found.append(_entry(f"a vertex: {model.witness} shows it", _dot))
        if len(model.witnessed) < len(model.vertices or ()):
            found.append(_entry("none does", lambda a, p: dot(a, p, seen=False)))
            found.append(_entry("not in the punctured dual", _thin(view)))
    else:
        found.append(_entry("a vertex: a state without contradiction", _dot))
    if model.possible is not None:
        found.append(_entry("possible in the current state", _halo))
    kinds = dict.fromkeys(mark.kind for mark in model.marks)
    for kind in kinds:
        first = next(mark for mark in model.marks if mark.kind == kind)
        for number, text in enumerate(_MEANINGS[kind]):
            found.append(_entry(text, _blank if number else _put(first)))
    if model.joined and model.target is not None:
        found.append(_entry("image of an edge there", _band))
    return found


def _entry(text: str, sign: "Sign") -> Panel:
    """Return a sign and what it means."""

    def draw(axes: "Axes", x: float, y: float) -> None:
        sign(axes, (x + _SIGN / 2, y + _ROW / 2))
        say(axes, x + _SIGN + 0.12, y + _ROW / 2, text, 9, INK, ha="left")

    return Panel(_SIGN + 0.12 + text_width(text, 9), _ROW, draw)


def _arrow(view: View, k: int) -> "Sign":
    """Return an arrow the way an element's edges run."""
    way = view.layout.directions[k]
    way = way / np.linalg.norm(way) * [_SIGN / 2, _SIGN / 2]
    # Rows are less high than signs are wide.
    way = way * min(1.0, _ROW * 0.36 / max(abs(float(way[1])), 1e-9))

    def draw(axes: "Axes", point: Point) -> None:
        axes.annotate(
            "",
            xy=(point[0] + way[0], point[1] + way[1]),
            xytext=(point[0] - way[0], point[1] - way[1]),
            arrowprops={
                "arrowstyle": "-|>",
                "color": view.colours[k],
                "lw": 2.6,
                "shrinkA": 0,
                "shrinkB": 0,
                "mutation_scale": 9,
            },
        )

    return draw


def _put(mark: Mark) -> "Sign":
    return lambda axes, point: put_mark(axes, point, mark)


def _dot(axes: "Axes", point: Point) -> None:
    dot(axes, point, seen=True)


def _thin(view: View) -> "Sign":
    """Return an edge and a tile as what no point shows is drawn."""

    def draw(axes: "Axes", point: Point) -> None:
        from matplotlib.patches import Rectangle

        x, y = point
        if len(view.squares):
            corner = x - _SIGN / 2, y - 0.36 * _ROW
            tile = Rectangle(corner, _SIGN, 0.72 * _ROW, lw=0, alpha=SHINE)
            tile.set_facecolor(view.tint(0, strong=False))
            axes.add_patch(tile)
        ends = [x - _SIGN / 2, x + _SIGN / 2], [y, y]
        axes.plot(*ends, color=view.colours[0], lw=THIN)

    return draw


def _halo(axes: "Axes", point: Point) -> None:
    halo(axes, point)
    dot(axes, point, seen=True)


def _band(axes: "Axes", point: Point) -> None:
    x, y = point
    axes.plot([x - _SIGN / 2, x + _SIGN / 2], [y, y], color=RING, lw=8, alpha=0.3)


def _blank(axes: "Axes", point: Point) -> None:
    """Draw nothing: the line above has the sign."""
