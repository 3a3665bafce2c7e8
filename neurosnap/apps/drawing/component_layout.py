"""Layout of one connected component of a Hasse diagram.

A line that passes a rank has a place of its own there, as elements have (Sugiyama
1981). Ranks are ordered so that few lines cross, then everything moves as near to what
it is joined to as the order and the room allow; all of it so that a part that is its
own image under half a turn stays that.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from neurosnap.apps.drawing.layout_cost import Floats, Indices

_LANE = 0.13  # what a line takes of a rank that it passes
_ROUNDS = 16
_EVEN = 120


@dataclass(frozen=True, slots=True)
class Placed:
    """One part, placed around 0."""

    across: dict[int, float]
    lines: dict[tuple[int, int], Floats]


class Part:
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
        # Lines that pass stay straight; the elements beside them make room.
        self._pull = np.where(np.arange(count) < len(own), 1.0, 3.0)
        self._mate = None if mates is None else self._mates(mates)
        self._tie = list(range(count))
        if self._mate is not None:
            # Ties are broken so that the mirror image breaks them the other way.
            self._tie = [
                k - count if k < mate else count - mate
                for k, mate in enumerate(self._mate)
            ]

    def place(self) -> Placed:
        """Return where its elements stand and its lines run."""
        rows: list[list[int]] = [[] for _ in self._values]
        for k, level in enumerate(self._level):
            rows[level].append(k)
        rows = [sorted(row, key=self._tie.__getitem__) for row in rows]
        rows = self._ordered(rows)
        across = self._spread(rows, None)
        for _ in range(_EVEN):
            across = self._spread(rows, self._wishes(across))
        across = self._upright(across)
        lines = {
            pair: np.array([(across[k], self._values[self._level[k]]) for k in chain])
            for pair, chain in self._chains.items()
        }
        places = {a: float(across[k]) for k, a in enumerate(self._own)}
        return Placed(places, lines)

    def _upright(self, across: Floats) -> Floats:
        """Return places without a lean: ranks are moved, each as a whole."""
        level = np.array([self._values[k] for k in self._level])
        off = level[: len(self._own)] - level[: len(self._own)].mean()
        lean = off @ across[: len(self._own)] / max(float(off @ off), 1e-9)
        straight: Floats = across - lean * level
        return straight

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
                across[row] = _rising(wish[row] - offset, self._pull[row]) + offset
        return across if self._mate is None else (across - across[self._mate]) / 2


def _rising(goal: Floats, pull: Floats) -> Floats:
    """Return the closest values that never fall: pooled neighbours take their mean."""
    pools: list[tuple[float, float, int]] = []
    for value, weight in zip(goal.tolist(), pull.tolist(), strict=True):
        pools.append((value, weight, 1))
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            (one, v, m), (two, w, n) = pools[-2:]
            pools[-2:] = [((one * v + two * w) / (v + w), v + w, m + n)]
    return np.concatenate([np.full(n, mean) for mean, _, n in pools] or [np.zeros(0)])
