"""Draws the Hasse diagram: one box per element, in the colour of its edges."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.hasse_layout import HIGH, SIZE, lay_out_hasse
from neurosnap.apps.drawing.layout_cost import Floats
from neurosnap.apps.drawing.panel import INK, PALE, STATE, Panel, say, text_width
from neurosnap.poc.order.pocset import PocSet
from neurosnap.system.palette import ink_on, rgb

if TYPE_CHECKING:
    from matplotlib.axes import Axes


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
    hasse = lay_out_hasse(poc, text_width)

    def draw(axes: "Axes", left: float, low: float) -> None:
        for line in hasse.lines:
            _line(axes, line + np.array([left, low]))
        for k, a in enumerate(hasse.heads):
            x, y = hasse.places[k].tolist()
            place, wide = (x + left, y + low), float(hasse.wide[k])
            if state is not None and state[a]:
                _lit(axes, place, wide)
            _box(axes, poc, view, a, hasse.names[k], place, wide)

    return Panel(*hasse.size, draw)


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

    corner = place[0] - wide / 2, place[1] - HIGH / 2
    style = "round,pad=0.035,rounding_size=0.08"
    shape = FancyBboxPatch(
        corner, wide, HIGH, boxstyle=style, facecolor=STATE, edgecolor="none"
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
            (x - wide / 2 + 0.03, y - HIGH / 2 + 0.03),
            wide - 0.06,
            HIGH - 0.06,
            boxstyle="round,pad=0.03,rounding_size=0.06",
            facecolor=colour if filled else "white",
            edgecolor=(colour or INK) if proper else PALE,
            lw=1.4,
            ls="-" if proper else (0, (3, 2)),
            zorder=2,
        )
    )
    ink = ink_on(rgb(colour)) if filled and colour else INK if proper else PALE
    say(axes, x, y, name, SIZE, ink, layer=3).set_gid("element")
