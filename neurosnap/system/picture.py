"""Colours and files of pictures: PNG for the screen, SVG and PDF for print.

The same picture gives the same bytes each time with the same matplotlib: no file holds
the time, and the names inside an SVG are numbers that its content alone decides.

The colours hold in print and for the colour-blind: all of them differ in lightness, so
they stay apart on a grey printer, and for anyone who does not tell red from green. They
are Tol's scheme "medium-contrast" ([Tol] Colour Schemes, SRON/EPS/TN/09-002, 2021).
"""

import io
import warnings
from typing import TYPE_CHECKING

from neurosnap.errors import MissingExtraError
from neurosnap.system.distribution import must_have

if TYPE_CHECKING:
    from matplotlib.figure import Figure

KINDS = ("png", "svg", "pdf")
"""The kinds of files, as their names end."""

_UNDATED: dict[str, dict[str, str | None]] = {
    "png": {},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}
MANY = ("#004488", "#994455", "#997700", "#6699cc", "#ee99aa", "#eecc66", "#000000")
"""For up to seven things."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""A marker for each of `MANY`."""


def canvas_type(what: str) -> "type[Figure]":
    """Return the class that pictures are drawn on.

    Args:
        what: What is to be drawn, for the error.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        rule = must_have("matplotlib", "plot")
        raise MissingExtraError(f"{what}: {rule}") from error
    return Figure


def encoded(figure: "Figure", kind: str) -> bytes:
    """Return a picture as the bytes of a file, of one of `KINDS`."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    style = rc_context(
        {
            "svg.hashsalt": "neurosnap",
            "svg.fonttype": "path",  # looks the same where the font is not installed
            "pdf.fonttype": 42,  # TrueType: journals refuse matplotlib's own Type 3
        }
    )
    with style, warnings.catch_warnings():
        # A sensor's name may be in a script the font lacks: it shows as boxes.
        warnings.filterwarnings("ignore", message="Glyph")
        figure.savefig(buffer, dpi=150, format=kind, metadata=_UNDATED[kind])
    return buffer.getvalue()
