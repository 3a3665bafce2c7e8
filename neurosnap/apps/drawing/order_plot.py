"""A picture of an order for notebooks: its Hasse diagram."""

import warnings
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.apps.drawing.hasse_layout import HIGH, lay_out_hasse
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium
from neurosnap.system.picture import canvas_type

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST = 120
"""Sensors that are drawn: of more the names could not be read."""

INK = "#22262b"
PALE = "#8a9099"
STATE = "#ffd23f"

_SIZE = 9.0  # of a name, in points
_MARGIN = 0.15


def plot_order(
    graph: PocGraph, sensors: Sensorium, state: ArrayLike | None = None
) -> "Figure":
    """Return the Hasse diagram of an order as a figure of matplotlib.

    What stands below implies what a line leads up to; literals that imply each other
    are one box. Jupyter shows the figure once matplotlib.pyplot is imported; `savefig`
    writes it.

    Args:
        graph: What was learned: `Snapshot.poc_graph`.
        sensors: The names of its sensors.
        state: ``(2N,)`` bool: literals that are believed now, to be lit; None if none
            are to be.

    Returns:
        As large as what is on it, in inches.

    Raises:
        InvalidValueError: There are more than `MOST` sensors; or a literal is
            equivalent to its own complement, as unknown readings may have it.
        ShapeError: `graph` or `state` is of other sensors.
        MissingExtraError: matplotlib is not installed.
    """
    if len(sensors) > MOST:
        raise InvalidValueError("sensors", f"must be at most {MOST}", len(sensors))
    lit = None if state is None else np.asarray(state, np.bool_)
    if lit is not None and lit.shape != (2 * len(sensors),):
        raise ShapeError("state", f"must be ({2 * len(sensors)},)", lit.shape)
    figure = canvas_type("picture")()
    axes = figure.add_axes((0, 0, 1, 1))
    size = _draw_order(axes, PocSet.from_graph(graph, sensors), lit)
    figure.set_size_inches(*size)
    return figure


def _draw_order(
    axes: "Axes", poc: PocSet, state: NDArray[np.bool_] | None
) -> tuple[float, float]:
    """Draw a Hasse diagram, in inches; return how wide and how high it is.

    A box holds an element: all literals that are equal. A negligible or ubiquitous
    element's box is dashed.

    Args:
        axes: What is drawn on.
        poc: The order.
        state: ``(2N,)`` bool: literals to be lit; None if none are to be.
    """
    hasse = lay_out_hasse(poc, text_width)
    width, height = (2 * _MARGIN + length for length in hasse.size)
    axes.set(xlim=(-_MARGIN, width - _MARGIN), ylim=(-_MARGIN, height - _MARGIN))
    axes.set_axis_off()
    for line in hasse.lines:
        axes.plot(*line.T, color=PALE, lw=1.1, zorder=1, solid_joinstyle="round")
    for k, literal in enumerate(hasse.heads):
        x, y = hasse.places[k].tolist()
        wide, proper = float(hasse.wide[k]), bool(poc.proper[literal])
        if state is not None and state[literal]:
            _box(axes, x, y, wide + 0.08, HIGH + 0.08, fc=STATE, ec="none", zorder=1.5)
        ink, dash = (INK, "-") if proper else (PALE, "--")
        _box(axes, x, y, wide, HIGH, fc="white", ec=ink, ls=dash, lw=1.4, zorder=2)
        axes.text(
            x,
            y,
            hasse.names[k],
            fontsize=_SIZE,
            color=ink,
            ha="center",
            va="center_baseline",
            zorder=3,
            parse_math=False,  # a dollar sign is a dollar sign
        )
    return width, height


def _box(
    axes: "Axes", x: float, y: float, wide: float, high: float, **style: object
) -> None:
    """Draw a box with rounded corners around a point."""
    from matplotlib.patches import FancyBboxPatch

    corner = x - wide / 2 + 0.05, y - high / 2 + 0.05
    shape = "round,pad=0.05,rounding_size=0.06"
    box = FancyBboxPatch(corner, wide - 0.1, high - 0.1, boxstyle=shape)
    axes.add_patch(box)
    box.set(**style)


@lru_cache(maxsize=4096)
def text_width(text: str, size: float = _SIZE) -> float:
    """Return how wide a text is, in inches."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size)
    with warnings.catch_warnings():
        # A name may be in a script that the font lacks: it shows as boxes.
        warnings.filterwarnings("ignore", message="Glyph")
        size_of = text_to_path.get_text_width_height_descent
        points, _, _ = size_of(text, font, ismath=False)
    return float(points) / 72
