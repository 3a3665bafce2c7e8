"""Where the elements of an order stand in its Hasse diagram.

What is below stands below: an element's rank is half its longest chain downwards less
half its longest chain upwards, so that an element and its complement stand at opposite
ranks. Each connected part is laid out by itself, and is turned by half a circle if
complements are exchanged; parts that are each other's complements stand side by side.
Boxes in a rank never touch: they are ordered first, then moved as near to what they
are joined to as the order allows.
"""

from collections.abc import Sequence

import networkx as nx
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_ROUNDS = 12
_SMALL = 90  # joined pairs up to which crossings are counted and taken out


def ranks(covers: Indices, count: int) -> Floats:
    """Return the ranks of elements, in steps of a half.

    Args:
        covers: ``(k, 2)``: each pair is an element and one directly above it.
        count: How many elements there are.

    Example:
        >>> ranks(np.array([[0, 1], [1, 2]]), 3)
        array([-1.,  0.,  1.])
    """
    below, above = np.zeros(count, np.int64), np.zeros(count, np.int64)
    graph = nx.DiGraph(covers.tolist())
    topological = list(nx.topological_sort(graph))
    for a in topological:
        for b in graph.successors(a):
            below[b] = max(below[b], below[a] + 1)
    for b in reversed(topological):
        for a in graph.predecessors(b):
            above[a] = max(above[a], above[b] + 1)
    return (below - above) / 2


def stand(
    covers: Indices, widths: Floats, mates: Indices, gap: float = 0.25
) -> tuple[Floats, Floats]:
    """Return where the elements of an order stand.

    Args:
        covers: As for `ranks`.
        widths: ``(n,)``: how wide each element's box is; complements' are equal.
        mates: ``(n,)``: each element's complement.
        gap: What is left free between boxes.

    Returns:
        The middles of the boxes, from 0 on, and their ranks, both ``(n,)``.
    """
    count = len(widths)
    level = ranks(covers, count)
    graph = nx.Graph(covers.tolist())
    graph.add_nodes_from(range(count))
    parts = sorted(sorted(part) for part in nx.connected_components(graph))
    across = np.zeros(count)
    edge, done = 0.0, set[int]()
    for part in parts:
        if part[0] in done:
            continue
        own = np.array(part)
        mirrored = mates[own]
        whole = set(mirrored.tolist()) == set(part)
        inner = covers[np.isin(covers[:, 0], own)]
        place = _Part(own, inner, level, widths + gap, mates if whole else None).place()
        half = widths[own] / 2
        left, right = (place - half).min(), (place + half).max()
        across[own] = place - left + edge
        edge += right - left + gap
        done.update(part)
        if not whole:
            across[mirrored] = right - place + edge
            edge += right - left + gap
            done.update(mirrored.tolist())
        edge += gap
    return across, level


class _Part:
    """One connected part of an order, to be spread out.

    Args:
        own: Its elements.
        covers: Its joined pairs.
        level: The ranks of all elements.
        room: How much of its rank each element takes.
        mates: The complements, if the part is its own mirror image.
    """

    def __init__(
        self,
        own: Indices,
        covers: Indices,
        level: Floats,
        room: Floats,
        mates: Indices | None,
    ) -> None:
        number = {a: k for k, a in enumerate(own.tolist())}
        self._joined = np.array(
            [(number[a], number[b]) for a, b in covers.tolist()], np.int64
        ).reshape(-1, 2)
        self._level, self._room = level[own], room[own]
        self._mates = (
            None if mates is None else np.array([number[a] for a in mates[own].tolist()])
        )
        self._turn = np.arange(len(own))
        if self._mates is not None:
            # Ties are broken so that the mirror image breaks them the other way.
            self._turn = np.where(
                self._turn < self._mates, self._turn - len(own), len(own) - self._mates
            )
        self._rows = [
            sorted(np.flatnonzero(self._level == rank).tolist(), key=self._tie)
            for rank in np.unique(self._level)
        ]
        self._beside: list[list[int]] = [[] for _ in own]
        for a, b in self._joined.tolist():
            self._beside[a].append(b)
            self._beside[b].append(a)

    def place(self) -> Floats:
        """Return where its elements stand."""
        rows = [list(row) for row in self._rows]
        across = self._spread(rows)
        for _ in range(_ROUNDS):
            wish = self._wishes(across)
            rows = [sorted(row, key=lambda a: (round(wish[a], 6), self._tie(a))) for row in rows]
            across = self._spread(rows, wish)
        if len(self._joined) <= _SMALL:
            rows = self._swapped(rows)
        across = self._spread(rows)
        for _ in range(_ROUNDS):
            across = self._spread(rows, self._wishes(across))
        return across

    def _tie(self, a: int) -> int:
        return int(self._turn[a])

    def _wishes(self, across: Floats) -> Floats:
        """Return where each would stand if it were alone: amid what it is joined to."""
        wish = np.array(
            [
                np.mean(across[near]) if near else across[a]
                for a, near in enumerate(self._beside)
            ]
        )
        return wish if self._mates is None else (wish - wish[self._mates]) / 2

    def _spread(self, rows: list[list[int]], wish: Floats | None = None) -> Floats:
        """Return places in the given order, as near to the wishes as there is room."""
        across = np.zeros(len(self._level))
        for row in rows:
            room = self._room[row]
            offset = np.cumsum(room) - room / 2
            aim = np.full(len(row), -room.sum() / 2) if wish is None else None
            goal = aim if aim is not None else np.asarray(wish)[row] - offset
            across[row] = _rising(goal) + offset
        if self._mates is not None:
            across = (across - across[self._mates]) / 2
        return across

    def _swapped(self, rows: list[list[int]]) -> list[list[int]]:
        """Return rows with neighbours exchanged wherever that reads better."""
        best = self._cost(rows)
        for _ in range(6):
            before = best
            for r, row in enumerate(rows):
                for k in range(len(row) - 1):
                    tried = [list(other) for other in rows]
                    _swap(tried[r], row[k], row[k + 1])
                    if self._mates is not None:
                        a, b = self._mates[row[k]], self._mates[row[k + 1]]
                        if {a, b} != {row[k], row[k + 1]}:
                            _swap(tried[len(rows) - 1 - r], int(a), int(b))
                    cost = self._cost(tried)
                    if cost < best - 1e-9:
                        best, rows = cost, tried
                        row = rows[r]  # noqa: PLW2901 - what is there now
            if best >= before:
                break
        return rows

    def _cost(self, rows: list[list[int]]) -> float:
        """Return how badly an order of the rows reads."""
        across = self._spread(rows)
        for _ in range(3):
            across = self._spread(rows, self._wishes(across))
        a, b = self._joined.T
        length = float(np.abs(across[a] - across[b]).sum())
        return self._crossings(across) + 4 * self._hidden(across) + 0.1 * length

    def _crossings(self, across: Floats) -> int:
        """Return how many pairs of lines cross."""
        i, j = np.triu_indices(len(self._joined), 1)
        low = np.maximum(self._level[self._joined[i, 0]], self._level[self._joined[j, 0]])
        high = np.minimum(
            self._level[self._joined[i, 1]], self._level[self._joined[j, 1]]
        )
        both = high > low
        at_low = self._at(across, i, low) - self._at(across, j, low)
        at_high = self._at(across, i, high) - self._at(across, j, high)
        return int((both & (at_low * at_high < -1e-9)).sum())

    def _hidden(self, across: Floats) -> int:
        """Return how often a line runs behind a box that is not at its ends."""
        line, box = np.indices((len(self._joined), len(across))).reshape(2, -1)
        level = self._level[box]
        low, high = self._level[self._joined[line]].T
        off = np.abs(self._at(across, line, level) - across[box])
        return int(((low < level) & (level < high) & (off < self._room[box] / 2)).sum())

    def _at(self, across: Floats, line: Indices, level: Floats) -> Floats:
        """Return where lines are at given ranks."""
        a, b = self._joined[line].T
        share = (level - self._level[a]) / (self._level[b] - self._level[a])
        found: Floats = across[a] + share * (across[b] - across[a])
        return found


def _swap(row: list[int], a: int, b: int) -> None:
    """Exchange two entries of a row."""
    i, j = row.index(a), row.index(b)
    row[i], row[j] = b, a


def _rising(goal: Sequence[float] | Floats) -> Floats:
    """Return the closest values that never fall: pooled neighbours take their mean."""
    pools: list[tuple[float, int]] = []
    for value in np.asarray(goal).tolist():
        pools.append((value, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, m), (two, n) = pools[-2:]
            pools[-2:] = [((one * m + two * n) / (m + n), m + n)]
    return np.concatenate([np.full(n, mean) for mean, n in pools] or [np.zeros(0)])
