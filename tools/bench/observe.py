"""The row on learning in one process: our kernels against plain numpy.

The plain version is what one writes first: dense weights of all pairs of literals, the
test on whole matrices, the state by a breadth-first walk. It starts from the same
weights, and each of its states must be the snapshot's.
"""

import time
from collections.abc import Callable
from itertools import cycle, islice

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot, Snapshot
from neurosnap.sensorium import complete
from tools.bench.report import Line, Sizes

_PLACES = 64  # observations there are; each stays above every threshold
_FEW = 3
_LONGEST = 100  # rounds of all places until the graph must have settled
_REACH = {145: 60e-6, 1000: 2e-3}
_SLACK = 1e-12
_FLIPS = 0.01
_WARM = 1800  # ticks: exceptions are tolerated from 1,568 on
_MOST = 2.0

Bits = NDArray[np.bool_]


def observe(sizes: Sizes) -> list[Line]:
    """Time one observation, once the graph has stopped changing; and noisy ones."""
    return [
        *(
            _observe(kind, sensors, sizes.batches)
            for sensors in sizes.sensors
            for kind in (EmpiricalSnapshot, DiscountedSnapshot)
        ),
        *(_choose(sensors, sizes.batches) for sensors in sizes.sensors),
    ]


def _observe(
    kind: type[EmpiricalSnapshot] | type[DiscountedSnapshot], sensors: int, batches: int
) -> Line:
    snapshot = kind(sensors)
    places = _intervals(sensors)
    _settle(snapshot, places)
    upcoming = cycle(places)
    ours, theirs = [], []
    for _ in range(batches):
        batch = list(islice(upcoming, _PLACES))
        # The plain side takes a hundred times as long: a few will do.
        plain, few = Plain(snapshot), batch[:_FEW]
        seconds, expected = _timed(plain.observe, few)
        theirs.append(seconds)
        seconds, states = _timed(snapshot.observe, batch)
        ours.append(seconds)
        if not np.array_equal(expected, states[:_FEW]):
            raise RuntimeError(f"{kind.__name__}: must have the states of plain numpy")
    best, bare = min(ours), min(theirs)
    reach = _REACH.get(sensors)
    return Line(
        f"{kind.__name__}.observe, {sensors:,} sensors",
        f"{_short(best)} (1/{bare / best:.0f} of numpy)",
        f"plain numpy {_short(bare)}",
        "" if reach is None else f"≤ {_short(reach)}",
        None if reach is None else best <= reach,
        {"seconds": best, "numpy_seconds": bare, "times_numpy": bare / best},
    )


def _choose(sensors: int, batches: int) -> Line:
    """Time thresholds that choose themselves against a fixed one, among exceptions."""
    rng = np.random.default_rng(8)
    places = np.array(_intervals(sensors))

    def noisy(ticks: int) -> list[Bits]:
        flips = rng.random((ticks, sensors)) < _FLIPS
        return list(places[rng.integers(0, _PLACES, ticks)] ^ flips)

    fixed, chosen = EmpiricalSnapshot(sensors), EmpiricalSnapshot(sensors, "auto")
    for bits in noisy(_WARM):
        fixed.learn(bits)
        chosen.learn(bits)
    usual, auto = [], []
    for _ in range(batches):
        batch = noisy(_PLACES)
        usual.append(_timed(fixed.observe, batch)[0])
        auto.append(_timed(chosen.observe, batch)[0])
    ratio = min(auto) / min(usual)
    return Line(
        f"EmpiricalSnapshot.observe, threshold auto, {sensors:,} sensors",
        f"{_short(min(auto))} ({ratio:.2f} of a fixed threshold's)",
        f"fixed {_short(min(usual))}",
        f"≤ {_MOST:g} times",
        ratio <= _MOST,
        {"seconds": min(auto), "fixed_seconds": min(usual), "times_fixed": ratio},
    )


class Plain:
    """The same snapshot in plain numpy.

    Args:
        snapshot: Whose weights to start from.
    """

    def __init__(self, snapshot: Snapshot) -> None:
        arrays = snapshot.arrays()
        count = len(snapshot.sensorium)
        self._clock = snapshot.clock
        self._decay = arrays.get("decay")
        self._threshold = arrays["threshold"]
        self._flip = np.arange(2 * count) ^ 1
        self._pairs = np.arange(2 * count) // 2
        self._other = self._pairs[:, None] != self._pairs[None, :]
        self._weights = _dense(arrays["joints"], arrays["marginals"], self._total())
        self._now = np.zeros(self._weights.shape, np.bool_)  # the edges there are

    def _total(self) -> float:
        return float(self._clock) if self._decay is None else 1.0

    def observe(self, bits: Bits) -> Bits:
        """Return the state after one more observation."""
        observation = complete(bits)
        both = observation[:, None] & observation[None, :]
        if self._decay is None:
            self._clock += 1
            self._weights += both
            slack = 0.0
        else:
            self._weights *= self._decay
            self._weights += (1 - self._decay) * both
            slack = _SLACK
        self._now = self._edges(slack)
        reached = self.above(observation)
        state: Bits = reached & ~reached[self._flip]
        return state

    def _edges(self, slack: float) -> Bits:
        """Return the edges of the weights; where they decay, truncate these after."""
        w, flip = self._weights, self._flip
        against, counter = w[:, flip], w[flip]  # w_ab*, w_a*b
        rest = counter[:, flip]
        least = np.minimum(np.minimum(w, counter), rest)
        least = np.minimum(least, self._threshold * self._total())
        equal = (against <= slack) & (counter <= slack) & self._other
        opposite = equal[:, flip]
        strict = (against < least - slack) & self._other & ~equal & ~opposite
        if self._decay is not None:
            self._truncate(strict)
        edges: Bits = strict | equal
        return edges

    def _truncate(self, strict: Bits) -> None:
        """Take from every square the weight against its implication."""
        flip = self._flip
        mine = self._weights.diagonal()
        w = np.where(strict, mine[:, None], self._weights)  # a -> b
        w = np.where(strict.T, mine[None, :], w)  # b -> a
        w[strict[:, flip]] = 0.0  # a -> b*
        w = np.where(strict[flip], mine[:, None] - mine[flip][None, :], w)  # a* -> b
        self._weights = w

    def above(self, literals: Bits) -> Bits:
        """Return the literals and all that can be reached from them now."""
        reached = literals.copy()
        fresh = literals
        while fresh.any():
            fresh = self._now[fresh].any(axis=0) & ~reached
            reached |= fresh
        return reached


def _dense(
    joints: NDArray[np.generic], marginals: NDArray[np.generic], total: float
) -> NDArray[np.float64]:
    """Return the weights of all pairs of literals, ``(2N, 2N)``."""
    count = marginals.size
    mine = marginals.astype(np.float64)
    square = np.zeros((count, count))
    square[np.tril_indices(count, -1)] = joints
    square += square.T
    np.fill_diagonal(square, mine)
    weights = np.zeros((2 * count, 2 * count))
    weights[::2, ::2] = square
    weights[::2, 1::2] = mine[:, None] - square
    weights[1::2, ::2] = mine[None, :] - square
    weights[1::2, 1::2] = total - mine[:, None] - mine[None, :] + square
    return weights


def _intervals(sensors: int) -> list[Bits]:
    """Return what sensors that are on along stretches of a line see at each place."""
    rng = np.random.default_rng(7)
    start = rng.integers(0, _PLACES, sensors)
    stop = start + rng.integers(1, _PLACES // 2, sensors)
    places = rng.permutation(_PLACES)
    return [(start <= place) & (place < stop) for place in places]


def _settle(snapshot: Snapshot, places: list[Bits]) -> None:
    """Observe all places over and over until the graph no longer changes."""
    for _ in range(_LONGEST):
        changes = [snapshot.learn(bits) for bits in places]  # a whole round
        if not any(changes):
            return
    raise RuntimeError("observe: the graph must settle, it goes on changing")


def _timed(work: Callable[[Bits], Bits], batch: list[Bits]) -> tuple[float, list[Bits]]:
    """Return the seconds a call takes, and what the calls returned."""
    began = time.perf_counter()
    results = [work(bits) for bits in batch]
    return (time.perf_counter() - began) / len(batch), results


def _short(seconds: float) -> str:
    """Return a short time in words."""
    return f"{seconds * 1e6:.0f} µs" if seconds < 1e-3 else f"{seconds * 1e3:.1f} ms"
