"""The Hasse diagram of an order as SVG, for a page or a notebook.

A box stands at a rank: half its longest chain downwards less half its longest chain
upwards, so that an element and its complement stand at opposite ranks. Within a rank,
boxes stand near to what they are joined to, and a line that passes a rank has a place
there, so that it runs behind no box (Sugiyama 1981).
"""

from html import escape
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.pocset import PocSet
from neurosnap.sensorium import Sensorium, visible

Floats: TypeAlias = NDArray[np.float64]
MOST = 120
"""Sensors that are drawn: of more the names could not be read."""

# In pixels.
_HIGH = 24.0  # of a box
_STEP = 72.0  # between two ranks; elements stand half-way, too
_GAP = 20.0  # between two boxes
_LANE = 13.0  # what a line takes of a rank that it passes
_LETTER = 7.2  # of monospaced 12 px
_EDGE = 12.0
_ROUNDS = 60
_LONGEST = 28  # letters of a name
_STYLE = """
.order text { font: 12px ui-monospace, monospace; fill: #1c2530; text-anchor: middle; }
.order rect { fill: #fff; stroke: #3a5a80; } .order .off rect { stroke-dasharray: 4 3; }
.order .lit rect { stroke: #e0a800; stroke-width: 3; }
.order polyline { fill: none; stroke: #8a9bb0; }
@media (prefers-color-scheme: dark) {
  .order text { fill: #dfe6ee; } .order rect { fill: #12171d; stroke: #8fb3dd; }
}
"""


class OrderPicture(str):
    """The text of an SVG file, which Jupyter shows as a picture."""

    def _repr_svg_(self) -> str:
        return self


def plot_order(
    graph: PocGraph, sensors: Sensorium, state: ArrayLike | None = None
) -> OrderPicture:
    """Return the Hasse diagram of an order.

    What stands below implies what a line leads up to; literals that imply each other
    are one box. A box of complements alone is dashed. Jupyter shows the picture;
    ``Path("order.svg").write_text(picture)`` writes it.

    Args:
        graph: What was learned: `Snapshot.poc_graph`.
        sensors: The names of its sensors.
        state: ``(2N,)`` bool: literals that are believed now, to be lit; None if none
            are to be.

    Raises:
        InvalidValueError: More than `MOST` sensors differ; or a literal is equivalent
            to its own complement, as unknown readings may have it.
        ShapeError: `graph` or `state` is of other sensors.
    """
    lit = np.zeros(2 * len(sensors), bool) if state is None else np.asarray(state, bool)
    if lit.shape != (2 * len(sensors),):
        raise ShapeError("state", f"must be ({2 * len(sensors)},)", lit.shape)
    poc = PocSet.from_graph(graph, sensors)
    heads = np.unique(graph.representative).tolist()
    if len(heads) > 2 * MOST:
        raise InvalidValueError("sensors", f"must be at most {MOST}", len(heads) // 2)
    number = {a: k for k, a in enumerate(heads)}
    covers = [(number[a], number[b]) for a, b in poc.hasse()]
    names = [visible(_element_name(poc, a)) for a in heads]
    wide = np.array([max(32.0, _LETTER * len(name) + 16) for name in names])
    heights = graph.heights()
    # The longest chain downwards is that of the complement upwards.
    rank = np.array([(heights[a ^ 1] - heights[a]) / 2 for a in heads])
    across, lines = _Rows(covers, rank, wide + _GAP).place()
    low, high = rank.min(initial=0), rank.max(initial=0)
    height = float(high - low) * _STEP + _HIGH + 2 * _EDGE
    left = min([0.0, *(line[:, 0].min() for line in lines), *(across - wide / 2)])
    right = max([0.0, *(line[:, 0].max() for line in lines), *(across + wide / 2)])

    def placed(x: float, rank: float) -> tuple[float, float]:
        return x - left + _EDGE, float(high - rank) * _STEP + _HIGH / 2 + _EDGE

    shapes = []
    for line in lines:
        ends = [placed(x, y) for x, y in line.tolist()]
        # Upright beside the boxes of the ranks it passes.
        inner = [(x, y + up) for x, y in ends[1:-1] for up in (_HIGH / 2, -_HIGH / 2)]
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in (ends[0], *inner, ends[-1]))
        shapes.append(f'<polyline points="{points}"/>')
    for k, name in enumerate(names):
        x, y = placed(float(across[k]), float(rank[k]))
        members = np.flatnonzero(graph.representative == heads[k])
        off = "off " if (members % 2 == 1).all() else ""
        style = off + ("lit" if lit[heads[k]] else "")
        shapes.append(
            f'<g class="{style}"><rect x="{x - wide[k] / 2:.1f}" y="{y - _HIGH / 2:.1f}"'
            f' rx="4" width="{wide[k]:.1f}" height="{_HIGH}"/>'
            f'<text x="{x:.1f}" y="{y + 4:.1f}">{escape(name)}</text></g>'
        )
    return OrderPicture(
        f'<svg xmlns="http://www.w3.org/2000/svg" class="order" role="img"'
        f' width="{right - left + 2 * _EDGE:.0f}" height="{height:.0f}"'
        f' aria-label="The order of the sensors"><style>{_STYLE}</style>'
        f"{''.join(shapes)}</svg>"
    )


def _element_name(poc: PocSet, literal: int) -> str:
    """Return the name of the element of a representative: all literals in its class."""
    same = poc.graph.representative == literal
    names = [poc.name(a) for a in np.flatnonzero(same).tolist()]
    if len(names) > 4:
        names = [*names[:3], f"{len(names) - 3} more"]
    half = _LONGEST // 2
    return " = ".join(
        name if len(name) <= _LONGEST else f"{name[: half - 1]}…{name[-half:]}"
        for name in names
    )


class _Rows:
    """An order in rows, one a rank, to be spread out around 0.

    A node is an element, or a line where it passes a rank; nodes are joined to nodes
    of the neighbouring ranks only.

    Args:
        covers: Its joined pairs.
        rank: The ranks of its elements.
        room: How much of its rank each element takes.
    """

    def __init__(
        self, covers: list[tuple[int, int]], rank: Floats, room: Floats
    ) -> None:
        self._levels = sorted(set(rank.tolist()))
        level = [self._levels.index(each) for each in rank.tolist()]
        self._chains: list[list[int]] = []
        for a, b in covers:
            between = range(level[a] + 1, level[b])
            self._chains.append([a, *range(len(level), len(level) + len(between)), b])
            level += between
        self._count = len(room)
        self._level = np.array(level, np.int64)
        self._room = np.concatenate([room, np.full(len(level) - len(room), _LANE)])
        # Lines that pass stay straight; the elements beside them make room.
        self._pull = np.where(np.arange(len(level)) < len(room), 1.0, 3.0)
        steps = [pair for chain in self._chains for pair in pairwise(chain)]
        self._steps = np.array(steps, np.int64).reshape(-1, 2)

    def place(self) -> tuple[Floats, list[Floats]]:
        """Return where its elements and its lines are, across and by rank."""
        rows = [np.flatnonzero(self._level == k) for k in range(len(self._levels))]
        across = np.zeros(len(self._level))
        for row in rows:
            self._spread(row, across, across)
        for turn in range(_ROUNDS):
            # Downwards and upwards in turns: each row by what it is joined to.
            for row in rows[:: 1 if turn % 2 else -1]:
                wish = self._wishes(across)
                row[:] = row[np.argsort(wish[row], kind="stable")]
                self._spread(row, wish, across)
        high = np.array(self._levels)[self._level]
        lines = [np.stack([across[c], high[c]], axis=1) for c in self._chains]
        return across[: self._count], lines

    def _wishes(self, across: Floats) -> Floats:
        """Return where each would stand if it were alone: amid what it is joined to."""
        low, high = self._steps.T
        count = np.bincount(self._steps.ravel(), minlength=len(across))
        total = np.bincount(low, across[high], len(across))
        total += np.bincount(high, across[low], len(across))
        return np.where(count > 0, total / np.maximum(count, 1), across)

    def _spread(self, row: NDArray[np.int64], wish: Floats, across: Floats) -> None:
        """Place a row in its order, as near to the wishes as there is room."""
        room = self._room[row]
        offset = np.cumsum(room) - room / 2
        across[row] = _rising(wish[row] - offset, self._pull[row]) + offset


def _rising(goal: Floats, pull: Floats) -> Floats:
    """Return the closest values that never fall: pooled neighbours take their mean."""
    pools: list[tuple[float, float, int]] = []
    for value, weight in zip(goal.tolist(), pull.tolist(), strict=True):
        pools.append((value, weight, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, v, m), (two, w, n) = pools[-2:]
            pools[-2:] = [((one * v + two * w) / (v + w), v + w, m + n)]
    return np.concatenate([np.full(n, mean) for mean, _, n in pools] or [np.zeros(0)])
