"""The row on learning that leaves pairs alone: against learning that judges every pair.

Both learn from the same observations, of which the eager one is timed at few: it takes
as long for each.
"""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tools.bench.report import Line, Sizes

_REACH = 0.1e-9  # seconds a pair and observation, of a walk
_PAIRS = 2e10  # pairs that all observations have together, about
_MOST = 40_000  # observations
_FEW = 60  # times that the eager one is timed
_COLD = 3  # observations that compile

Bits = NDArray[np.bool_]


class _Eager(EmpiricalSnapshot):
    """Judges every pair at every observation."""

    def _update(self) -> bool:
        return self._count(self._clock + 1)


def lazy(sizes: Sizes) -> list[Line]:
    """Time observations of a walk, and of sensors that read at random."""
    return [
        _line(count, what, source)
        for count in sizes.crowds
        for what, source in (("a walk", _walk), ("noise", _noise))
    ]


def _line(count: int, what: str, source: Callable[[int], Callable[[], Bits]]) -> Line:
    pairs, read = count * (count - 1) / 2, source(count)
    ticks = int(max(200, min(_MOST, _PAIRS / pairs)))
    ours, plain = EmpiricalSnapshot(count), _Eager(count)
    spent, eager = [], []
    for tick in range(ticks):
        bits = read()
        spent.append(_timed(ours, bits))
        if tick % max(1, ticks // _FEW) == 0:
            eager.append(_timed(plain, bits))
    each = sum(spent[_COLD:]) / (ticks - _COLD)
    other = float(np.median(eager[_COLD:]))
    longest = max(spent[_COLD:]) / other
    walks = source is _walk
    return Line(
        f"learning {what}, {count:,} sensors, a pair and observation of {ticks:,}",
        f"{each / pairs * 1e9:.3f} ns ({each / other:.2f} ×; longest {longest:.1f} ×)",
        f"every pair judged {other / pairs * 1e9:.2f} ns",
        reach=f"≤ {_REACH * 1e9:g} ns" if walks else "≤ 1 ×",
        reached=each / pairs <= _REACH if walks else each <= other,
        figures={"seconds": each, "eager_seconds": other, "longest": longest},
    )


def _timed(snapshot: EmpiricalSnapshot, bits: Bits) -> float:
    began = time.perf_counter()
    snapshot.learn(bits)
    return time.perf_counter() - began


def _walk(count: int) -> Callable[[], Bits]:
    """Return what reads thresholds on a line that somebody walks up and down."""
    rng, places, at = np.random.default_rng(1), np.arange(count), [count // 2]

    def read() -> Bits:
        at[0] = int(np.clip(at[0] + rng.integers(-1, 2), 0, count))
        bits: Bits = places < at[0]
        return bits

    return read


def _noise(count: int) -> Callable[[], Bits]:
    """Return what reads sensors that are on at random, each as often as it is."""
    rng = np.random.default_rng(1)
    shares = rng.random(count)
    return lambda: rng.random(count) < shares
