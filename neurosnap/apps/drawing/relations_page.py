"""A page with the relations of sensors: a table, and the order as a picture.

It is one file that loads nothing: no script, no font, no picture from elsewhere, which
its policy forbids as well.
"""

from collections.abc import Sequence
from html import escape
from itertools import pairwise

import networkx as nx
import numpy as np

from neurosnap.apps.drawing.rank_layout import stand
from neurosnap.poc.learning.relation_table import Relation
from neurosnap.sensorium import visible

_MOST = 240
"""Elements that are drawn: of more nobody sees anything."""
_LETTER, _HIGH, _STEP, _EDGE = 7.2, 22.0, 64.0, 24.0
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
        relations: What the rows tell, for the picture.
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
    literals = nx.DiGraph(
        [edge for row in relations for edge in _edges(row)]
        + [(_other(b), _other(a)) for row in relations for a, b in _edges(row)]
    )
    order = nx.condensation(literals) if literals else nx.DiGraph()
    members = [sorted(order.nodes[k]["members"]) for k in order]
    where = {name: k for k, names in enumerate(members) for name in names}
    mates = np.array([where[_other(names[0])] for names in members], np.int64)
    if not members or len(members) > _MOST or (mates == np.arange(len(mates))).any():
        return ""
    covers = np.array(sorted(nx.transitive_reduction(order).edges), np.int64)
    names = [visible(" = ".join(group)) for group in members]
    wide = np.array([_LETTER * len(name) + 16 for name in names])
    wide = np.maximum(wide, wide[mates])
    stood = stand(covers.reshape(-1, 2), wide, mates, gap=_EDGE)
    low, high = stood.rank.min(), stood.rank.max()
    width = float((stood.across + wide / 2).max()) + _EDGE
    width = max([width, *(float(line[:, 0].max()) + _EDGE for line in stood.lines)])
    height = float(high - low) * _STEP + 2 * _EDGE + _HIGH

    def down(rank: float) -> float:
        return float(high - rank) * _STEP + _EDGE + _HIGH / 2

    shapes = []
    for line in stood.lines:
        points = " ".join(f"{x:.1f},{down(rank):.1f}" for x, rank in line.tolist())
        shapes.append(f'<polyline points="{points}"/>')
    for k, name in enumerate(names):
        x, y, half = float(stood.across[k]), down(float(stood.rank[k])), wide[k] / 2
        off = ' class="off"' if all(each.endswith("*") for each in members[k]) else ""
        shapes.append(
            f'<g{off}><rect x="{x - half:.1f}" y="{y - _HIGH / 2:.1f}" rx="4"'
            f' width="{2 * half:.1f}" height="{_HIGH}"/>'
            f'<text x="{x:.1f}" y="{y + 4:.1f}">{escape(name)}</text></g>'
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
