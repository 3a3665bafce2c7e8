"""Panels: parts of a picture that know their size.

A panel is measured before anything is drawn, in inches, with the text it holds; so
panels can be put side by side or below each other without overlap, and the page is as
large as what is on it.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.text import Text

INK = "#22262b"
PALE = "#8a9099"
STATE = "#ffd23f"
LINE = 0.175
"""The height of a line of ordinary text."""

_LONGEST = 28


@dataclass(frozen=True, slots=True)
class Panel:
    """A part of a picture.

    Attributes:
        width: How wide it is.
        height: How high it is.
        draw: Draws it; told the axes and where its lower left corner is.
        nameless: How many of its parts there was no room to name.
    """

    width: float
    height: float
    draw: Callable[["Axes", float, float], None]
    nameless: int = 0


def beside(panels: Sequence[Panel], gap: float = 0.5) -> Panel:
    """Return panels from left to right, level at the top."""
    height = max((panel.height for panel in panels), default=0.0)

    def draw(axes: "Axes", x: float, y: float) -> None:
        for panel in panels:
            panel.draw(axes, x, y + height - panel.height)
            x += panel.width + gap

    width = sum(panel.width for panel in panels) + gap * max(len(panels) - 1, 0)
    return Panel(width, height, draw)


def stacked(panels: Sequence[Panel], gap: float = 0.3) -> Panel:
    """Return panels from top to bottom, flush left."""
    height = sum(panel.height for panel in panels) + gap * max(len(panels) - 1, 0)

    def draw(axes: "Axes", x: float, y: float) -> None:
        top = y + height
        for panel in panels:
            panel.draw(axes, x, top - panel.height)
            top -= panel.height + gap

    return Panel(max((panel.width for panel in panels), default=0.0), height, draw)


def lines(texts: Sequence[str], size: float = 9, colour: str = INK) -> Panel:
    """Return lines of text."""
    step = LINE * size / 9

    def draw(axes: "Axes", x: float, y: float) -> None:
        for k, text in enumerate(reversed(texts)):
            say(axes, x, y + k * step + step / 2, text, size, colour, ha="left")

    width = max((text_width(text, size) for text in texts), default=0.0)
    return Panel(width, step * len(texts), draw)


def captioned(caption: str, panel: Panel) -> Panel:
    """Return a panel with a line above it."""
    return stacked([lines([caption], 10.5), panel], 0.14)


def say(
    axes: "Axes",
    x: float,
    y: float,
    text: str,
    size: float = 9,
    colour: str = INK,
    *,
    ha: str = "center",
    layer: float = 9.0,
    weight: str = "normal",
    halo: bool = False,
) -> "Text":
    """Write a text, its middle at a height; a dollar sign is a dollar sign."""
    from matplotlib.patheffects import withStroke

    return axes.text(
        x,
        y,
        text,
        fontsize=size,
        color=colour,
        ha=ha,
        va="center_baseline",
        zorder=layer,
        weight=weight,
        parse_math=False,
        path_effects=[withStroke(linewidth=2.2, foreground="white")] if halo else [],
    )


@lru_cache(maxsize=4096)
def text_width(text: str, size: float) -> float:
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


def short(name: str) -> str:
    """Return a name, its middle left out if it is very long."""
    if len(name) <= _LONGEST:
        return name
    half = _LONGEST // 2
    return f"{name[: half - 1]}…{name[-half:]}"
