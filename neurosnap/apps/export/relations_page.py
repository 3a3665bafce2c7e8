"""An HTML page of relations between sensors: a table and a picture of the order.

It is one file that loads nothing: no script, no font, no picture from elsewhere, which
its policy forbids as well.
"""

from collections.abc import Sequence
from html import escape
from itertools import pairwise

from neurosnap.apps.export.order_picture import plot_order
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.relation_table import Relation
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium, visible

_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; margin: 2rem; color: #1c2530;
  background: #fff; }
table { border-collapse: collapse; margin: 1.5rem 0; }
th, td { padding: .25rem .9rem .25rem 0; text-align: right; white-space: nowrap;
  border-bottom: 1px solid #dde3ea; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
figure { margin: 1.5rem 0; overflow-x: auto; }
@media (prefers-color-scheme: dark) {
  body { color: #dfe6ee; background: #12171d; } th, td { border-color: #2b3540; }
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
    try:
        picture = plot_order(graph, sensors)
    except InvalidValueError:  # too many to be read, or what contradicts itself
        return ""
    return (
        f"<figure>{picture}<figcaption>What implies stands below what it implies; a"
        " star means off.</figcaption></figure>"
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
