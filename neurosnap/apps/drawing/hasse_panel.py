"""Draws the Hasse diagram: one box per element, in the colour of its edges."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_view import View, element_name
from neurosnap.apps.drawing.layout_cost import Floats
from neurosnap.apps.drawing.panel import INK, LINE, PALE, STATE, Panel, say, text_width
from neurosnap.apps.drawing.rank_layout import stand
from neurosnap.poc.order.pocset import PocSet
from neurosnap.system.palette import ink_on, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 9.0
_HIGH = 1.35 * LINE


def hasse_panel(
    poc: PocSet, view: View | None, state: NDArray[np.bool_] | None = None
) -> Panel:
    """Return the Hasse diagram of a poc set, bounds left out.

    A box holds an element: all literals that are equal. Its colour is that of the
    edges it crosses in the dual; a complement's box is white, a negligible or
    ubiquitous element's is dashed.

    Args:
        poc: The poc set.
        view: Its dual, for the colours.
        state: ``(2N,)`` bool: the literals of the current state, to be shown.
    """
    heads = np.unique(poc.graph.representative).tolist()
    number = {a: k for k, a in enumerate(heads)}
    covers = np.array(
        [(number[a], number[b]) for a, b in poc.hasse()], np.int64
    ).reshape(-1, 2)
    mates = np.array([number[a ^ 1] for a in heads], np.int64)
    names = [element_name(poc, a) for a in heads]
    wide = np.array([text_width(name, _SIZE) + 0.16 for name in names])
    wide = np.maximum(np.maximum(wide, wide[mates]), 0.32)
    stood = stand(covers, wide, mates)
    x, rank = stood.across, stood.rank
    span = max(float(np.ptp(rank)), 1e-9)
    # Lines that pass ranks need room between them, and wide orders steep lines.
    least = 2.8 if all(len(line) < 3 for line in stood.lines) else 9.0
    step = float(np.clip(least / span, 0.56, 0.9))
    step = max(step, min(float(x.max()) / 3 / span, 1.8))
    y = (rank - rank.min()) * step + 0.16

    def draw(axes: "Axes", left: float, low: float) -> None:
        for line in lines:
            _line(axes, line + np.array([left, low]))
        for k, a in enumerate(heads):
            place = x[k] + left, y[k] + low
            if state is not None and state[a]:
                _lit(axes, place, float(wide[k]))
            _box(axes, poc, view, a, names[k], place, float(wide[k]))

    boxes = np.stack([x - wide / 2, y - _HIGH / 2, x + wide / 2, y + _HIGH / 2], 1)
    lines = [
        _routed(
            np.stack([line[:, 0], (line[:, 1] - rank.min()) * step + 0.16], axis=1),
            np.delete(boxes, pair, axis=0),
        )
        for line, pair in zip(stood.lines, covers.tolist(), strict=True)
    ]
    reach = [float(line[:, 0].max()) for line in lines]
    width = max([float((x + wide / 2).max()), *reach])
    return Panel(width, float(y.max()) + 0.16, draw)


def _routed(line: Floats, boxes: Floats) -> Floats:
    """Return a line pulled tight: straight as far as it keeps clear of the boxes."""
    # Upright beside the boxes of the ranks it passes.
    inner = np.repeat(line[1:-1], 2, axis=0)
    inner[::2, 1] -= _HIGH / 2
    inner[1::2, 1] += _HIGH / 2
    points = np.concatenate([line[:1], inner, line[-1:]])
    kept = [0]
    while kept[-1] < len(points) - 1:
        here = kept[-1]
        ahead = range(len(points) - 1, here, -1)
        seen = (k for k in ahead if _is_clear(points[here], points[k], boxes))
        kept.append(next(seen, here + 1))
    return points[kept]


def _is_clear(start: Floats, end: Floats, boxes: Floats) -> bool:
    """Return whether a straight line keeps clear of boxes."""
    way = start + np.linspace(0, 1, 80)[:, None] * (end - start)
    off = np.maximum(boxes[:, None, :2] - way, way - boxes[:, None, 2:])
    return bool((off.max(axis=2) > 0.03).all())


def _line(axes: "Axes", points: Floats) -> None:
    """Draw a line from one element to another, its corners rounded."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    path, codes = [points[0]], [Path.MOVETO]
    for before, here, after in zip(points, points[1:], points[2:], strict=False):
        path += [_towards(here, before), here, _towards(here, after)]
        codes += [Path.LINETO, Path.CURVE3, Path.CURVE3]
    path.append(points[-1])
    codes.append(Path.LINETO)
    shape = Path(np.array(path), codes)
    axes.add_patch(PathPatch(shape, fill=False, edgecolor=PALE, lw=1.1, zorder=1))


def _lit(axes: "Axes", place: tuple[float, float], wide: float) -> None:
    """Draw what shows that the current state holds an element."""
    from matplotlib.patches import FancyBboxPatch

    corner = place[0] - wide / 2, place[1] - _HIGH / 2
    style = "round,pad=0.035,rounding_size=0.08"
    shape = FancyBboxPatch(
        corner, wide, _HIGH, boxstyle=style, facecolor=STATE, edgecolor="none"
    )
    shape.set_zorder(1.5)
    axes.add_patch(shape)


def _towards(start: Floats, end: Floats) -> Floats:
    """Return where a corner at `start` begins to be rounded on the way to `end`."""
    length = float(np.linalg.norm(end - start))
    return start + (end - start) * min(0.12 / max(length, 1e-9), 0.5)


def _box(
    axes: "Axes",
    poc: PocSet,
    view: View | None,
    a: int,
    name: str,
    place: tuple[float, float],
    wide: float,
) -> None:
    """Draw an element."""
    from matplotlib.patches import FancyBboxPatch

    x, y = place
    colour = None if view is None else view.colour_of(a)
    proper = bool(poc.proper[a])
    filled = proper and not a & 1 and colour is not None
    axes.add_patch(
        FancyBboxPatch(
            (x - wide / 2 + 0.03, y - _HIGH / 2 + 0.03),
            wide - 0.06,
            _HIGH - 0.06,
            boxstyle="round,pad=0.03,rounding_size=0.06",
            facecolor=colour if filled else "white",
            edgecolor=(colour or INK) if proper else PALE,
            lw=1.4,
            ls="-" if proper else (0, (3, 2)),
            zorder=2,
        )
    )
    ink = ink_on(rgb(colour)) if filled and colour else INK if proper else PALE
    say(axes, x, y, name, _SIZE, ink, layer=3).set_gid("element")
