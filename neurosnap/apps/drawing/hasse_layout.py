"""Where the boxes and the lines of a Hasse diagram are: for any kind of picture.

A box stands at a rank: half its longest chain downwards less half its longest chain
upwards, so that an element and its complement stand at opposite ranks, and the whole is
its own image under half a turn. Within a rank, boxes stand near to what they are joined
to, and a line that passes a rank has a place there, so that it runs behind no box
(Sugiyama 1981).
"""

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.pocset import PocSet

Floats: TypeAlias = NDArray[np.float64]
Measure: TypeAlias = Callable[[str], float]
"""Returns how wide a name is, in inches."""

HIGH = 0.236
"""How high a box is, in inches."""

_GAP = 0.2  # between boxes
_LANE = 0.13  # what a line takes of a rank that it passes
_ROUNDS = 24
_LONGEST = 28


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
    covers = [(number[a], number[b]) for a, b in poc.hasse()]
    mates = [number[a ^ 1] for a in heads]
    names = [element_name(poc, a) for a in heads]
    wide = np.array([measure(name) + 0.16 for name in names])
    wide = np.maximum(np.maximum(wide, wide[mates]), 0.32)
    across, rank, lines = stand(covers, wide + _GAP, mates)
    # Wide orders need steep lines.
    span = max(float(np.ptp(rank)), 1e-9)
    width = float(across.max(initial=0))
    step = max(float(np.clip(4.0 / span, 0.56, 0.9)), min(width / 3 / span, 1.8))
    lift = np.array([0.0, -rank.min(initial=0) * step + HIGH])
    places = np.stack([across, rank], axis=1) * [1, step] + lift
    half = np.stack([wide, np.full(len(wide), HIGH)], axis=1) / 2
    boxes = np.concatenate([places - half, places + half], axis=1)
    scaled = tuple(
        _tight(line * [1, step] + lift, np.delete(boxes, pair, axis=0))
        for line, pair in zip(lines, covers, strict=True)
    )
    right = [float((places[:, 0] + wide / 2).max(initial=0))]
    right += [float(line[:, 0].max()) for line in scaled]
    top = float(places[:, 1].max(initial=0)) + HIGH
    return Hasse(tuple(heads), tuple(names), places, wide, scaled, (max(right), top))


def _tight(line: Floats, boxes: Floats) -> Floats:
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
        clear = (k for k in ahead if _is_clear(points[here], points[k], boxes))
        kept.append(next(clear, here + 1))
    return points[kept]


def _is_clear(start: Floats, end: Floats, boxes: Floats) -> bool:
    """Return whether a straight line keeps clear of boxes."""
    way = start + np.linspace(0, 1, 80)[:, None] * (end - start)
    off = np.maximum(boxes[:, None, :2] - way, way - boxes[:, None, 2:])
    return bool((off.max(axis=2) > 0.03).all())


def element_name(poc: PocSet, literal: int) -> str:
    """Return the name of the element of a representative: all literals in its class."""
    same = poc.graph.representative == literal
    names = [poc.name(a) for a in np.flatnonzero(same).tolist()]
    if len(names) > 4:
        names = [*names[:3], f"{len(names) - 3} more"]
    return " = ".join(short(name) for name in names)


def short(name: str) -> str:
    """Return a name, its middle left out if it is very long."""
    if len(name) <= _LONGEST:
        return name
    half = _LONGEST // 2
    return f"{name[: half - 1]}…{name[-half:]}"


def ranks(covers: list[tuple[int, int]], count: int) -> Floats:
    """Return the ranks of elements, in steps of a half.

    Args:
        covers: Each pair is an element and one directly above it.
        count: How many elements there are.

    Example:
        >>> ranks([(0, 1), (1, 2)], 3)
        array([-1.,  0.,  1.])
    """
    low, high = np.array(covers, np.int64).reshape(-1, 2).T
    below, above = np.zeros((2, count))
    for _ in range(count):
        before = below.copy()
        np.maximum.at(below, high, below[low] + 1)
        np.maximum.at(above, low, above[high] + 1)
        if (below == before).all():
            break
    return np.asarray((below - above) / 2)


def stand(
    covers: list[tuple[int, int]], room: Floats, mates: list[int]
) -> tuple[Floats, Floats, list[Floats]]:
    """Return where the elements of an order stand.

    Args:
        covers: As for `ranks`; with each pair that of its complements.
        room: ``(n,)``: how much of its rank each takes; complements take as much.
        mates: Each element's complement.

    Returns:
        The middles of the elements across, from 0 on; their ranks; and for each pair
        of `covers` its line, ``(k, 2)``: across and rank, from the lower end up.
    """
    rank = ranks(covers, len(room))
    across, lines = _Rows(covers, rank, room, mates).place()
    ends = [(across - room / 2).min(initial=0), *(line[:, 0].min() for line in lines)]
    left = np.array([min(ends), 0])
    return across - left[0], rank, [line - left for line in lines]


class _Rows:
    """An order in rows, one a rank, to be spread out around 0.

    A node is an element, or a line where it passes a rank; nodes are joined to nodes
    of the neighbouring ranks only.

    Args:
        covers: Its joined pairs.
        rank: The ranks of its elements.
        room: How much of its rank each element takes.
        mates: Their complements.
    """

    def __init__(
        self,
        covers: list[tuple[int, int]],
        rank: Floats,
        room: Floats,
        mates: list[int],
    ) -> None:
        self._levels = sorted(set(rank.tolist()))
        level = [self._levels.index(each) for each in rank.tolist()]
        lanes: dict[tuple[int, int, int], int] = {}
        self._chains: list[list[int]] = []
        for a, b in covers:
            between = range(level[a] + 1, level[b])
            chain = range(len(level), len(level) + len(between))
            lanes |= {(a, b, at): k for at, k in zip(between, chain, strict=True)}
            level += between
            self._chains.append([a, *chain, b])
        self._count = len(room)
        self._level = np.array(level, np.int64)
        self._room = np.concatenate([room, np.full(len(lanes), _LANE)])
        # Lines that pass stay straight; the elements beside them make room.
        self._pull = np.where(np.arange(len(level)) < len(room), 1.0, 3.0)
        steps = [pair for chain in self._chains for pair in itertools.pairwise(chain)]
        self._steps = np.array(steps, np.int64).reshape(-1, 2)
        top = len(self._levels) - 1
        turned = [lanes[mates[b], mates[a], top - at] for a, b, at in lanes]
        self._mate = [*mates, *turned]

    def place(self) -> tuple[Floats, list[Floats]]:
        """Return where its elements stand and its lines run."""
        rows = [np.flatnonzero(self._level == k) for k in range(len(self._levels))]
        best, least = rows, self._crossings(rows)
        across = self._spread(rows, None)
        for turn in range(_ROUNDS):
            # Downwards and upwards in turns: each row by what it is joined to.
            way = slice(None) if turn % 2 else slice(None, None, -1)
            for k in range(len(rows))[way]:
                wish = self._wishes(across)
                rows[k] = rows[k][np.argsort(wish[rows[k]], kind="stable")]
                across = self._spread(rows, None)
            crossings = self._crossings(rows)
            if crossings < least:
                best, least = list(rows), crossings
        across = self._spread(best, None)
        for _ in range(5 * _ROUNDS):
            across = self._spread(best, self._wishes(across))
        high = np.array(self._levels)[self._level]
        lines = [np.stack([across[c], high[c]], axis=1) for c in self._chains]
        return across[: self._count], lines

    def _crossings(self, rows: list[NDArray[np.int64]]) -> int:
        """Return how many pairs of lines cross."""
        place = np.empty(len(self._level), np.int64)
        for row in rows:
            place[row] = np.arange(len(row))
        total = 0
        for level in range(len(rows)):
            ends = place[self._steps[self._level[self._steps[:, 0]] == level]]
            apart = ends[:, None] - ends
            total += int((apart[..., 0] * apart[..., 1] < 0).sum()) // 2
        return total

    def _wishes(self, across: Floats) -> Floats:
        """Return where each would stand if it were alone: amid what it is joined to."""
        low, high = self._steps.T
        count = np.bincount(self._steps.ravel(), minlength=len(across))
        total = np.bincount(low, across[high], len(across))
        total += np.bincount(high, across[low], len(across))
        wish = np.where(count > 0, total / np.maximum(count, 1), across)
        turned: Floats = (wish - wish[self._mate]) / 2
        return turned

    def _spread(self, rows: list[NDArray[np.int64]], wish: Floats | None) -> Floats:
        """Return places in the given order, as near to the wishes as there is room."""
        across = np.zeros(len(self._level))
        for row in rows:
            room = self._room[row]
            offset = np.cumsum(room) - room / 2
            if wish is None:
                across[row] = offset - room.sum() / 2
            else:
                across[row] = _rising(wish[row] - offset, self._pull[row]) + offset
        return across


def _rising(goal: Floats, pull: Floats) -> Floats:
    """Return the closest values that never fall: pooled neighbours take their mean."""
    pools: list[tuple[float, float, int]] = []
    for value, weight in zip(goal.tolist(), pull.tolist(), strict=True):
        pools.append((value, weight, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, v, m), (two, w, n) = pools[-2:]
            pools[-2:] = [((one * v + two * w) / (v + w), v + w, m + n)]
    return np.concatenate([np.full(n, mean) for mean, _, n in pools] or [np.zeros(0)])
