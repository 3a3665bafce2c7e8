"""A page with the relations of sensors: a table, and the order as a picture.

It is one file that loads nothing: no script, no font, no picture from elsewhere, which
its policy forbids as well.
"""

from collections.abc import Sequence
from html import escape
from itertools import pairwise

import numpy as np

from neurosnap.apps.drawing.hasse_layout import HIGH, lay_out_hasse
from neurosnap.poc.learning.relation_table import Relation
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium, visible

_MOST = 240
"""Elements that are drawn: of more the names could not be read."""
_INCH = 100.0
"""Pixels an inch: a letter is 7.2 pixels wide."""
_LETTER, _EDGE = 0.072, 12.0
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem; color: #1c2530;
  background: #fff; }
table { border-collapse: collapse; margin: 1.5rem 0; }
th, td { padding: .25rem .9rem .25rem 0; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #dde3ea; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
figure { margin: 1.5rem 0; overflow-x: auto; }
text { font: 12px ui-monospace, monospace; fill: #1c2530; text-anchor: middle; }
rect { fill: #fff; stroke: #3a5a80; } .off rect { stroke-dasharray: 4 3; }
polyline { fill: none; stroke: #8a9bb0; }
@media (prefers-color-scheme: dark) {
  body { color: #dfe6ee; background: #12171d; } text { fill: #dfe6ee; }
  rect { fill: #12171d; stroke: #8fb3dd; } th, td { border-color: #2b3540; }
}
"""
_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; style-src 'unsafe-inline'">
<meta name="viewport" content="width=device-width">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<h1>{title}</h1>
<p>{summary}</p>
{figure}
<table>
<thead><tr>{heads}</tr></thead>
<tbody>
{rows}
</tbody>
</table>
</body>
</html>
"""


def relations_page(
    title: str,
    summary: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    relations: Sequence[Relation],
) -> str:
    """Return the page.

    Args:
        title: What it is of.
        summary: A line below.
        heads: The heads of the table.
        rows: Its cells.
        relations: What the rows say, for the picture.
    """
    return _PAGE.format(
        title=escape(visible(title)),
        summary=escape(visible(summary)),
        style=_STYLE,
        figure=_figure(relations),
        heads="".join(f"<th>{escape(head)}</th>" for head in heads),
        rows="\n".join(
            "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
            for row in rows
        ),
    )


def _figure(relations: Sequence[Relation]) -> str:
    """Return the order as a picture: what implies stands below what it implies."""
    pairs = [pair for row in relations for pair in _edges(row)]
    names = dict.fromkeys(name.removesuffix("*") for pair in pairs for name in pair)
    if not names:
        return ""
    sensors = Sensorium(names)
    implications = [(sensors.literal(a), sensors.literal(b)) for a, b in pairs]
    graph = PocGraph.from_implications(len(sensors), implications)
    stands_for = graph.representative
    contradicted = (stands_for[::2] == stands_for[1::2]).any()
    if contradicted or len(np.unique(stands_for)) > _MOST:
        return ""
    hasse = lay_out_hasse(
        PocSet.from_graph(graph, sensors), lambda name: _LETTER * len(visible(name))
    )
    width, height = (length * _INCH + 2 * _EDGE for length in hasse.size)

    def placed(x: float, y: float) -> tuple[float, float]:
        return x * _INCH + _EDGE, height - y * _INCH - _EDGE

    shapes = []
    for line in hasse.lines:
        ends = (placed(x, y) for x, y in line.tolist())
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in ends)
        shapes.append(f'<polyline points="{points}"/>')
    high = HIGH * _INCH
    for k, name in enumerate(hasse.names):
        x, y = placed(*hasse.places[k].tolist())
        half = float(hasse.wide[k]) * _INCH / 2
        members = np.flatnonzero(stands_for == hasse.heads[k])
        off = ' class="off"' if (members % 2 == 1).all() else ""
        shapes.append(
            f'<g{off}><rect x="{x - half:.1f}" y="{y - high / 2:.1f}" rx="4"'
            f' width="{2 * half:.1f}" height="{high:.1f}"/>'
            f'<text x="{x:.1f}" y="{y + 4:.1f}">{escape(visible(name))}</text></g>'
        )
    return (
        f'<figure><svg width="{width:.0f}" height="{height:.0f}" role="img"'
        f' aria-label="The order of the sensors">{"".join(shapes)}</svg>'
        "<figcaption>What implies stands below what it implies; a star means"
        " off.</figcaption></figure>"
    )


def _edges(row: Relation) -> list[tuple[str, str]]:
    """Return the implications between literals that a row tells."""
    match row.relation:
        case "implies":
            return [(row.a, row.b)]
        case "never together":
            return [(row.a, _other(row.b))]
        case "at least one of":
            return [(_other(row.a), row.b)]
        case "the same" | "nearly the same":
            return list(pairwise((row.a, row.b, row.a)))
        case "opposite" | "nearly opposite":
            return list(pairwise((row.a, _other(row.b), row.a)))


def _other(literal: str) -> str:
    return literal[:-1] if literal.endswith("*") else f"{literal}*"
