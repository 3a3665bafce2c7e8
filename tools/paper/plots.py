"""Draws curves, one panel per setting, on a log scale extended to 0."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tools.paper.walks import SETTINGS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

Scale: TypeAlias = Literal["linear", "log"]
"""Of the steps."""

_BINS: dict[Scale, int] = {"linear": 400, "log": 100}
"""Of a curve's steps: more could not be seen one by one."""
_TITLES = {
    "path": "a path of 21 places, threshold sensors",
    "cycle": "a cycle of 20 places, beacons",
    "grid": "a grid of 11 × 11 places, threshold sensors",
    "random": "a path of 21 places, random fields",
}


@dataclass(frozen=True)
class Stroke:
    """How one curve is drawn."""

    setting: str
    label: str
    colour: str
    values: NDArray[np.generic]
    """``(runs, steps)``; their mean is drawn."""
    band: bool = False
    """Whether the quartiles of the runs are shown, too."""
    style: str = "-"


def shades(count: int) -> list[str]:
    """Return colours for the steps of a quantity, dark first, for lines on white."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    # What is lighter than 0.85 of the scale is lost on white paper.
    return [to_hex(each) for each in colormaps["viridis"](np.linspace(0, 0.85, count))]


def draw(
    canvas: "Canvas",
    strokes: Sequence[Stroke],
    title: str,
    what: str,
    least: float,
    scale: Scale = "log",
) -> None:
    """Draw curves in the panels of their settings.

    Args:
        canvas: What is drawn on; empty.
        strokes: The curves.
        title: Of the picture.
        what: What they are curves of.
        least: The least value but 0; below it the scale is linear, so 0 is on it.
        scale: Of the steps.
    """
    canvas.set_size_inches(11, 7.6)
    panels = canvas.subplots(2, 2, sharex=True, sharey=True)
    for axes, setting in zip(panels.flat, SETTINGS.values(), strict=True):
        for stroke in strokes:
            if stroke.setting == setting.name:
                _draw_one(axes, stroke, scale)
        axes.set_title(f"({setting.letter}) {_TITLES[setting.name]}", fontsize="medium")
        axes.grid(alpha=0.25, lw=0.6)
    first = panels[0, 0]
    first.set_xscale(scale)
    first.set_yscale("symlog", linthresh=least, linscale=0.4)
    first.set_ylim(bottom=-least / 4)  # what lies at 0 shows whole
    handles, labels = first.get_legend_handles_labels()
    canvas.legend(handles, labels, loc="outside right center", frameon=False)
    canvas.supxlabel("step (observations)", fontsize="medium")
    canvas.supylabel(what, fontsize="medium")
    canvas.suptitle(title)


def _draw_one(axes: "Axes", stroke: Stroke, scale: Scale) -> None:
    """Draw the mean of each bin of steps: late steps lie too dense on a log scale."""
    count = stroke.values.shape[1]
    spaced = np.geomspace if scale == "log" else np.linspace
    first = spaced(1, count + 1, _BINS[scale], endpoint=False)
    edges = np.unique(first.astype(np.intp)) - 1
    widths = np.diff(np.append(edges, count))
    binned = np.add.reduceat(stroke.values, edges, axis=1, dtype=np.float64) / widths
    steps = edges + (widths + 1) / 2
    if stroke.band:
        low, high = np.percentile(binned, (25, 75), axis=0)
        axes.fill_between(steps, low, high, color=stroke.colour, alpha=0.15, lw=0)
    mean = binned.mean(axis=0)
    axes.plot(
        steps, mean, stroke.style, color=stroke.colour, lw=1.1, label=stroke.label
    )
