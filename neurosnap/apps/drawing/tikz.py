r"""A model as TikZ: a file that compiles by itself, or whose picture is pasted.

It holds the order and the dual with its marks, as the other pictures do; a caption and
a key are the author's. The boxes have the colours of the edges that cross them. Styles
and colours begin with ``poc``: TikZ itself has a ``name`` and a ``mark``.
"""

from typing import TYPE_CHECKING

from neurosnap.apps.drawing.dual_panel import PUNCTURE, RING, SHINE, THICK, THIN
from neurosnap.apps.drawing.dual_places import MARKED, RADIUS, DualPlaces, unit_of
from neurosnap.apps.drawing.dual_view import View
from neurosnap.apps.drawing.hasse_layout import HIGH, lay_out_hasse
from neurosnap.apps.drawing.latex import PREAMBLE, comment, escaped, width
from neurosnap.apps.drawing.measures import Numbers, in_words
from neurosnap.apps.drawing.model import Mark, Model
from neurosnap.apps.drawing.panel import INK, PALE, STATE
from neurosnap.system.palette import ink_on, rgb

if TYPE_CHECKING:
    from neurosnap.apps.drawing.layout_cost import Floats

_STYLES = rf"""\tikzset{{
  poc name/.style={{font=\sffamily\fontsize{{9}}{{11}}\selectfont, inner sep=1pt}},
  poc literal/.style={{poc name, draw, rounded corners=3pt, line width=1.2pt,
    minimum height={HIGH - 0.03:.3f}in, inner sep=0pt}},
  poc nowhere/.style={{poc literal, dashed, draw=pocpale, text=pocpale}},
  poc cover/.style={{draw=pocpale, line width=0.8pt, rounded corners=4pt}},
  poc lit/.style={{rounded corners=5pt, fill=pocstate, inner sep=0pt,
    minimum height={HIGH + 0.05:.3f}in}},
  poc vertex/.style={{circle, draw=pocink, line width=1pt, inner sep=0pt,
    minimum size={2 * RADIUS:.3f}in}},
  poc shown/.style={{poc vertex, fill=pocink}},
  poc hidden/.style={{poc vertex, fill=white}},
  poc possible/.style={{circle, draw=pocink, fill=pocstate, inner sep=0pt,
    minimum size=0.26in}},
  poc mark/.style={{circle, draw=white, text=white, inner sep=0pt,
    minimum size={2 * MARKED:.3f}in,
    font=\sffamily\bfseries\fontsize{{8}}{{9}}\selectfont}},
  poc tile/.style={{fill opacity={SHINE}}},
}}"""
_APART = 0.6  # inches between the order and the dual


def tikz(model: Model, numbers: Numbers) -> str:
    """Return a model as the text of a LaTeX file; needs no matplotlib.

    Args:
        model: What is drawn; its dual is left out if it is not listed.
        numbers: What it measures, for the comment at the top.
    """
    view = None
    if model.vertices is not None:
        view = View.of(
            model.poc, model.vertices, level=model.level, seen=model.witnessed
        )
    named = {"pocink": INK, "pocpale": PALE, "pocstate": STATE}
    named |= {"pocring": RING, "pocpuncture": PUNCTURE}
    if view is not None:
        named |= {f"pocelement{k}": colour for k, colour in enumerate(view.colours)}
    order, far = _order(model, view)
    body = ["% The order.", *order]
    if view is not None:
        dual = DualPlaces(model, view, unit_of(view), None, width)
        tints = {number: _hex(view.tint(number, strong=bool(dual.seen[ring].all())))
                 for number, ring in enumerate(view.squares)}  # fmt: skip
        named |= {f"poctile{number}": tint for number, tint in tints.items()}
        left, low = (float(c) for c in dual.low)
        shift = f"({far + _APART - left:.3f},{-low:.3f})"
        body += ["% The dual.", rf"\begin{{scope}}[shift={{{shift}}}]"]
        body += [*_dual(dual), r"\end{scope}"]
    colours = [
        rf"\definecolor{{{name}}}{{HTML}}{{{colour[1:].upper()}}}"
        for name, colour in named.items()
    ]
    facts = [model.title, *in_words(numbers)]
    return "\n".join(
        [
            *map(comment, facts),
            r"\documentclass[tikz,border=4pt]{standalone}",
            PREAMBLE.rstrip(),
            *colours,
            _STYLES,
            r"\begin{document}",
            r"\begin{tikzpicture}[x=1in,y=1in]",
            *body,
            r"\end{tikzpicture}",
            r"\end{document}",
            "",
        ]
    )


def _order(model: Model, view: View | None) -> tuple[list[str], float]:
    """Return the Hasse diagram, and how wide it is."""
    hasse = lay_out_hasse(model.poc, width)
    lines = [
        rf"\draw[poc cover] {' -- '.join(_at(p) for p in way)};" for way in hasse.lines
    ]
    for k, a in enumerate(hasse.heads):
        wide = float(hasse.wide[k])
        if model.state is not None and model.state[a]:
            lines.append(
                rf"\node[poc lit, minimum width={wide + 0.05:.3f}in]"
                rf" at {_at(hasse.places[k])} {{}};"
            )
        lines.append(
            rf"\node[{_box(model, view, a)}, minimum width={wide - 0.04:.3f}in]"
            rf" at {_at(hasse.places[k])} {{{escaped(hasse.names[k])}}};"
        )
    return lines, hasse.size[0]


def _box(model: Model, view: View | None, a: int) -> str:
    """Return how an element's box looks."""
    if not model.poc.proper[a]:
        return "poc nowhere"
    if view is None:
        return "poc literal, draw=pocink, fill=white"
    number = view.own.index(a & ~1)
    if a & 1:
        return f"poc literal, draw=pocelement{number}, fill=white"
    ink = "white" if ink_on(rgb(view.colours[number])) == "white" else "pocink"
    return f"poc literal, draw=pocelement{number}, fill=pocelement{number}, text={ink}"


def _dual(dual: DualPlaces) -> list[str]:
    """Return a dual: squares and edges from the back, vertices, marks, names."""
    view, points, lines = dual.view, dual.points, []
    for is_edge, number in dual.flesh():
        if is_edge:
            ends = view.edges[number]
            way = f"{_at(points[ends[0]])} -- {_at(points[ends[1]])}"
            wide = THICK if dual.seen[ends].all() else THIN
            lines += [
                rf"\draw[draw=white, line width={wide + 2.4:.1f}pt] {way};",
                rf"\draw[draw=pocelement{view.crossed[number]}, line width={wide:.1f}pt,"
                rf" line cap=round] {way};",
            ]
        else:
            ring = points[view.squares[number]]
            middle = ring.mean(0)
            corners = " -- ".join(_at(middle + 0.86 * (p - middle)) for p in ring)
            lines.append(rf"\fill[poc tile, fill=poctile{number}] {corners} -- cycle;")
    for one, other in dual.joined:
        way = f"{_at(points[one])} -- {_at(points[other])}"
        lines.append(rf"\draw[draw=pocring, line width=10pt, opacity=0.3] {way};")
    for k, point in enumerate(points):
        if dual.possible[k]:
            lines.append(rf"\node[poc possible] at {_at(point)} {{}};")
        look = "poc shown" if dual.seen[k] else "poc hidden"
        lines.append(rf"\node[{look}] at {_at(point)} {{}};")
        if k in dual.marks:
            lines += _mark(point, dual.marks[k])
    for k, (name, spot) in dual.names.items():
        lines.append(_name(dual, k, name, spot))
    return lines


def _name(dual: DualPlaces, k: int, name: str, spot: "Floats") -> str:
    """Return a vertex's name, its end at the vertex if it stands beside it.

    How wide it is set is known only to LaTeX.
    """
    x, y = (float(c) for c in spot)
    half = dual.extent(name)[0] / 2
    aside = x - float(dual.points[k][0])
    anchor = "center"
    if abs(aside) > half:
        anchor, x = ("west", x - half) if aside > 0 else ("east", x + half)
    return (
        rf"\node[poc name, anchor={anchor}] at ({x:.3f},{y:.3f}) {{{escaped(name)}}};"
    )


def _mark(point: "Floats", mark: Mark) -> list[str]:
    """Return a mark over a vertex."""
    x, y = (float(c) for c in point)
    match mark.kind:
        case "puncture":
            ways = [
                f"({x - 0.1:.3f},{y - way:.3f}) -- ({x + 0.1:.3f},{y + way:.3f})"
                for way in (0.1, -0.1)
            ]
            return [
                *(rf"\draw[draw=white, line width=5pt] {way};" for way in ways),
                *(rf"\draw[draw=pocpuncture, line width=2.6pt] {way};" for way in ways),
            ]
        case "split":
            ring = rf"\draw[draw=pocpuncture, line width=2pt] {_at(point)} circle[radius={MARKED}];"
            return [ring]
        case _:
            colour = "pocring" if mark.kind in ("median", "image") else "pocink"
            sign = escaped(mark.sign)
            return [rf"\node[poc mark, fill={colour}] at {_at(point)} {{{sign}}};"]


def _at(point: "Floats") -> str:
    x, y = (round(float(c), 3) + 0.0 for c in point)  # no -0
    return f"({x:.3f},{y:.3f})"


def _hex(colour: tuple[float, float, float]) -> str:
    return "#" + "".join(f"{round(255 * c):02x}" for c in colour)
