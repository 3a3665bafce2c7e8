"""Where the elements of an order stand in its Hasse diagram.

What is below stands below: an element's rank is half its longest chain downwards less
half its longest chain upwards, so that an element and its complement stand at opposite
ranks. Each connected part is laid out by itself; if it holds the complements of its
elements it is its own image under half a turn, otherwise its complements' part stands
beside it. A line that passes a rank has a place of its own there, as elements have
(Sugiyama 1981), so it runs behind no element.
"""

import itertools
from dataclasses import dataclass

import networkx as nx
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

_LANE = 0.13  # what a line takes of a rank that it passes
_ROUNDS = 16


@dataclass(frozen=True, slots=True)
class Stand:
    """Where elements stand, and how lines run.

    Attributes:
        across: ``(n,)``: the middles of the elements, from 0 on.
        rank: ``(n,)``: how high they stand, in steps of a half.
        lines: For each joined pair ``(k, 2)``: across and rank, from the lower end up.
    """

    across: Floats
    rank: Floats
    lines: tuple[Floats, ...]


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
    upwards = list(nx.topological_sort(graph))
    for a in upwards:
        for b in graph.successors(a):
            below[b] = max(below[b], below[a] + 1)
    for b in reversed(upwards):
        for a in graph.predecessors(b):
            above[a] = max(above[a], above[b] + 1)
    return (below - above) / 2


def stand(
    covers: Indices, widths: Floats, mates: Indices, gap: float = 0.2
) -> Stand:
    """Return where the elements of an order stand.

    Args:
        covers: As for `ranks`.
        widths: ``(n,)``: how wide each element is; complements are equally wide.
        mates: ``(n,)``: each element's complement.
        gap: What is left free between elements.
    """
    count = len(widths)
    rank = ranks(covers, count)
    graph = nx.Graph(covers.tolist())
    graph.add_nodes_from(range(count))
    across, edge = np.zeros(count), 0.0
    lines: list[Floats] = [np.zeros((0, 2))] * len(covers)
    number = {(a, b): k for k, (a, b) in enumerate(covers.tolist())}
    done = set[int]()
    for part in sorted(sorted(part) for part in nx.connected_components(graph)):
        if part[0] in done:
            continue
        whole = int(mates[part[0]]) in part
        laid = _Part(part, covers, rank, widths + gap, mates if whole else None)
        half = widths / 2
        own = laid.place()
        reach = [x for line in own.lines.values() for x in line[:, 0].tolist()]
        left = min([own.across[a] - half[a] for a in part] + reach)
        right = max([own.across[a] + half[a] for a in part] + reach)
        for turned in (False,) if whole else (False, True):
            base = edge + (right if turned else -left)
            sign = -1.0 if turned else 1.0
            for a in part:
                across[mates[a] if turned else a] = base + sign * own.across[a]
            for (a, b), line in own.lines.items():
                pair = (int(mates[b]), int(mates[a])) if turned else (a, b)
                moved = line * sign + [base, 0]
                lines[number[pair]] = moved[::-1] if turned else moved
            done.update(mates[part].tolist() if turned else part)
            edge += right - left + 2 * gap
    return Stand(across, rank, tuple(lines))


@dataclass(frozen=True, slots=True)
class _Placed:
    """One part, placed around 0."""

    across: dict[int, float]
    lines: dict[tuple[int, int], Floats]


class _Part:
    """One connected part of an order, to be spread out.

    A node is an element, or a line where it passes a rank; nodes are joined to nodes
    of the neighbouring ranks only.

    Args:
        own: Its elements.
        covers: All joined pairs.
        rank: The ranks of all elements.
        room: How much of its rank each element takes.
        mates: The complements, if it is its own image under half a turn.
    """

    def __init__(
        self,
        own: list[int],
        covers: Indices,
        rank: Floats,
        room: Floats,
        mates: Indices | None,
    ) -> None:
        levels = sorted({float(rank[a]) for a in own})
        self._own = own
        self._node: dict[tuple[int, ...], int] = {(a,): k for k, a in enumerate(own)}
        self._level = [levels.index(float(rank[a])) for a in own]
        self._room = [float(room[a]) for a in own]
        self._values = levels
        members = set(own)
        self._chains: dict[tuple[int, int], list[int]] = {}
        for a, b in covers.tolist():
            if a in members:
                self._chains[a, b] = self._lane(a, b)
        self._below: list[list[int]] = [[] for _ in self._level]
        self._above: list[list[int]] = [[] for _ in self._level]
        for chain in self._chains.values():
            for low, high in itertools.pairwise(chain):
                self._above[low].append(high)
                self._below[high].append(low)
        count = len(self._level)
        self._mate = None if mates is None else self._mates(mates)
        self._tie = list(range(count))
        if self._mate is not None:
            # Ties are broken so that the mirror image breaks them the other way.
            self._tie = [
                k - count if k < mate else count - mate
                for k, mate in enumerate(self._mate)
            ]

    def place(self) -> _Placed:
        """Return where its elements stand and its lines run."""
        rows: list[list[int]] = [[] for _ in self._values]
        for k, level in enumerate(self._level):
            rows[level].append(k)
        rows = [sorted(row, key=self._tie.__getitem__) for row in rows]
        rows = self._ordered(rows)
        across = self._spread(rows, None)
        for _ in range(_ROUNDS):
            across = self._spread(rows, self._wishes(across))
        lines = {
            pair: np.array([(across[k], self._values[self._level[k]]) for k in chain])
            for pair, chain in self._chains.items()
        }
        places = {a: float(across[k]) for k, a in enumerate(self._own)}
        return _Placed(places, lines)

    def _lane(self, a: int, b: int) -> list[int]:
        """Return the nodes of a line, made where it passes a rank."""
        low, high = self._node[a,], self._node[b,]
        chain = [low]
        for level in range(self._level[low] + 1, self._level[high]):
            chain.append(len(self._level))
            self._node[a, b, level] = chain[-1]
            self._level.append(level)
            self._room.append(_LANE)
        return [*chain, high]

    def _mates(self, mates: Indices) -> list[int]:
        """Return the node that half a turn takes each node to."""
        top = len(self._values) - 1
        found = [0] * len(self._level)
        for key, k in self._node.items():
            if len(key) == 1:
                image: tuple[int, ...] = (int(mates[key[0]]),)
            else:
                a, b, level = key
                image = (int(mates[b]), int(mates[a]), top - level)
            found[k] = self._node[image]
        return found

    def _ordered(self, rows: list[list[int]]) -> list[list[int]]:
        """Return rows ordered so that few lines cross: of all tried, the best."""
        best, least = rows, self._crossings(rows)
        for _ in range(_ROUNDS):
            across = self._spread(rows, None)
            for _ in range(2):
                wish = self._wishes(across)
                rows = [
                    sorted(row, key=lambda k: (round(float(wish[k]), 6), self._tie[k]))
                    for row in rows
                ]
                across = self._spread(rows, wish)
            tried = self._exchanged([list(row) for row in rows])
            crossings = self._crossings(tried)
            if crossings < least:
                best, least = tried, crossings
        return best

    def _exchanged(self, rows: list[list[int]]) -> list[list[int]]:
        """Exchange neighbours wherever that takes out crossings, both turned alike."""
        for _ in range(8):
            gained = False
            for row in rows:
                for k in range(len(row) - 1):
                    one, two = row[k], row[k + 1]
                    gain = self._gain(rows, one, two)
                    if gain > 0:
                        gained = True
                        row[k], row[k + 1] = two, one
                        self._mirror(rows, one, two)
            if not gained:
                break
        return rows

    def _gain(self, rows: list[list[int]], one: int, two: int) -> int:
        """Return how many crossings fewer there are if two neighbours are exchanged."""
        gain = 0
        for beside, step in ((self._below, -1), (self._above, 1)):
            level = self._level[one] + step
            if 0 <= level < len(rows) and beside[one] and beside[two]:
                place = {k: n for n, k in enumerate(rows[level])}
                for x in beside[one]:
                    for y in beside[two]:
                        gain += (place[x] > place[y]) - (place[x] < place[y])
        return gain

    def _mirror(self, rows: list[list[int]], one: int, two: int) -> None:
        """Exchange the mirror images of two nodes, unless they are each other's."""
        if self._mate is None:
            return
        a, b = self._mate[one], self._mate[two]
        if {a, b} != {one, two}:
            row = rows[self._level[a]]
            i, j = row.index(a), row.index(b)
            row[i], row[j] = b, a

    def _crossings(self, rows: list[list[int]]) -> int:
        """Return how many pairs of lines cross."""
        total = 0
        for low, high in itertools.pairwise(rows):
            place = {k: n for n, k in enumerate(high)}
            ends = [sorted(place[b] for b in self._above[a]) for a in low]
            flat = [end for group in ends for end in group]
            total += sum(x > y for x, y in itertools.combinations(flat, 2))
        return total

    def _wishes(self, across: Floats) -> Floats:
        """Return where each would stand if it were alone: amid what it is joined to."""
        wish = across.copy()
        for k, near in enumerate(zip(self._below, self._above, strict=True)):
            joined = near[0] + near[1]
            if joined:
                wish[k] = np.mean(across[joined])
        return wish if self._mate is None else (wish - wish[self._mate]) / 2

    def _spread(self, rows: list[list[int]], wish: Floats | None) -> Floats:
        """Return places in the given order, as near to the wishes as there is room."""
        across = np.zeros(len(self._level))
        for row in rows:
            room = np.array([self._room[k] for k in row])
            offset = np.cumsum(room) - room / 2
            if wish is None:
                across[row] = offset - room.sum() / 2
            else:
                across[row] = _rising(wish[row] - offset) + offset
        return across if self._mate is None else (across - across[self._mate]) / 2


def _rising(goal: Floats) -> Floats:
    """Return the closest values that never fall: pooled neighbours take their mean."""
    pools: list[tuple[float, int]] = []
    for value in goal.tolist():
        pools.append((value, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, m), (two, n) = pools[-2:]
            pools[-2:] = [((one * m + two * n) / (m + n), m + n)]
    return np.concatenate([np.full(n, mean) for mean, n in pools] or [np.zeros(0)])
