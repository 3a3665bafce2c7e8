"""Readings with planted relations, and the ground truth.

Chains are bins of one value, exclusions its two ends; a near copy shows what another
sensor shows. Each bit is then flipped with a small chance, copies on their own.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Planted:
    """A table of readings, and its relations as pairs of columns."""

    table: NDArray[np.bool_]
    """``(T, N)``."""
    covers: frozenset[tuple[int, int]]
    """The first implies the second, and nothing lies between them."""
    implied: frozenset[tuple[int, int]]
    """All implications, those that follow from covers too."""
    exclusions: frozenset[frozenset[int]]
    copies: frozenset[frozenset[int]]


def planted(
    seed: int,
    noise: float,
    sensors: int = 200,
    rows: int = 5000,
    hold: float = 0.0,
    rates: tuple[float, float] = (0.2, 0.8),
) -> Planted:
    """Make readings with 30 covers, 10 exclusions and 10 near copies.

    Args:
        seed: Of all chance.
        noise: The chance that a bit is flipped.
        sensors: How many columns; those without a relation are independent.
        rows: How many.
        hold: The chance that a value stays what it was at the tick before.
        rates: How often a sensor is on, at least and at most.
    """
    chance = np.random.default_rng(seed)
    place = chance.permutation(sensors).tolist()
    table = np.zeros((rows, sensors), np.bool_)

    def value() -> NDArray[np.float64]:
        fresh = chance.random(rows) >= hold
        fresh[:1] = True
        last = np.maximum.accumulate(np.where(fresh, np.arange(rows), 0))
        return chance.random(rows)[last]

    covers, implied = set(), set()
    for _ in range(6):
        chain, shown = [place.pop() for _ in range(6)], value()
        for sensor, bound in zip(chain, np.linspace(*rates, 6), strict=True):
            table[:, sensor] = shown < bound
        covers |= set(itertools.pairwise(chain))
        implied |= {(a, b) for k, a in enumerate(chain) for b in chain[k + 1 :]}
    exclusions, copies = set(), set()
    for _ in range(10):
        a, b, shown = place.pop(), place.pop(), value()
        first = chance.uniform(rates[0], 0.4)
        table[:, a] = shown < first
        table[:, b] = shown > 1 - chance.uniform(rates[0], 0.4)
        exclusions.add(frozenset((a, b)))
    for _ in range(10):
        a, b = place.pop(), place.pop()
        table[:, a] = table[:, b] = value() < chance.uniform(*rates)
        copies.add(frozenset((a, b)))
    for sensor in place:
        table[:, sensor] = value() < chance.uniform(0.02, 0.98)
    table ^= chance.random((rows, sensors)) < noise
    return Planted(
        table,
        frozenset(covers),
        frozenset(implied),
        frozenset(exclusions),
        frozenset(copies),
    )
