"""Where the vertices of a dual lie in the plane: a linear image of the cube.

Every element has one direction, and a vertex lies at the sum of the directions of the
elements it has on. So edges that cross the same hyperplane are parallel and equally
long, squares are parallelograms and cubes look like cubes, whatever the dimension.

The directions make distances in the plane follow hop distances (restricted stress
majorisation), then keep vertices off each other and off edges they do not belong to,
then elements that are nested and almost parallel become parallel, so that a path is
straight and a grid is a grid. Of several fixed starts the one that reads best is kept:
the same dual always looks the same.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

APART = 0.5
"""How far vertices keep from each other, in lengths of an average edge."""

CLEAR = 0.26
"""How far vertices keep from edges that are not theirs."""

_SLANT = 0.55  # the least sine of the angle between the sides of a square
_STARTS = 6
_PAIRS = 40_000  # pairs of a vertex and another, or an edge, that are looked at
_ALIGNED = (np.deg2rad(12), np.deg2rad(40))
_PARALLEL = np.deg2rad(1)


@dataclass(frozen=True, slots=True)
class Layout:
    """A linear image of a dual.

    Attributes:
        directions: ``(n, 2)``: where each element's being on leads.
        heights: ``(n,)``: how much nearer to the eye that is.
        families: ``(n,)``: elements with the same number are parallel.
    """

    directions: Floats
    heights: Floats
    families: Indices

    def points(self, corners: NDArray[np.bool_]) -> Floats:
        """Return where vertices are: ``(vertices, 2)`` of ``(vertices, n)`` bool."""
        return corners.astype(np.float64) @ self.directions

    def depths(self, corners: NDArray[np.bool_]) -> Floats:
        """Return how near to the eye vertices are: ``(vertices,)``."""
        return corners.astype(np.float64) @ self.heights


def lay_out(
    corners: NDArray[np.bool_],
    edges: Indices,
    crossing: NDArray[np.bool_],
) -> Layout:
    """Return a layout of a dual.

    Args:
        corners: ``(vertices, n)`` bool, one column an element.
        edges: ``(edges, 2)``: the vertices each edge joins.
        crossing: ``(n, n)`` bool: which elements cross.

    Returns:
        Its average edge is one long. O(starts · vertices²) time for small duals; large
        ones are looked at in part.
    """
    task = _Task.of(corners, edges, crossing)
    count = corners.shape[1]
    starts = _STARTS if len(corners) <= 80 else 2
    tries = [task.settled(_start(count, number)) for number in range(starts)]
    tries += [task.straightened(t, angle) for t in tries for angle in _ALIGNED]
    best = min(tries, key=lambda tried: round(task.cost(tried), 6))
    return _posed(best, crossing)


def _start(count: int, number: int) -> Floats:
    """Return directions to begin with: fans first, then drawn from a fixed seed."""
    if number == 0:
        angles = np.arange(count) * 2 * np.pi / max(count, 1)
    elif number == 1:
        angles = np.arange(count) * np.pi / max(count, 1)
    else:
        angles = np.random.default_rng(number).uniform(0, 2 * np.pi, count)
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


@dataclass(frozen=True, slots=True)
class _Task:
    """A dual, and the pairs in it that should keep their distance."""

    corners: Floats
    edges: Indices
    nested: NDArray[np.bool_]
    squares: Indices  # (k, 2): the elements that cross
    pairs: Indices  # (k, 2): vertices
    hops: Floats  # (k,)
    others: Indices  # (k, 2): a vertex and an edge that is not its own

    @classmethod
    def of(
        cls, corners: NDArray[np.bool_], edges: Indices, crossing: NDArray[np.bool_]
    ) -> "_Task":
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
        rounds = 260 if len(self.others) else 60
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
        crossings = _crossings(points, self.edges) if len(self.others) else 0
        bends = self._bends(directions)
        return self._weighed(directions)[0] + 0.12 * crossings + 0.9 * bends

    def _bends(self, directions: Floats) -> int:
        """Return how many directions there are."""
        return int(_families(directions, self.nested, _PARALLEL).max(initial=-1)) + 1

    def _weighed(self, directions: Floats) -> tuple[float, Floats]:
        """Return the smooth part of the cost, and its gradient by the directions."""
        points = self.corners @ directions
        push = np.zeros_like(points)
        total = 0.0
        # Distances follow hops.
        i, j = self.pairs.T
        gap = points[i] - points[j]
        length = np.linalg.norm(gap, axis=1) + 1e-9
        share = 6 * len(points) / len(self.pairs)
        off = (length - self.hops) / self.hops
        total += share * float((off**2).sum())
        force = share * 2 * off / self.hops
        # Vertices keep apart.
        near = np.maximum(APART - length, 0)
        total += 40 * float((near**2).sum())
        force -= 80 * near
        along = (force / length)[:, None] * gap
        _add(push, i, along)
        _add(push, j, -along)
        # And off strange edges.
        v, e = self.others.T
        a, b = self.edges[e].T
        side = points[b] - points[a]
        away = points[v] - points[a]
        t = np.clip(
            (side * away).sum(1) / np.maximum((side**2).sum(1), 1e-9), 0.0, 1.0
        )
        gap = away - t[:, None] * side
        length = np.linalg.norm(gap, axis=1) + 1e-9
        near = np.maximum(CLEAR - length, 0)
        total += 60 * float((near**2).sum())
        along = (-120 * near / length)[:, None] * gap
        _add(push, v, along)
        _add(push, a, -(1 - t)[:, None] * along)
        _add(push, b, -t[:, None] * along)
        gradient = self.corners.T @ push
        # Squares are no slivers.
        p, q = self.squares.T
        one, two = directions[p], directions[q]
        area = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
        least = _SLANT - np.abs(area)
        thin = np.maximum(least, 0)
        total += 8 * float((thin**2).sum())
        turn = (-16 * thin * np.sign(area))[:, None]
        _add(gradient, p, turn * np.stack([two[:, 1], -two[:, 0]], axis=1))
        _add(gradient, q, turn * np.stack([-one[:, 1], one[:, 0]], axis=1))
        return total, gradient

    def straightened(self, directions: Floats, angle: float) -> Floats:
        """Return directions of which the almost parallel are parallel."""
        families = _families(directions, self.nested, angle)
        count = int(families.max(initial=-1)) + 1
        shared = np.zeros((len(directions), count))
        means = np.zeros((count, 2))
        for family in range(count):
            own = np.flatnonzero(families == family)
            signs = np.sign(directions[own] @ directions[own[0]])
            shared[own, family] = signs
            means[family] = (signs[:, None] * directions[own]).mean(0)
        return self.settled(means, shared)


def _add(into: Floats, rows: Indices, what: Floats) -> None:
    """Add to rows of an array, to some of them more than once."""
    for axis in (0, 1):
        into[:, axis] += np.bincount(rows, what[:, axis], len(into))


def _families(
    directions: Floats, nested: NDArray[np.bool_], angle: float
) -> Indices:
    """Return which nested elements are almost parallel, numbered from 0."""
    families = np.full(len(directions), -1, np.int64)
    angles = np.arctan2(directions[:, 1], directions[:, 0])
    off = np.abs((angles[:, None] - angles + np.pi / 2) % np.pi - np.pi / 2)
    count = 0
    for k in range(len(directions)):
        if families[k] >= 0:
            continue
        alike = np.flatnonzero((families < 0) & (off[k] < angle) & nested[k])
        families[alike] = families[k] = count
        count += 1
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


def _posed(directions: Floats, crossing: NDArray[np.bool_]) -> Layout:
    """Return a layout turned upright, its average edge one long."""
    families = _families(directions, ~crossing, _PARALLEL)
    if not len(directions):
        return Layout(directions, np.zeros(0), families)
    lengths = np.linalg.norm(directions, axis=1)
    directions = directions / lengths.mean()
    largest = int(np.bincount(families).argmax())
    lead = directions[families == largest][0]
    angle = -np.arctan2(lead[1], lead[0])
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    directions = directions @ turn
    lengths = np.linalg.norm(directions, axis=1)
    reach = 1.15 * lengths.max()
    towards = np.where(directions @ [0.4, 1.0] > 0, -1.0, 1.0)
    heights = towards * np.sqrt(np.maximum(reach**2 - lengths**2, 0))
    return Layout(directions, heights, families)
