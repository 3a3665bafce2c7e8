"""The cost of a linear image of a dual, and its minimisation.

Three things cost: distances that do not follow hops, vertices too near to each other
or to edges that are not theirs, and squares that are slivers. All of it is smooth but
for the crossings and the number of directions, which only decide between results.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Indices = NDArray[np.int64]

APART = 0.5
"""How far vertices keep from each other, in lengths of an average edge."""

CLEAR = 0.26
"""How far vertices keep from edges that are not theirs."""

_SLANT = 0.55  # the least area of a square
_PAIRS = 40_000  # pairs of a vertex and another, or an edge, that are looked at
_PARALLEL = np.deg2rad(1)


@dataclass(frozen=True, slots=True)
class Strain:
    """A dual, and the pairs in it that should keep their distance.

    Attributes:
        corners: ``(vertices, n)`` of 0 and 1.
        edges: ``(edges, 2)``: vertices.
        nested: ``(n, n)`` bool: which elements do not cross.
        squares: ``(k, 2)``: the elements that cross.
        pairs: ``(k, 2)``: vertices.
        hops: ``(k,)``: how far apart these are.
        others: ``(k, 2)``: a vertex and an edge that is not its own.
        strong: ``(k, 2)``: the edges that should be seen best.
    """

    corners: Floats
    edges: Indices
    nested: NDArray[np.bool_]
    squares: Indices
    pairs: Indices
    hops: Floats
    others: Indices
    strong: Indices

    @classmethod
    def of(
        cls,
        corners: NDArray[np.bool_],
        edges: Indices,
        crossing: NDArray[np.bool_],
        seen: NDArray[np.bool_],
    ) -> "Strain":
        """Return the strain of a dual; the arguments are those of `lay_out`."""
        chance = np.random.default_rng(0)
        pairs = np.stack(np.triu_indices(len(corners), 1), axis=1)
        if len(pairs) > _PAIRS:
            pairs = pairs[chance.choice(len(pairs), _PAIRS, replace=False)]
        hops = (corners[pairs[:, 0]] != corners[pairs[:, 1]]).sum(1)
        if len(corners) * len(edges) <= 4 * _PAIRS:
            vertex, edge = np.indices((len(corners), len(edges))).reshape(2, -1)
            strange = (edges[edge] != vertex[:, None]).all(1)
            others = np.stack([vertex[strange], edge[strange]], axis=1)
        else:
            others = np.zeros((0, 2), np.int64)
        return cls(
            corners=corners.astype(np.float64),
            edges=edges,
            nested=~crossing,
            squares=np.argwhere(np.triu(crossing)),
            pairs=pairs,
            hops=hops.astype(np.float64),
            others=others,
            strong=edges[seen[edges].all(1)],
        )

    def settled(self, directions: Floats, shared: Floats | None = None) -> Floats:
        """Return better directions.

        Args:
            directions: ``(n, 2)`` to begin with, or ``(m, 2)`` with `shared`.
            shared: ``(n, m)``: how each element's direction is made of these.
        """
        mix = np.eye(len(directions)) if shared is None else shared
        if not len(self.pairs):
            return mix @ directions
        if shared is None:
            directions = self._majorised(directions)
        return mix @ self._descended(directions, mix)

    def _majorised(self, directions: Floats) -> Floats:
        """Bring distances near to hops: restricted majorisation of the stress."""
        steps = self.corners[self.pairs[:, 0]] - self.corners[self.pairs[:, 1]]
        weights = 1 / self.hops**2
        inverse = np.linalg.pinv((steps * weights[:, None]).T @ steps)
        for _ in range(40):
            moves = steps @ directions
            lengths = np.linalg.norm(moves, axis=1) + 1e-9
            pull = weights * self.hops / lengths
            directions = inverse @ (steps.T @ (pull[:, None] * moves))
        return directions

    def _descended(self, directions: Floats, mix: Floats) -> Floats:
        """Follow the gradient of the cost, with momentum (Adam)."""
        rounds = (
            60 if not len(self.others) else 200 if mix.shape[0] == mix.shape[1] else 110
        )
        first, second = np.zeros_like(directions), np.zeros_like(directions)
        for k in range(1, rounds + 1):
            gradient = mix.T @ self._gradient(mix @ directions)
            first += 0.1 * (gradient - first)
            second += 0.01 * (gradient**2 - second)
            rate = 0.05 * (1 - k / (rounds + 1))
            swift = first / (1 - 0.9**k)
            directions = directions - rate * swift / (
                np.sqrt(second / (1 - 0.99**k)) + 1e-9
            )
        return directions

    def _gradient(self, directions: Floats) -> Floats:
        return self._weighed(directions)[1]

    def cost(self, directions: Floats) -> float:
        """Return how badly a layout reads: smaller is better."""
        points = self.corners @ directions
        crossings = 0
        if len(self.others):
            crossings = _crossings(points, self.edges)
            crossings += _crossings(points, self.strong)
        bends = self._bends(directions)
        return self._weighed(directions)[0] + 0.12 * crossings + 0.9 * bends

    def _bends(self, directions: Floats) -> int:
        """Return how many directions there are."""
        return int(families_of(directions, self.nested, _PARALLEL).max(initial=-1)) + 1

    def _weighed(self, directions: Floats) -> tuple[float, Floats]:
        """Return the smooth part of the cost, and its gradient by the directions.

        Places are complex numbers: half as many arrays to go through.
        """
        ways: Complexes = directions[:, 0] + 1j * directions[:, 1]
        places = self.corners @ ways
        total, push = self._stress(places)
        more, pushed = self._strangers(places)
        slivers, gradient = self._slivers(ways)
        gradient = self.corners.T @ (push + pushed) + gradient
        both = np.stack([gradient.real, gradient.imag], axis=1)
        return total + more + slivers, both

    def _stress(self, places: Complexes) -> tuple[float, Complexes]:
        """Distances follow hops, and vertices keep apart."""
        i, j = self.pairs.T
        gap = places[i] - places[j]
        length = np.abs(gap) + 1e-9
        share = 6 * len(places) / len(self.pairs)
        off = length / self.hops - 1
        near = np.maximum(APART - length, 0)
        total = share * float(off @ off) + 40 * float(near @ near)
        force = (2 * share * off / self.hops - 80 * near) / length * gap
        count = len(places)
        return total, _sums(i, force, count) - _sums(j, force, count)

    def _strangers(self, places: Complexes) -> tuple[float, Complexes]:
        """Vertices keep off edges that are not theirs."""
        v, e = self.others.T
        a, b = self.edges[e].T
        side, away = places[b] - places[a], places[v] - places[a]
        square = np.maximum(side.real**2 + side.imag**2, 1e-9)
        t = np.clip((side.real * away.real + side.imag * away.imag) / square, 0.0, 1.0)
        gap = away - t * side
        length = np.abs(gap) + 1e-9
        # Only the few that are too near push.
        few = np.flatnonzero(length < CLEAR)
        near, t = CLEAR - length[few], t[few]
        force = -120 * near / length[few] * gap[few]
        push = _sums(v[few], force, len(places))
        push -= _sums(a[few], (1 - t) * force, len(places))
        push -= _sums(b[few], t * force, len(places))
        return 60 * float(near @ near), push

    def _slivers(self, ways: Complexes) -> tuple[float, Complexes]:
        """Squares are not too thin."""
        p, q = self.squares.T
        area = (ways[p].conj() * ways[q]).imag
        thin = np.maximum(_SLANT - np.abs(area), 0)
        turn = -16 * thin * np.sign(area)
        gradient = _sums(p, turn * -1j * ways[q], len(ways))
        gradient += _sums(q, turn * 1j * ways[p], len(ways))
        return 8 * float(thin @ thin), gradient

    def straightened(self, directions: Floats, angle: float) -> Floats:
        """Return directions of which the almost parallel are parallel."""
        families = families_of(directions, self.nested, angle)
        count = int(families.max(initial=-1)) + 1
        shared = np.zeros((len(directions), count))
        means = np.zeros((count, 2))
        for family in range(count):
            own = np.flatnonzero(families == family)
            signs = np.sign(directions[own] @ directions[own[0]])
            shared[own, family] = signs
            means[family] = (signs[:, None] * directions[own]).mean(0)
        return self.settled(means, shared)


def _sums(rows: Indices, what: Complexes, count: int) -> Complexes:
    """Return what falls to each row, added up."""
    real = np.bincount(rows, what.real, count)
    found: Complexes = real + 1j * np.bincount(rows, what.imag, count)
    return found


def families_of(directions: Floats, nested: NDArray[np.bool_], angle: float) -> Indices:
    """Return which nested elements are almost parallel, numbered from 0."""
    families = np.full(len(directions), -1, np.int64)
    angles = np.arctan2(directions[:, 1], directions[:, 0])
    off = np.abs((angles[:, None] - angles + np.pi / 2) % np.pi - np.pi / 2)
    for k in range(len(directions)):
        if families[k] >= 0:
            continue
        number = families.max() + 1
        for other in np.flatnonzero((families < 0) & (off[k] < angle)).tolist():
            if nested[other, families == number].all():
                families[other] = number
    return families


def _crossings(points: Floats, edges: Indices) -> int:
    """Return how many pairs of edges cross, in their interiors."""
    i, j = np.triu_indices(len(edges), 1)
    a, b = points[edges[i, 0]], points[edges[i, 1]]
    c, d = points[edges[j, 0]], points[edges[j, 1]]

    def side(p: Floats, q: Floats, r: Floats) -> Floats:
        u, v = q - p, r - p
        turned: Floats = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
        return np.where(np.abs(turned) < 1e-7, 0, np.sign(turned))

    one = side(a, b, c) * side(a, b, d)
    two = side(c, d, a) * side(c, d, b)
    return int(((one < 0) & (two < 0)).sum())
