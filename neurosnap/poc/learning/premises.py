"""Finds which two or three literals together imply another: ``a ∧ b -> c``.

``a ∧ b -> c`` says that ``a``, ``b`` and ``c*`` are never read together, and so do
``a ∧ c* -> b*`` and ``b ∧ c* -> a*``. So what is looked for are *exclusions*, sets of
literals that are never read together, though each of them is read with all but one of
the others. A set is told if that is so of each two of its literals by the rule for two
(`neurosnap.poc.learning.relation_rule`) among the ticks at which all others of the set
were read. So each literal of it counts: without it there would be twice as many
exceptions at least, and that is no accident. All sets that could be asked about count
against it, also where the search passes them over.

Of three literals all sets are looked at, as long as they are few enough; a parity has
no two literals that tell anything. Otherwise, and of four literals, it goes on from the
sets that are rare by no accident: one literal more must tell their exceptions apart.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, permutations
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.relation_rule import (
    LEAST_H,
    WORK,
    Floats,
    divergence,
    evidence_for,
    exclusions,
    ticks_for_one,
)
from neurosnap.poc.order.literal_set_kernels import population
from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

Literals: TypeAlias = tuple[int, ...]
Numbers: TypeAlias = NDArray[np.int64]
MOST = 3
"""Premises at most."""
_ASIDE = 64
"""Words of 64 ticks that take as long as what is counted of a set besides."""
_BEGUN = 0.1
"""The least H of a set that the search goes on from."""
_EASIER = 3
"""By how much less evidence does to go on from a set. That bounds nothing."""
_ROOM = 1 << 16
"""Sets that a search returns at a time."""
_KEPT = 1 << 14
"""Sets of each size that it goes on with, at most."""


class Exclusion(NamedTuple):
    """Literals that are never read together, or hardly ever."""

    literals: Literals
    """Ascending."""
    evidence: float
    """That each of them counts, in nats."""
    failed: bool
    """Whether they were ever read together."""


def find_exclusions(
    columns: Columns,
    most: int,
    reach: NDArray[np.bool_],
    shares: int = 1,
    work: int = WORK,
) -> tuple[list[Exclusion], int]:
    """Return the sets of three literals, or four, that the readings exclude.

    Args:
        columns: The readings.
        most: Premises at most: 1, 2 or 3.
        reach: ``(2N, 2N)``: what implies what, reflexive. Of sets that follow from
            others by it none is returned.
        shares: It has one share of so many of the accidents that are allowed.
        work: Words of 64 ticks to look at, about.

    Returns:
        Those with most evidence first, and how many sets the search passed over, being
        too many: those with least evidence. O(N³ T / 64) time, up to `work`.
    """
    if most < 2:
        return [], 0
    found: list[Exclusion] = []
    begun, left = _pairs(columns, work)
    for size in range(3, most + 2):
        sets = (1 << size) * math.comb(len(columns.on), size)
        needed = evidence_for(shares * sets)
        odd = _odd_sets(columns, begun, size, needed / _EASIER)
        left += odd.left
        sure = [*_sure(columns, odd.literals[odd.h >= LEAST_H], needed)]
        found += sure
        told = {one.literals for one in sure if not one.failed}
        failing = [not told & {tuple(one)} for one in odd.literals.tolist()]
        begun = np.unique(odd.literals[failing] >> 1, axis=0)
    found.sort(key=lambda one: (-one.evidence, one.literals))
    return [*_covers(found, reach)] if len(found) else [], left


class _Odd(NamedTuple):
    """Sets that are rare by no accident, those with most evidence first."""

    literals: Numbers
    """``(n, m)``, ascending in each."""
    h: Floats
    """``(n,)``: the least H of two of them."""
    left: int
    """How many more there are, with less evidence."""


def _pairs(columns: Columns, work: int) -> tuple[Numbers, int]:
    """Return the pairs of sensors to begin with, and how many are passed over.

    All, if they are few enough; else those that are rare by no accident, and too often
    for the rule.
    """
    sensors, words = columns.on.shape
    every = math.comb(sensors, 2)
    a_sensor = 8 * (words + _ASIDE)
    if math.comb(sensors, 3) * a_sensor <= work:
        return np.stack(np.tril_indices(sensors, -1), axis=1), 0
    single = np.arange(sensors)[:, np.newaxis]
    odd = _odd_sets(columns, single, 2, evidence_for(4 * every))
    failing = np.unique(odd.literals[odd.h < LEAST_H] >> 1, axis=0)
    most = work // (sensors * a_sensor)
    return failing[:most], odd.left + max(0, len(failing) - most)


def _odd_sets(columns: Columns, begun: Numbers, size: int, needed: float) -> _Odd:
    """Return the sets that a sensor more makes, rare by no accident, up to `_KEPT`."""
    literals = np.empty((_ROOM + (1 << size) * len(columns.on), size), np.int64)
    values = np.empty((len(literals), 2))
    best, of_best, start, left = literals[:0], values[:0], 0, 0
    # Where all smaller sets are there, each set comes from one of them.
    every = len(begun) == math.comb(len(columns.on), size - 1)
    # Of all ticks; of those at which others were read it is asked of what is found.
    table = columns.on, columns.off, ticks_for_one(columns)
    while start < len(begun):
        start, count = _search(table, begun, start, every, needed, literals, values)
        # Else the same set may come once for each of its sensors.
        both = np.concatenate([best, np.sort(literals[:count], axis=1)])
        best, first = np.unique(both, axis=0, return_index=True)
        of_best = np.concatenate([of_best, values[:count]])[first]
        order = np.argsort(-of_best[:, 0], kind="stable")
        left += max(0, len(order) - _KEPT)
        best, of_best = best[order[:_KEPT]], of_best[order[:_KEPT]]
    return _Odd(best, of_best[:, 1], left)


@njit()
def _search(
    table: tuple[Words, Words, NDArray[np.float32]],
    begun: Numbers,
    start: int,
    ordered: bool,
    needed: float,
    literals: Numbers,
    values: Floats,
) -> tuple[int, int]:
    """Add a sensor to sets of sensors, and note which of their readings are odd.

    Args:
        table: ``(N, W)`` each, the ticks at which sensors are on, and off; and how many
            ticks of two are worth one, ``(N, N)``.
        begun: ``(B, m)``, the sets.
        start: The first that counts.
        ordered: Whether to add only sensors with a lower number than all of the set.
        needed: The evidence that each two of the literals need.
        literals: ``(n, m + 1)``, filled.
        values: ``(n, 2)``, filled: the least evidence of two of them, and the least H.

    Returns:
        The set to go on with, and how many were noted.
    """
    on, off, for_one = table
    m = begun.shape[1]
    cells, words = 1 << m, on.shape[1]
    sensors, worth = np.empty(m + 1, np.int64), np.ones((m + 1, m + 1))
    joint = np.empty((cells, words), np.uint64)
    counts = np.empty(2 * cells)
    noted = 0
    for place in range(start, len(begun)):
        if noted and noted + 2 * cells * len(on) > len(literals):
            return place, noted
        _join(on, off, begun[place], joint)
        for sensor in range(begun[place].min() if ordered else len(on)):
            if np.any(begun[place] == sensor):
                continue
            for cell in range(cells):
                yes = no = np.uint64(0)
                for w in range(words):
                    yes += population(joint[cell, w] & on[sensor, w])
                    no += population(joint[cell, w] & off[sensor, w])
                counts[cell], counts[cells + cell] = yes, no
            sensors[:m], sensors[m] = begun[place], sensor
            for r in range(m + 1):
                for s in range(m + 1):
                    worth[r, s] = for_one[sensors[r], sensors[s]]
            for cell in range(2 * cells):
                evidence, h = _least(counts, cell, worth, needed)
                if evidence >= needed:
                    for k in range(m):
                        literals[noted, k] = 2 * begun[place, k] + (cell >> k & 1)
                    literals[noted, m] = 2 * sensor + (cell >> m)
                    values[noted, 0], values[noted, 1] = evidence, h
                    noted += 1
    return len(begun), noted


@njit()
def _join(on: Words, off: Words, sensors: Numbers, joint: Words) -> None:
    """Fill the ticks of each joint reading; bit ``k`` of its number: ``k`` is off."""
    for cell in range(len(joint)):
        for w in range(joint.shape[1]):
            both = ~np.uint64(0)
            for k in range(len(sensors)):
                both &= off[sensors[k], w] if cell >> k & 1 else on[sensors[k], w]
            joint[cell, w] = both


@njit()
def _least(
    counts: Floats, cell: int, worth: Floats, needed: float
) -> tuple[float, float]:
    """Return the least evidence for a joint reading of any two of its literals.

    With it comes the least H. It stops at two that have too little.

    Args:
        counts: ``(2**m,)``: of all joint readings.
        cell: The one.
        worth: ``(m, m)``: how many ticks of two of its sensors are worth one.
        needed: The evidence.
    """
    least, least_h = np.inf, 1.0
    failed = counts[cell]
    for r in range(len(worth)):
        for s in range(r):
            of_r, of_s = failed + counts[cell ^ 1 << s], failed + counts[cell ^ 1 << r]
            total = of_r + of_s - failed + counts[cell ^ 1 << r ^ 1 << s]
            if failed * total > (1 - _BEGUN) * of_r * of_s or of_r * of_s == 0:
                return 0.0, 0.0
            by_r = of_r * divergence(failed / of_r, of_s / total)
            by_s = of_s * divergence(failed / of_s, of_r / total)
            least = min(least, max(by_r, by_s) / worth[r, s])
            least_h = min(least_h, 1 - failed * total / (of_r * of_s))
            if least < needed:
                return least, least_h
    return least, least_h


def _sure(columns: Columns, sets: Numbers, needed: float) -> Iterator[Exclusion]:
    """Yield those of some sets of which the rule tells that each literal counts."""
    least, failed = np.full(len(sets), np.inf), np.zeros(len(sets), np.bool_)
    for two in combinations(range(sets.shape[1]), 2):
        left = np.flatnonzero(least >= needed)
        judged = exclusions(_among(columns, sets[left], two))
        least[left] = np.minimum(least[left], judged.evidence)
        failed[left] = judged.counts.ticks[0] > 0
    for place in np.flatnonzero(least >= needed):
        ever = bool(failed[place])
        yield Exclusion(tuple(sets[place].tolist()), float(least[place]), ever)


def _among(
    columns: Columns, sets: Numbers, two: tuple[int, int]
) -> Iterator[tuple[Words, Words, Words, Words]]:
    """Yield two literals of each set, as read where all others of it were."""
    for literals in sets.tolist():
        r, s = (literals[k] for k in two)
        rest = [columns.ticks_of(one) for one in literals if one not in (r, s)]
        where = np.bitwise_and.reduce(rest)
        a, a_off, b, b_off = (columns.ticks_of(one) for one in (r, r ^ 1, s, s ^ 1))
        yield a & where, a_off & where, b & where, b_off & where


def _covers(
    found: Sequence[Exclusion], reach: NDArray[np.bool_]
) -> Iterator[Exclusion]:
    """Yield the sets that do not follow from another.

    They do if each literal implies one of the other set; what never failed does not
    follow from what did. Of sets that follow from each other the first stays.
    """
    for size in sorted({len(one.literals) for one in found}):
        same = [one for one in found if len(one.literals) == size]
        table = np.array([one.literals for one in same])
        follows = np.zeros((len(same), len(same)), np.bool_)
        for order in permutations(range(size)):
            steps = [
                reach[np.ix_(table[:, k], table[:, o])] for k, o in enumerate(order)
            ]
            follows |= np.logical_and.reduce(steps)
        failed = np.array([one.failed for one in same])
        follows &= failed[:, np.newaxis] | ~failed
        left = ~(follows & ~np.triu(follows & follows.T)).any(axis=1)
        yield from (same[place] for place in np.flatnonzero(left))
