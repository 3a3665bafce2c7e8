"""Decides which relations between two sensors the readings support, despite noise.

The threshold of a snapshot asks how small the weight against an implication is. Rare
sensors pass it by chance, and noisy ones do not. The rule here asks three things of
``a -> b``:

- It never failed, or fails rarely: its promise is at most 15 %. The promise is the
  largest share of tests to fail in as many occasions again for which a score test with
  a confidence of 95 % would still say that nothing has changed. Failures are counted in
  ticks, and what they are worth in occasions (`neurosnap.poc.learning.pair_occasions`);
  tests are the ticks with ``a``, and those with ``b*``, and the worse side counts.
- It is far from chance: ``1 - w_ab* t / (w_a w_b*)`` is at least 1/2. That is
  Loevinger's H (1948); Mokken (1971) calls a scale strong from 1/2 on.
- It is no accident: were ``a`` and ``b`` independent, as few failures in as many tests
  would come less often than once in 20 tables, all pairs of a table taken together
  (Bonferroni). The bound is Hoeffding's (1963) for draws without replacement, ``exp(-n
  KL(f || q))`` for the share ``f`` of ``a`` at which ``b`` is off, and the share ``q``
  of all ticks at which it is; or the same for ``b*`` and ``a``, if that says more.

Ticks in which nothing changes prove nothing. Of ``t`` ticks count as many as
independent ones would be worth: ``t / sum r_a(l) r_b(l)`` over all lags ``l``, with the
autocorrelations of both sensors (Bartlett 1946). Were one sensor shifted in time
against the other, by every lag in turn, the failures would vary as much as in so many
independent ticks. By Parseval's theorem the sum is one over the spectra of both, so
that no lag is left out, and sensors that follow the same day prove little. And the
bound must be good enough with occasions for ``n``, too. Of a sensor that changed once
nothing can be known, and flips by noise do not pass for changes.

Two sensors are *nearly the same* if each implies the other by that, Cohen's kappa is at
least 0.75 (Fleiss calls that excellent), and flipped readings of a copy can explain how
they differ: such flips are no more one-sided than on and off are. If flips explain it,
and one side promises too little, nothing is told. Else the one that is on more rarely
implies the other.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.pair_occasions import PairCounts, count_row
from neurosnap.poc.order.literal_sets import Words, from_words
from neurosnap.system.compiled import njit

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
PROMISE = 0.15
"""The largest promise of an implication that has failed. Of planted relations with up
to 2 % of flipped bits all are found with it, and not with 0.125."""
LEAST_H = 0.5
"""The least H of an implication."""
CHANCE = 0.05
"""Tables of independent sensors in which anything is found, at most."""
KINDS = 3
"""Of two literals; of several premises; of what holds late."""
KAPPA = 0.75
"""The least kappa of near copies."""
ONE_SIDED = 0.001
"""How unlikely it must be that flips explain a difference, to call it one-sided."""
WORK = 1 << 35
"""Words of 64 ticks that a search beyond pairs looks at; some seconds."""
_SURE = 1.645
"""Standard deviations of a normal variable that it exceeds once in twenty times."""
_STRETCH = 1 << 16
"""Ticks of which a spectrum is taken, at most; spectra of stretches are averaged."""
_SPECTRA = 1 << 24
"""Ticks of all sensors in a stretch, at most."""
_STEP = 1 << 18
"""Pairs that are judged at a time."""
CODES = (4, 1, 2, 8)
"""What it means that a joint reading is an exception, as in
`neurosnap.poc.learning.pairs`."""


_for_one: WeakKeyDictionary[Columns, NDArray[np.float32]] = WeakKeyDictionary()
"""What `ticks_for_one` returned, as long as the readings are there."""


class Judged(NamedTuple):
    """The verdict of the rule on each pair."""

    codes: NDArray[np.uint8]
    """``(P,)``, as in `neurosnap.poc.learning.pairs`; 3 and 12 for near copies and
    near opposites, too."""
    near: Flags
    """``(P,)``: whether they are near copies or near opposites, and not exact ones."""


def judge(
    columns: Columns,
    counts: PairCounts,
    known: Flags | None = None,
    worth: NDArray[np.float32] | None = None,
) -> Judged:
    """Apply the rule to all pairs.

    Args:
        columns: The readings.
        counts: Their counts.
        known: ``(P,)``, the pairs whose relation is no question; they are not tested.
        worth: ``(N, N)``: how many ticks of two sensors are worth one; if None, what
            `ticks_for_one` returns.

    Returns:
        O(N²) time and space.
    """
    worth = ticks_for_one(columns) if worth is None else worth
    pairs = counts.ticks.shape[1]
    judged = Judged(np.zeros(pairs, np.uint8), np.zeros(pairs, np.bool_))
    tested = pairs if known is None else pairs - int(known.sum())
    needed = evidence_for(4 * tested)
    i, j = np.tril_indices(len(columns.sensorium), -1)
    for start in range(0, pairs, _STEP):
        some = slice(start, start + _STEP)
        ticks = counts.ticks[:, some].astype(np.float64)
        runs = counts.occasions[:, some].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            of_some = worth[i[some], j[some]].astype(np.float64)
            codes, near = _judge_some(of_some, ticks, runs, needed)
        judged.codes[some], judged.near[some] = codes, near
    return judged


def promises(counts: PairCounts, codes: NDArray[np.uint8]) -> Floats:
    """Return what each pair with a code promises, ``(P,)``; of others 0.

    In as many occasions again no more than this share of its tests fail.
    """
    most, told = np.zeros(len(codes)), codes.nonzero()[0]
    ticks = counts.ticks[:, told].astype(np.float64)
    runs = counts.occasions[:, told].astype(np.float64)
    for cell, code in enumerate(CODES):
        some = (codes[told] & code) > 0
        with np.errstate(divide="ignore", invalid="ignore"):
            promised = _promised(ticks[:, some], runs[:, some], cell)
        most[told[some]] = np.maximum(most[told[some]], promised)
    return most


def _promised(ticks: Floats, runs: Floats, cell: int) -> Floats:
    """Return the promise of the implication whose exceptions are a joint reading."""
    worse = np.zeros(ticks.shape[1])
    for passes in cell ^ 1, cell ^ 2:
        share = ticks[cell] / (ticks[cell] + ticks[passes])
        tests = runs[cell] + runs[passes]
        # A failure that lasts is one, and so is a test.
        worth = np.where(share > 0, np.minimum(tests, runs[cell] / share), tests)
        # The root of (y - x)^2 = z^2 (x + y) (1 - (x + y) / 2n), for shares of n.
        square = _SURE**2 / worth
        scale, both = 1 + square / 2, 2 * share + square * (1 - share)
        inner = both**2 - 4 * scale * share * (scale * share - square)
        most = (both + np.sqrt(np.maximum(inner, 0))) / (2 * scale)
        worse = np.maximum(worse, np.where(worth > 0, np.minimum(most, 1), 1))
    return worse


def keeps(
    ticks: NDArray[np.uint32], codes: NDArray[np.uint8], most: Floats
) -> tuple[Flags, Flags]:
    """Return which promises the joint readings of other ticks test, and which hold."""
    tested, holds = np.zeros(len(codes), np.bool_), np.ones(len(codes), np.bool_)
    for cell, code in enumerate(CODES):
        told = (codes & code) > 0
        for passes in cell ^ 1, cell ^ 2:
            tests = ticks[cell] + ticks[passes]
            tested |= told & (tests > 0)
            holds &= ~told | (ticks[cell] <= most * tests)
    return tested, holds


def evidence_for(questions: int) -> float:
    """Return the evidence that one of so many questions needs, in nats.

    There are `KINDS` of questions; of each as many tables of independent sensors have
    an answer.
    """
    return math.log(KINDS * max(questions, 1) / CHANCE)


class Exclusions(NamedTuple):
    """What speaks for it that two literals are never read together; ``(M,)`` each."""

    evidence: Floats
    """That this is no accident, in nats."""
    h: Floats
    """Loevinger's."""
    most: Floats
    """What it promises."""
    counts: PairCounts
    """Of the joint readings of both, ``(4, M)``."""

    def holds(self, needed: float) -> Flags:
        """Return ``(M,)``: whether the rule tells it, if it needs so much evidence."""
        told = (self.counts.ticks[0] == 0) | (self.most <= PROMISE)
        sure: Flags = (self.evidence >= needed) & (self.h >= LEAST_H) & told
        return sure


def exclusions(literals: Iterable[tuple[Words, Words, Words, Words]]) -> Exclusions:
    """Apply the rule to some pairs of literals: are they never read together?

    Args:
        literals: Of each pair, ``(W,)`` each: the ticks of the first, and of its
            opposite; the same of the second.

    Returns:
        O(M T log T) time; of few pairs at a time, O(T) space.
    """
    worth, ticks, runs = [], [], []
    for first, first_off, second, second_off in literals:
        on, off = np.stack([second, first]), np.stack([second_off, first_off])
        counted = np.zeros((2, 4, 1), np.uint32)
        count_row(on, off, 1, 0, counted[0], counted[1])
        spectra = spectra_of(on, off)
        worth.append(max(float(spectra[0] @ spectra[1]), 1.0))
        ticks.append(counted[0, :, 0])
        runs.append(counted[1, :, 0])
    counts = PairCounts(
        *(np.array(each, np.uint32).reshape(-1, 4).T for each in (ticks, runs))
    )
    of_ticks, of_runs = (each.astype(np.float64) for each in counts)
    with np.errstate(divide="ignore", invalid="ignore"):
        evidence, h = _odd(np.array(worth), of_ticks, of_runs, 0)
        return Exclusions(evidence, h, _promised(of_ticks, of_runs, 0), counts)


def ticks_for_one(columns: Columns) -> NDArray[np.float32]:
    """Return how many ticks of two sensors are worth one, ``(N, N)``; they are kept."""
    if columns not in _for_one:
        spectra = spectra_of(columns.on, columns.off)
        _for_one[columns] = np.maximum(spectra @ spectra.T, 1)
    return _for_one[columns]


def spectra_of(on: Words, off: Words) -> NDArray[np.float32]:
    """Return the spectra of some sensors, of which each is a row.

    The products of two rows add up to how many ticks of both are worth one independent
    tick, if that is above 1: to what the products of their autocorrelations add up to.

    Args:
        on: ``(N, W)``.
        off: ``(N, W)``.
    """
    words = on.shape[1]
    most = min(_STRETCH, max(64, _SPECTRA // max(len(on), 1)))
    length = 1 << min((64 * words).bit_length(), most.bit_length() - 1)
    stretches = -(-64 * words // length) or 1
    padded = 2 * length  # so that no end is next to a beginning
    # Half a spectrum stands for all of it: all but its ends are there twice.
    weights = np.full(length + 1, 2 / padded, np.float32)
    weights[[0, -1]] /= 2
    spectra = np.zeros((len(on), len(weights)), np.float32)
    for sensor, spectrum in enumerate(spectra):
        yes, no = (from_words(bits[sensor], 64 * words) for bits in (on, off))
        share = np.float32(yes.sum() / max(yes.sum() + no.sum(), 1))
        apart = np.zeros(stretches * length, np.float32)
        apart[: 64 * words] = yes * (1 - share) - no * share
        waves = np.fft.rfft(apart.reshape(stretches, length), padded)
        spectrum += (waves.real**2 + waves.imag**2).mean(axis=0)
        # Of a sensor that never changes anything holds, and nothing is claimed.
        spectrum *= np.sqrt(weights) / max((spectrum * weights).sum(), 1e-12)
    return spectra


def _odd(
    for_one: Floats, ticks: Floats, runs: Floats, cell: int
) -> tuple[Floats, Floats]:
    """Return the evidence that a joint reading is rare by no accident, and its H."""
    total = ticks.sum(axis=0)
    by_i, by_j = cell ^ 1, cell ^ 2  # the readings of the tests that it passes
    of_a, of_b = ticks[cell] + ticks[by_i], ticks[cell] + ticks[by_j]
    by_a = _surprise(ticks[cell] / of_a, of_b / total)
    by_b = _surprise(ticks[cell] / of_b, of_a / total)
    evidence = np.maximum(of_a * by_a, of_b * by_b) / for_one
    tests = runs[cell] + runs[by_i], runs[cell] + runs[by_j]
    occasions = np.maximum(tests[0] * by_a, tests[1] * by_b)
    h = 1 - ticks[cell] * total / (of_a * of_b)
    return np.minimum(evidence, occasions), h


def _judge_some(
    for_one: Floats, ticks: Floats, runs: Floats, needed: float
) -> tuple[NDArray[np.uint8], Flags]:
    """Judge some pairs, ``(p,)``, of which so many ticks are worth one."""
    total = ticks.sum(axis=0)
    of_i = np.array([ticks[0] + ticks[1], ticks[2] + ticks[3]])
    of_j = np.array([ticks[0] + ticks[2], ticks[1] + ticks[3]])
    holds = np.zeros(ticks.shape, np.bool_)
    for cell in range(4):
        evidence, h = _odd(for_one, ticks, runs, cell)
        told = (ticks[cell] == 0) | (_promised(ticks, runs, cell) <= PROMISE)
        holds[cell] = (evidence >= needed) & (h >= LEAST_H) & told
    codes, near = np.zeros(len(total), np.uint8), np.zeros(len(total), np.bool_)
    flipped = np.zeros(ticks.shape, np.bool_)
    on = (of_i[0] + of_j[0]) / (2 * total)
    off_on = (of_i[0] + of_j[1]) / (2 * total)
    for code, first, second, rate in (3, 1, 2, on), (12, 0, 3, off_on):
        other = int(code == 3)
        expected = of_i[0] * of_j[other] + of_i[1] * of_j[1 - other]
        differ = ticks[first] + ticks[second]
        alike = 1 - differ * total / expected >= KAPPA
        alike &= ~_one_sided(runs[first], runs[second], rate)
        copies = holds[first] & holds[second] & alike
        flipped[[first, second]] = alike & (ticks[[first, second]] > 0)
        codes[copies] = code
        near |= copies & (differ > 0)
    order = np.sort(ticks, axis=0)
    least = order[0] < order[1]
    for cell, code in enumerate(CODES):
        alone = holds[cell] & least & (ticks[cell] == order[0]) & ~flipped[cell]
        codes[alone & (codes == 0)] = code
    return codes, near


@njit()
def divergence(p: float, q: float) -> float:
    """Return the Kullback-Leibler divergence of two coins, in nats."""
    heads = p * math.log(p / q) if p > 0 else 0.0
    return heads + ((1 - p) * math.log((1 - p) / (1 - q)) if p < 1 else 0.0)


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
    """Return the same of many coins."""
    heads = np.where(p > 0, p * np.log(p / q), 0.0)
    tails = np.where(p < 1, (1 - p) * np.log((1 - p) / (1 - q)), 0.0)
    total: Floats = heads + tails
    return total
