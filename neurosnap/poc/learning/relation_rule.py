"""Decides which relations between two sensors the readings support, despite noise.

The threshold of a snapshot asks how small the weight against an implication is. Rare
sensors pass it by chance, and noisy ones do not. The rule here asks three things of
``a -> b``, counted on occasions (`neurosnap.poc.learning.pair_occasions`):

- It can be noise what speaks against it: ``w_ab*`` is at most 4 % of all ticks, and the
  least of the four weights; and at most half of the occasions fail, be it those with
  ``a`` or those with ``b*``.
- It is far from chance: ``1 - w_ab* t / (w_a w_b*)`` is at least 1/2. That is
  Loevinger's H (1948); Mokken (1971) calls a scale strong from 1/2 on.
- It is no accident: were ``a`` and ``b`` independent, as few failures in as many tests
  would come less often than once in 20 tables, all pairs of a table taken together
  (Bonferroni). The bound is Hoeffding's (1963) for draws without replacement, ``exp(-n
  KL(f || q))`` for the share ``f`` of ``a`` at which ``b`` is off, and the share ``q``
  of all ticks at which it is; or the same for ``b*`` and ``a``, if that says more.

Ticks in which nothing changes prove nothing. Of ``t`` ticks count as many as
independent ones would be worth: ``t / (1 + 2 sum r_a(l) r_b(l))`` over all lags ``l``,
with the autocorrelations of both sensors (Bartlett 1946; products that chance would
make, and those below 0, are left out). And the bound must be good enough with
occasions for ``n``, too. Of a sensor that changed once nothing can be known, and flips
by noise do not pass for changes.

Two sensors are *nearly the same* if each implies the other by that, Cohen's kappa is at
least 0.75 (Fleiss calls that excellent), and flipped readings of a copy can explain how
they differ: such flips are no more one-sided than on and off are. Else the one that is
on more rarely implies the other.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.pair_occasions import PairCounts
from neurosnap.poc.order.literal_sets import Words

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
NOISE = 0.04
"""The largest share of all ticks that may speak against an implication."""
FAILING = 0.5
"""The largest share of its tests, each an occasion, that an implication may fail."""
LEAST_H = 0.5
"""The least H of an implication."""
CHANCE = 0.05
"""Tables of independent sensors in which anything is found, at most."""
KAPPA = 0.75
"""The least kappa of near copies."""
ONE_SIDED = 0.001
"""How unlikely it must be that flips explain a difference, to call it one-sided."""
_STEP = 1 << 18
"""Pairs that are judged at a time."""
_CELLS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""The joint readings in their order: 0 is on, 1 is off."""
_CODES = (4, 1, 2, 8)
"""What it means that a joint reading is an exception."""


class Judged(NamedTuple):
    """The verdict of the rule on each pair."""

    codes: NDArray[np.uint8]
    """``(P,)``, as in `neurosnap.poc.learning.pairs`; 3 and 12 for near copies and
    near opposites, too."""
    near: Flags
    """``(P,)``: whether they are near copies or near opposites, and not exact ones."""


class _Rates(NamedTuple):
    """What the readings of each sensor are like."""

    share: Floats
    """``(2, N)``: the share of its known ticks at which a sensor reads on, and off."""
    memory: Floats
    """``(L, N)``: its autocorrelation at some lags."""
    weights: Floats
    """``(L,)``: of how many lags each of these stands for."""
    noise: float
    """What the product of two sampled autocorrelations may be where both are 0."""


def judge(columns: Columns, counts: PairCounts, known: Flags | None = None) -> Judged:
    """Apply the rule to all pairs.

    Args:
        columns: The readings.
        counts: Their counts.
        known: ``(P,)``, the pairs whose relation is no question; they are not tested.

    Returns:
        O(N²) time and space.
    """
    rates = _rates(columns)
    pairs = counts.ticks.shape[1]
    judged = Judged(np.zeros(pairs, np.uint8), np.zeros(pairs, np.bool_))
    tested = pairs if known is None else pairs - int(known.sum())
    needed = np.log(4 * max(tested, 1) / CHANCE)
    i, j = np.tril_indices(len(columns.sensorium), -1)
    for start in range(0, pairs, _STEP):
        some = slice(start, start + _STEP)
        ticks = counts.ticks[:, some].astype(np.float64)
        runs = counts.occasions[:, some].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            codes, near = _judge_some(rates, i[some], j[some], ticks, runs, needed)
        judged.codes[some], judged.near[some] = codes, near
    return judged


def _rates(columns: Columns) -> _Rates:
    known = columns.on | columns.off
    read = np.maximum(np.bitwise_count(known).sum(axis=1), 1)
    on = np.bitwise_count(columns.on).sum(axis=1) / read
    off = np.bitwise_count(columns.off).sum(axis=1) / read
    lags = _lags(columns.ticks)
    memory = np.zeros((len(lags), len(on)))
    # Of a sensor that never changes anything holds, and nothing is claimed.
    spread = np.maximum(on * off, 1e-12)
    for place, lag in enumerate(lags):
        both = np.bitwise_count(columns.on & _later(columns.on, lag)).sum(axis=1)
        sure = np.bitwise_count(known & _later(known, lag)).sum(axis=1)
        memory[place] = (both / np.maximum(sure, 1) - on**2) / spread
    edges = np.array([*lags, columns.ticks // 2 + 1])
    weights = np.diff(edges).astype(np.float64)
    return _Rates(np.array([on, off]), memory, weights, 1 / max(columns.ticks, 1))


def _lags(ticks: int) -> list[int]:
    """Return lags from 1 to half of all ticks, ever farther apart."""
    lags, lag = [], 1
    while lag <= ticks // 2:
        lags.append(lag)
        lag += max(1, lag // 16)
    return lags


def _later(words: Words, lag: int) -> Words:
    """Return columns with every bit moved to `lag` ticks later."""
    skipped, bits = divmod(lag, 64)
    moved = np.zeros_like(words)
    moved[:, skipped:] = words[:, : words.shape[1] - skipped] << np.uint64(bits)
    if bits:
        carried = words[:, : words.shape[1] - skipped - 1] >> np.uint64(64 - bits)
        moved[:, skipped + 1 :] |= carried
    return moved


def _judge_some(
    rates: _Rates,
    i: NDArray[np.int64],
    j: NDArray[np.int64],
    ticks: Floats,
    runs: Floats,
    needed: float,
) -> tuple[NDArray[np.uint8], Flags]:
    """Judge the pairs of sensors `i` and `j`, ``(p,)`` each."""
    total = ticks.sum(axis=0)
    of_i = np.array([ticks[0] + ticks[1], ticks[2] + ticks[3]])
    of_j = np.array([ticks[0] + ticks[2], ticks[1] + ticks[3]])
    alike = np.zeros(len(i))
    for memory, weight in zip(rates.memory, rates.weights, strict=True):
        alike += weight * np.maximum(memory[i] * memory[j] - rates.noise, 0)
    worth = 1 / (1 + 2 * alike)
    holds = np.zeros((4, len(i)), np.bool_)
    for cell, (a, b) in enumerate(_CELLS):
        by_i, by_j = cell ^ 1, cell ^ 2  # the readings of the tests that it passes
        by_a = _surprise(ticks[cell] / of_i[a], of_j[b] / total)
        by_b = _surprise(ticks[cell] / of_j[b], of_i[a] / total)
        evidence = np.maximum(of_i[a] * by_a, of_j[b] * by_b) * worth
        tests = runs[cell] + runs[by_i], runs[cell] + runs[by_j]
        occasions = np.maximum(tests[0] * by_a, tests[1] * by_b)
        evidence = np.minimum(evidence, occasions)
        passes = runs[cell] <= FAILING * np.minimum(*tests)
        h = 1 - ticks[cell] * total / (of_i[a] * of_j[b])
        holds[cell] = (
            (evidence >= needed)
            & (h >= LEAST_H)
            & (ticks[cell] <= NOISE * total)
            & passes
        )
    codes, near = np.zeros(len(i), np.uint8), np.zeros(len(i), np.bool_)
    on = (rates.share[0, i] + rates.share[0, j]) / 2
    off_on = (rates.share[0, i] + rates.share[1, j]) / 2
    for code, first, second, rate in (3, 1, 2, on), (12, 0, 3, off_on):
        other = int(code == 3)
        expected = of_i[0] * of_j[other] + of_i[1] * of_j[1 - other]
        differ = ticks[first] + ticks[second]
        copies = (
            holds[first]
            & holds[second]
            & (1 - differ * total / expected >= KAPPA)
            & ~_one_sided(runs[first], runs[second], rate)
        )
        codes[copies] = code
        near |= copies & (differ > 0)
    order = np.sort(ticks, axis=0)
    least = order[0] < order[1]
    for cell, code in enumerate(_CODES):
        alone = holds[cell] & least & (ticks[cell] == order[0]) & (codes == 0)
        codes[alone] = code
    return codes, near


def _surprise(share: Floats, chance: Floats) -> Floats:
    """Return the exponent of Chernoff's bound for one test; 0 if nothing is odd.

    Given is the share of the tests that failed, and that of those to fail by chance.
    """
    return np.where(share < chance, _divergence(share, chance), 0.0)


def _one_sided(first: Floats, second: Floats, rate: Floats) -> Flags:
    """Return where flips explain badly how two sensors differ.

    A copy that is flipped where it is off adds to one side, where it is on to the
    other; so the sides stand to each other at most as on stands to off.

    Args:
        first: ``(p,)``: the occasions with the first sensor on alone.
        second: ``(p,)``: with the second.
        rate: ``(p,)``: the share of ticks at which they are on.
    """
    differ = first + second
    share = first / differ
    low = np.minimum(rate, 1 - rate)
    explained = np.clip(share, low, 1 - low)
    unlikely = differ * _divergence(share, explained) >= -np.log(ONE_SIDED)
    one_sided: Flags = unlikely & (differ > 0)
    return one_sided


def _divergence(p: Floats, q: Floats) -> Floats:
    """Return the Kullback-Leibler divergence of two coins, in nats."""
    heads = np.where(p > 0, p * np.log(p / q), 0.0)
    tails = np.where(p < 1, (1 - p) * np.log((1 - p) / (1 - q)), 0.0)
    total: Floats = heads + tails
    return total
