"""A model's picture: Hasse diagram, dual, key, on a page that fits them."""

import math
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.picture.dual import NAMED, RING, STATE, dual_panel, unit_of
from neurosnap.picture.hasse import hasse_panel
from neurosnap.picture.model import Model, Numbers
from neurosnap.picture.panel import (
    INK,
    LINE,
    PALE,
    Panel,
    beside,
    captioned,
    lines,
    say,
    short,
    stacked,
    text_width,
)
from neurosnap.picture.view import View
from neurosnap.poc.cubing import Cubing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_MARGIN = 0.35
_DPI = 120
_WORDS = ("vertices", "edges", "squares", "cubes")


def draw_model(model: Model, numbers: Numbers, path: Path) -> None:
    """Write the picture of a model: whole or not at all; what was there is replaced.

    Raises:
        InvalidValueError: It is not to be a ``.png`` file.
        NeurosnapError: matplotlib is not installed.
    """
    if path.suffix.lower() != ".png":
        raise InvalidValueError("out", "must end in .png", str(path))
    figure = figure_of(model, numbers)
    draft = path.with_name(f"{path.name}.part")
    try:
        with warnings.catch_warnings():
            # A sensor's name may be in a script the font lacks: it shows as boxes.
            warnings.filterwarnings("ignore", message="Glyph")
            figure.savefig(draft, dpi=_DPI, format="png")
        os.replace(draft, path)  # noqa: PTH105 - the one that replaces atomically
    finally:
        draft.unlink(missing_ok=True)


def figure_of(model: Model, numbers: Numbers) -> "Figure":
    """Return the picture of a model.

    Raises:
        NeurosnapError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise NeurosnapError(
            "picture: must have matplotlib, got none (pip install 'neurosnap[plot]')"
        ) from error
    page = stacked([_heading(model, numbers), *_rows(model)], 0.32)
    width, height = page.width + 2 * _MARGIN, page.height + 2 * _MARGIN
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, width), ylim=(0, height))
    axes.set_axis_off()
    page.draw(axes, _MARGIN, _MARGIN)
    return figure


def _rows(model: Model) -> list[Panel]:
    """Return Hasse diagram, dual and key, of the model and of what it is mapped to."""
    rows = [_row(model)]
    if model.target is not None:
        rows.append(captioned(f"{model.target.title}:  {model.target.poc}", _row(model.target)))
    return rows


def _row(model: Model) -> Panel:
    """Return Hasse diagram, dual and key."""
    if model.vertices is None:
        hasse = captioned("Order (Hasse diagram)", hasse_panel(model.poc, None))
        why = f"The dual is not drawn: {model.unlisted}."
        return beside([hasse, lines([why, "A higher --limit lists it."], 9, PALE)])
    view = View.of(model.poc, model.vertices)
    unit = unit_of(view)
    dual = captioned("Dual (model space)", dual_panel(model, view, unit))
    hasse = captioned("Order (Hasse diagram)", hasse_panel(model.poc, view))
    return beside([hasse, dual, _key(model, view)])


def _heading(model: Model, numbers: Numbers) -> Panel:
    """Return title, poc set and numbers."""
    title = lines([model.title], 14)
    poc = str(model.poc)
    shown = poc if len(poc) <= 110 else f"{poc[:107]}…"
    return stacked([title, lines([shown, *_facts(numbers)], 9, INK)], 0.1)


def _facts(numbers: Numbers) -> list[str]:
    """Return what a model measures, in a line or two."""
    order = f"height {numbers.height} · width {numbers.width}"
    if numbers.faces is None:
        return [order, f"dual not listed: {numbers.unlisted}"]
    first = f"dual: {_faces(numbers.faces)} · dimension {numbers.dimension} · {order}"
    if numbers.betti is not None:
        first += f" · Betti {_list(numbers.betti)}"
    facts = [first]
    if numbers.punctured_faces is not None and numbers.punctured_betti is not None:
        facts.append(
            f"punctured: {_faces(numbers.punctured_faces)}"
            f" · Betti {_list(numbers.punctured_betti)}"
        )
    return facts


def _faces(faces: tuple[int, ...]) -> str:
    """Return a face vector in words."""
    named = [
        f"{count} {_WORDS[d] if d < len(_WORDS) else f'{d}-cubes'}"
        for d, count in enumerate(faces)
    ]
    return " · ".join(named) or "empty"


def _list(values: tuple[int, ...]) -> str:
    return ", ".join(map(str, values)) or "none"


def _key(model: Model, view: View) -> Panel:
    return lines(["key"])
