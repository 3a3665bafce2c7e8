"""A page with the Hasse diagram, the dual and the legend of a model."""

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

from neurosnap.apps.drawing.cube_layers import layers_panel
from neurosnap.apps.drawing.dual_panel import dual_panel
from neurosnap.apps.drawing.dual_places import unit_of
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.hasse_panel import hasse_panel
from neurosnap.apps.drawing.legend import key_panel
from neurosnap.apps.drawing.measures import Numbers, in_words
from neurosnap.apps.drawing.model import Model
from neurosnap.apps.drawing.panel import (
    PALE,
    Panel,
    beside,
    captioned,
    lines,
    stacked,
)
from neurosnap.apps.drawing.tikz import tikz
from neurosnap.errors import InvalidValueError
from neurosnap.system.durable import replace_file
from neurosnap.system.picture import KINDS, canvas_type, encoded

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST = 120
"""The most elements that are drawn: 60 sensors. Of more nobody sees anything."""

_MARGIN = 0.35
_DPI = 120


def draw_model(model: Model, numbers: Numbers, path: Path) -> None:
    """Write the picture of a model: whole or not at all; what was there is replaced.

    Raises:
        InvalidValueError: As from `check_picture` and `check_size`.
        MissingExtraError: matplotlib is not installed; a .tex does without.
    """
    check_picture(path)
    check_size(model)
    kind = path.suffix[1:].lower()
    if kind == "tex":
        data = tikz(model, numbers).encode()
    else:
        data = encoded(figure_of(model, numbers), kind, _DPI)
    replace_file(path, data)


def check_picture(path: Path) -> None:
    """Refuse a picture that could not be written, before anything is computed for it.

    Raises:
        InvalidValueError: It is not of a kind that can be drawn, or its folder is
            missing.
        MissingExtraError: matplotlib is not installed.
    """
    kind = path.suffix[1:].lower()
    if kind not in (*KINDS, "tex"):
        rule = "must end in .png, .svg, .pdf or .tex"
        raise InvalidValueError("out", rule, str(path))
    if not path.absolute().parent.is_dir():
        raise InvalidValueError("out", "must be in a folder that exists", str(path))
    if kind != "tex":
        canvas_type("picture")


def check_size(model: Model) -> None:
    """Refuse a model too large for a page.

    Raises:
        InvalidValueError: It has more than `MOST` elements.
    """
    if model.elements > MOST:
        rule = (
            f"must have at most {MOST} elements (60 sensors that differ) to be drawn:"
            " keep some sensors with --only A,B, or see all of them on the page of"
            " `neurosnap view`, in `neurosnap graph`, or as data with --json"
        )
        raise InvalidValueError("model", rule, model.elements)


def figure_of(model: Model, numbers: Numbers) -> "Figure":
    """Return the picture of a model.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    return sheet(stacked([_heading(model, numbers), *_rows(model)], 0.32))


def sheet(page: Panel) -> "Figure":
    """Return a figure with a panel on it, and as large.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    canvas = canvas_type("picture")
    width, height = page.width + 2 * _MARGIN, page.height + 2 * _MARGIN
    figure = canvas(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.set_axis_off()
    page.draw(axes, _MARGIN, _MARGIN)
    return figure


def _rows(model: Model) -> list[Panel]:
    """Return Hasse diagram, dual and key, of the model and of what it is mapped to."""
    rows = [_row(model)]
    if model.target is not None:
        rows.append(
            captioned(
                f"{model.target.title}:  {model.target.poc}",
                _row(model.target, brief=True),
            )
        )
    return rows


def _row(model: Model, *, brief: bool = False) -> Panel:
    """Return Hasse diagram, dual and key, which may leave out what is said above."""
    if model.vertices is None:
        hasse = hasse_panel(model.poc, None, model.state)
        why = [f"The dual is not drawn: {model.unlisted} (--limit)."]
        if model.state is not None:
            why.append("The elements of the current state are lit.")
        caption = captioned("Order (Hasse diagram)", lines(why, 9, PALE))
        return stacked([caption, hasse], 0.2)
    view = View.of(model.poc, model.vertices, level=model.level, seen=model.witnessed)
    unit = unit_of(view)
    dual = dual_panel(model, view, unit)
    hasse = captioned(
        "Order (Hasse diagram)", hasse_panel(model.poc, view, model.state)
    )
    key = captioned("Key", key_panel(model, view, dual.nameless, brief=brief))
    row = _arranged(hasse, captioned("Dual (model space)", dual), key)
    apart = layers_panel(model, view, unit)
    return row if apart is None else stacked([row, apart], 0.35)


def _arranged(hasse: Panel, dual: Panel, key: Panel) -> Panel:
    """Return the three on as little paper as they take, and no wider than need be."""
    ways = (
        beside([hasse, dual, key]),
        beside([hasse, stacked([dual, key], 0.4)]),
        beside([stacked([hasse, dual], 0.4), key]),
    )
    return min(ways, key=lambda panel: panel.width * panel.height)


def _heading(model: Model, numbers: Numbers) -> Panel:
    """Return title, poc set and numbers."""
    title = lines([model.title], 14)
    poc = textwrap.wrap(_kept(str(model.poc)), 130)
    if len(poc) > 1:  # names and relations are in the diagram below
        sensors = f"{len(model.poc)} sensors"
        poc = [f"{sensors}, {model.elements} literals that differ"]
    return stacked([title, lines([*poc, *in_words(numbers)])], 0.1)


def _kept(text: str) -> str:
    """Return relations that no line is broken in."""
    for sign in ("<", "="):
        text = text.replace(f" {sign} ", f"\u00a0{sign}\u00a0")
    return text
