"""Colours of a picture, and its files: PNG for the screen, SVG and PDF for print.

The same picture gives the same bytes each time with the same matplotlib: no file holds
the time, and the names inside an SVG are numbers that its content alone decides.

The colours hold in print and for the colour-blind: all of them differ in lightness, so
they stay apart on a grey printer, and for anyone who does not tell red from green. They
are Tol's schemes "high-contrast" and "medium-contrast" ([Tol] Colour Schemes,
SRON/EPS/TN/09-002, 2021); the steps of a quantity are matplotlib's "viridis" (Smith &
van der Walt 2015).
"""

import io
import warnings
from typing import TYPE_CHECKING, TypeAlias

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
FEW = ("#004488", "#bb5566", "#ddaa33")
"""For up to three things; the lightest is for areas and thick lines."""
MANY = ("#004488", "#994455", "#997700", "#6699cc", "#ee99aa", "#eecc66", "#000000")
"""For up to seven things."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
"""A marker for each of `MANY`."""
HUES = (("#004488", "#6699cc"), ("#994455", "#ee99aa"), ("#997700", "#eecc66"))
"""The darkest and the lightest shade of each hue of `MANY`."""
QUANTITY = "viridis"
"""The colour map of a quantity, by matplotlib's name: from dark to light."""
Rgb: TypeAlias = tuple[float, float, float]
"""Red, green and blue, each in [0, 1]."""
_LIGHTEST = 0.85  # of the map's length: what is lighter is lost on white paper
_DARK = "#22262b"


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


def encoded(figure: "Figure", kind: str, dpi: int = 150) -> bytes:
    """Return a picture as the bytes of a file.

    Args:
        figure: What is drawn.
        kind: One of `KINDS`.
        dpi: Pixels an inch, of a PNG.
    """
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
        figure.savefig(buffer, dpi=dpi, format=kind, metadata=_UNDATED[kind])
    return buffer.getvalue()


def rgb(colour: str) -> Rgb:
    """Return ``#rrggbb`` as red, green and blue."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue


def mixed(one: str, other: str, share: float) -> str:
    """Return the colour between two, by the share of the other in it."""
    pairs = zip(rgb(one), rgb(other), strict=True)
    return "#" + "".join(f"{round(255 * (x + share * (y - x))):02x}" for x, y in pairs)


def steps(count: int) -> list[Rgb]:
    """Return colours for the steps of a quantity, dark ones first, for lines on white.

    Needs matplotlib.
    """
    from matplotlib import colormaps

    scale = colormaps[QUANTITY]
    places = [_LIGHTEST * k / max(1, count - 1) for k in range(count)]
    return [(r, g, b) for r, g, b, _ in map(scale, places)]


def luminance(colour: Rgb) -> float:
    """Return how light a colour is: from 0, black, to 1, white (WCAG 2)."""
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in colour
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def ink_on(colour: Rgb) -> str:
    """Return what can be read on a colour: white, or nearly black."""
    here = luminance(colour) + 0.05
    dark = luminance(rgb(_DARK)) + 0.05
    return "white" if 1.05 / here >= here / dark else _DARK
