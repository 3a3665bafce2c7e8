"""Bounds how often chance makes two shares differ that much, by two tests.

Both are told as evidence, in nats: the logarithm of the bound, made positive.
"""

import math

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.compiled import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
_MOST = 700.0
"""The largest evidence that is told: a float holds the chance."""


def by_trials(failed: Ints, tested: Ints) -> Floats:
    """Return how surely trials of the one sample fail oftener than of the other.

    Fisher's (1934) exact test, one-sided. Its tail is bounded by a geometric series:
    each further term is smaller by at least as much as the one before.

    Args:
        failed: ``(2, n)``: failures in each sample.
        tested: ``(2, n)``: trials.

    Returns:
        ``(2, n)``: that the second fails oftener; that the first does.
    """
    evidence = np.zeros(failed.shape)
    _fisher(failed, tested, evidence)
    return evidence


@njit()
def _fisher(failed: Ints, tested: Ints, evidence: Floats) -> None:
    for place in range(failed.shape[1]):
        for way in range(2):
            x, n = failed[1 - way, place], tested[1 - way, place]
            y, m = failed[way, place], tested[way, place]
            if x * m <= y * n:
                continue
            log = _choices(n, x) + _choices(m, y) - _choices(n + m, x + y)
            # y goes down as x goes up; x is above what is expected of it.
            ratio = (n - x) * y / ((x + 1) * (m - y + 1))
            evidence[way, place] = min(_MOST, max(0.0, math.log1p(-ratio) - log))


@njit()
def _choices(n: int, k: int) -> float:
    """Return the logarithm of the ways to choose `k` of `n`."""
    return math.lgamma(n + 1) - math.lgamma(k + 1) - math.lgamma(n - k + 1)


def by_stretches(failed: tuple[Ints, Ints], tested: tuple[Ints, Ints]) -> float:
    """Return how surely the second share is larger, by its spread over stretches.

    Welch's (1947) test of two ratios, each with the variance of a ratio estimate; its
    tail is Wallace's (1959) approximation.

    Args:
        failed: Of each sample ``(S,)``: failures in each of its stretches.
        tested: Of each, ``(S,)``: trials.
    """
    shares, variances, worths = [], [], []
    for some, of in zip(failed, tested, strict=True):
        total, stretches = int(of.sum()), len(of)
        if not total or stretches < 2:
            return 0.0
        share = int(some.sum()) / total
        off = some - share * of
        worth = stretches / _lingers(off)
        if worth <= 1:
            return 0.0
        shares.append(share)
        worths.append(worth)
        variances.append(float(off @ off) / total**2 * stretches / (worth - 1))
    difference, variance = shares[1] - shares[0], sum(variances)
    if difference <= 0:
        return 0.0
    if not variance:
        return _MOST
    freedom = variance**2 / sum(
        own**2 / (worth - 1) for own, worth in zip(variances, worths, strict=True)
    )
    square = freedom * math.log1p(difference**2 / variance / freedom)
    z = (8 * freedom + 1) / (8 * freedom + 3) * math.sqrt(square)
    return -math.log(math.erfc(min(z / math.sqrt(2), 26.0)) / 2)


def _lingers(off: Floats) -> float:
    """Return how many stretches in a row are worth one, as they are alike.

    One, and twice the autocorrelations up to the first that may be chance's.
    """
    square, alike = float(off @ off), 1.0
    for lag in range(1, len(off) // 2):
        shared = float(off[lag:] @ off[:-lag])
        if shared <= square / math.sqrt(len(off)):
            break
        alike += 2 * shared / square
    return alike
