"""Plots of learning curves: one panel per setting, errors on a log scale.

A mean over runs is either 0 or at least two edges shared among the runs (an edge never
comes without its contrapositive). So below that least value the scale is linear and
holds nothing but 0, which gets its own tick: nothing is cut off, nothing is invented.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from neurosnap.system.picture import Rgb
from tools.paper.curves import Curve
from tools.paper.walks import SETTINGS, Setting

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas
    from numpy.typing import NDArray

Scale: TypeAlias = Literal["linear", "log"]
"""Of the steps."""

_COLUMNS = 800
"""Of a panel: a third of a point wide."""
_TITLES = {
    "path": "a path of 21 places, threshold sensors",
    "cycle": "a cycle of 20 places, beacons",
    "grid": "a grid of 11 × 11 places, threshold sensors",
    "random": "a path of 21 places, random fields",
}


@dataclass(frozen=True)
class Stroke:
    """How one curve is drawn."""

    curve: Curve
    label: str
    """Which step of the colour bar it is."""
    colour: Rgb


@dataclass(frozen=True)
class Bar:
    """A colour bar: steps of a quantity."""

    title: str
    labels: Sequence[str]
    """One a step, the least first."""
    colours: Sequence[Rgb]


def draw(
    canvas: "Canvas",
    strokes: Sequence[Stroke],
    title: str,
    bar: Bar,
    scale: Scale,
) -> None:
    """Draw four panels that share their scales, and one colour bar.

    Args:
        canvas: An empty canvas.
        strokes: All curves; each goes to the panel of its setting.
        title: Above everything.
        bar: What the colours mean.
        scale: Of the steps.
    """
    canvas.set_size_inches(11, 7.6)
    panels = canvas.subplots(2, 2, sharex=True, sharey=True)
    for axes, setting in zip(panels.flat, SETTINGS.values(), strict=True):
        chosen = [s for s in strokes if s.curve.cell.setting == setting.name]
        _panel(axes, setting, chosen, scale)
    _scale_errors(panels.flat[0], [stroke.curve for stroke in strokes])
    _scale_steps(panels.flat[0], len(strokes[0].curve.mean), scale)
    for axes in panels[1]:
        axes.set_xlabel("step t (observations)")
    for axes in panels[:, 0]:
        axes.set_ylabel("Err(t), mean of runs (edges)")
    _bar(canvas, panels, bar)
    canvas.suptitle(title)


def _bar(canvas: "Canvas", panels: "NDArray[Any]", bar: Bar) -> None:
    """Draw a colour bar to the right of the panels, the first step lowest."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm, ListedColormap

    count = len(bar.colours)
    edges = np.arange(count + 1) - 0.5
    scale = ScalarMappable(BoundaryNorm(edges, count), ListedColormap(bar.colours))
    drawn = canvas.colorbar(scale, ax=panels, ticks=range(count), shrink=0.6, aspect=25)
    drawn.set_ticklabels(bar.labels)
    drawn.minorticks_off()
    drawn.ax.tick_params(length=0, labelsize="small")
    drawn.ax.set_title(bar.title, fontsize="medium")


def _panel(
    axes: "Axes", setting: Setting, strokes: Sequence[Stroke], scale: Scale
) -> None:
    for stroke in strokes:
        places = drawn(stroke.curve.mean, scale)
        steps, mean = places + 1, stroke.curve.mean[places]
        axes.plot(steps, mean, color=stroke.colour, lw=1.1, label=stroke.label)
    title = f"({setting.letter}) {_TITLES[setting.name]}"
    if len({stroke.curve.mean.tobytes() for stroke in strokes}) == 1 < len(strokes):
        # Not on the panel: there is no place on it that no line may run through.
        title += f": all {len(strokes)} coincide"
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.25, lw=0.6)


def drawn(mean: "NDArray[np.float64]", scale: Scale) -> "NDArray[np.int64]":
    """Return the places of a curve that are drawn: of many, those that can be seen.

    A file of vectors would hold all of them. In each column of the panel the first of
    the least and the first of the largest are drawn, and so are the ends.
    """
    count = len(mean)
    spaced = np.geomspace if scale == "log" else np.linspace
    edges = np.unique(spaced(1, count + 1, _COLUMNS + 1).astype(np.int64)) - 1
    chosen = {0, count - 1}
    for start, stop in pairwise(edges.tolist()):
        column = mean[start:stop]
        chosen |= {start + int(column.argmin()), start + int(column.argmax())}
    return np.array(sorted(chosen), np.int64)


def _scale_errors(axes: "Axes", curves: Sequence[Curve]) -> None:
    """Set the errors' scale in all panels: linear below the least mean but 0."""
    floor = 2 / curves[0].cell.runs
    top = 1.5 * max(float((curve.mean + curve.std).max()) for curve in curves)
    top = max(top, 10 * floor)  # one decade at least, to have a tick
    axes.set_yscale("symlog", linthresh=floor, linscale=0.4)
    powers = np.arange(np.ceil(np.log10(floor)), np.floor(np.log10(top)) + 1)
    decades = 10.0**powers
    axes.set_yticks([0.0, *decades], ["0", *(f"{decade:g}" for decade in decades)])
    minor = np.outer(10.0 ** np.arange(powers[0] - 1, powers[-1] + 1), np.arange(2, 10))
    axes.set_yticks(minor[(minor > floor) & (minor < top)], minor=True)
    axes.set_ylim(-floor / 4, top)  # what lies at 0 shows whole


def _scale_steps(axes: "Axes", steps: int, scale: Scale) -> None:
    """Set the steps' scale in all panels; the last step is not on the frame."""
    axes.set_xscale(scale)
    if scale == "log":
        decades = 10 ** np.arange(int(np.log10(steps)) + 1)
        axes.set_xticks(decades, [str(decade) for decade in decades.tolist()])
        axes.set_xlim(1, 1.15 * max(steps, 2))
    else:
        axes.set_xlim(0, 1.01 * max(steps, 2))
