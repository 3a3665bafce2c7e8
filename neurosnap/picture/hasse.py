"""The Hasse diagram as a panel: an element a box, in the colour of its edges."""

from typing import TYPE_CHECKING

import numpy as np

from neurosnap.picture.layout import Floats
from neurosnap.picture.panel import INK, LINE, PALE, Panel, say, text_width
from neurosnap.picture.ranks import stand
from neurosnap.picture.view import View, element_name
from neurosnap.poc.pocset import PocSet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SIZE = 9.0


def hasse_panel(poc: PocSet, view: View | None) -> Panel:
    """Return the Hasse diagram of a poc set, bounds left out.

    A box holds an element: all literals that are equal. Its colour is that of the
    edges it crosses in the dual; a complement's box is white, a negligible or
    ubiquitous element's is dashed.

    Args:
        poc: The poc set.
        view: Its dual, for the colours.
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
    step = float(np.clip(6.5 / max(np.ptp(rank), 1e-9), 0.52, 0.95))
    y = (rank - rank.min()) * step + 0.16

    def draw(axes: "Axes", left: float, low: float) -> None:
        for line in stood.lines:
            level = (line[:, 1] - rank.min()) * step + 0.16
            _line(axes, line[:, 0] + left, level + low)
        for k, a in enumerate(heads):
            place = x[k] + left, y[k] + low
            _box(axes, poc, view, a, names[k], place, float(wide[k]))

    reach = [float(line[:, 0].max()) for line in stood.lines]
    width = max([float((x + wide / 2).max()), *reach])
    return Panel(width, float(y.max()) + 0.16, draw)


def _line(axes: "Axes", x: Floats, y: Floats) -> None:
    """Draw a line from one element to another, smooth where it passes between."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    points = np.stack([x, y], axis=1)
    middles = (points[1:-2] + points[2:-1]) / 2
    path, codes = [points[0]], [Path.MOVETO]
    for k in range(1, len(points) - 1):
        last = k == len(points) - 2
        path += [points[k], points[-1] if last else middles[k - 1]]
        codes += [Path.CURVE3, Path.CURVE3]
    if len(points) == 2:
        path.append(points[1])
        codes.append(Path.LINETO)
    shape = Path(np.array(path), codes)
    axes.add_patch(PathPatch(shape, fill=False, edgecolor=PALE, lw=1.1, zorder=1))


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
    high = LINE * 1.35
    colour = None if view is None else view.colour_of(a)
    proper = bool(poc.proper[a])
    filled = proper and not a & 1 and colour is not None
    axes.add_patch(
        FancyBboxPatch(
            (x - wide / 2 + 0.03, y - high / 2 + 0.03),
            wide - 0.06,
            high - 0.06,
            boxstyle="round,pad=0.03,rounding_size=0.06",
            facecolor=colour if filled else "white",
            edgecolor=(colour or INK) if proper else PALE,
            lw=1.4,
            ls="-" if proper else (0, (3, 2)),
            zorder=2,
        )
    )
    ink = "white" if filled else INK if proper else PALE
    say(axes, x, y, name, _SIZE, ink, layer=3).set_gid("element")
