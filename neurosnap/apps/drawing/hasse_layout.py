"""Where the boxes and the lines of a Hasse diagram are: for any kind of picture."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from neurosnap.apps.drawing.dual_view import element_name
from neurosnap.apps.drawing.layout_cost import Floats
from neurosnap.apps.drawing.rank_layout import stand
from neurosnap.poc.order.pocset import PocSet

Measure: TypeAlias = Callable[[str, float], float]
"""Returns how wide a text is, in inches, for a size in points."""

SIZE = 9.0
"""The size of a name, in points."""
HIGH = 0.236
"""How high a box is, in inches."""


@dataclass(frozen=True, slots=True)
class Hasse:
    """A Hasse diagram, measured in inches from its lower left corner.

    Attributes:
        heads: The representatives, one a box.
        names: What stands in the boxes.
        places: ``(n, 2)``: the middles of the boxes.
        wide: ``(n,)``: how wide the boxes are.
        lines: ``(k, 2)`` each: from the lower element to the upper.
        size: How wide and how high it is.
    """

    heads: tuple[int, ...]
    names: tuple[str, ...]
    places: Floats
    wide: Floats
    lines: tuple[Floats, ...]
    size: tuple[float, float]


def lay_out_hasse(poc: PocSet, measure: Measure) -> Hasse:
    """Return the Hasse diagram of a poc set, bounds left out."""
    heads = np.unique(poc.graph.representative).tolist()
    number = {a: k for k, a in enumerate(heads)}
    covers = np.array(
        [(number[a], number[b]) for a, b in poc.hasse()], np.int64
    ).reshape(-1, 2)
    mates = np.array([number[a ^ 1] for a in heads], np.int64)
    names = [element_name(poc, a) for a in heads]
    wide = np.array([measure(name, SIZE) + 0.16 for name in names])
    wide = np.maximum(np.maximum(wide, wide[mates]), 0.32)
    stood = stand(covers, wide, mates)
    x, rank = stood.across, stood.rank
    span = max(float(np.ptp(rank)), 1e-9)
    # Lines that pass ranks need room between them, and wide orders steep lines.
    least = 2.8 if all(len(line) < 3 for line in stood.lines) else 9.0
    step = float(np.clip(least / span, 0.56, 0.9))
    step = max(step, min(float(x.max()) / 3 / span, 1.8))
    y = (rank - rank.min()) * step + 0.16
    boxes = np.stack([x - wide / 2, y - HIGH / 2, x + wide / 2, y + HIGH / 2], 1)
    lines = tuple(
        _routed(
            np.stack([line[:, 0], (line[:, 1] - rank.min()) * step + 0.16], axis=1),
            np.delete(boxes, pair, axis=0),
        )
        for line, pair in zip(stood.lines, covers.tolist(), strict=True)
    )
    width = max([float((x + wide / 2).max()), *(float(p[:, 0].max()) for p in lines)])
    return Hasse(
        heads=tuple(heads),
        names=tuple(names),
        places=np.stack([x, y], axis=1),
        wide=wide,
        lines=lines,
        size=(width, float(y.max()) + 0.16),
    )


def _routed(line: Floats, boxes: Floats) -> Floats:
    """Return a line pulled tight: straight as far as it keeps clear of the boxes."""
    # Upright beside the boxes of the ranks it passes.
    inner = np.repeat(line[1:-1], 2, axis=0)
    inner[::2, 1] -= HIGH / 2
    inner[1::2, 1] += HIGH / 2
    points = np.concatenate([line[:1], inner, line[-1:]])
    kept = [0]
    while kept[-1] < len(points) - 1:
        here = kept[-1]
        ahead = range(len(points) - 1, here, -1)
        seen = (k for k in ahead if _is_clear(points[here], points[k], boxes))
        kept.append(next(seen, here + 1))
    return points[kept]


def _is_clear(start: Floats, end: Floats, boxes: Floats) -> bool:
    """Return whether a straight line keeps clear of boxes."""
    way = start + np.linspace(0, 1, 80)[:, None] * (end - start)
    off = np.maximum(boxes[:, None, :2] - way, way - boxes[:, None, 2:])
    return bool((off.max(axis=2) > 0.03).all())
