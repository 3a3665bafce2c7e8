"""Hypothesis strategies for observations, thresholds, graphs and sets of literals."""

from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.order.graph import PocGraph

Bits = list[list[bool]]


def bit_rows(length: int) -> st.SearchStrategy[list[bool]]:
    """Draw a row of so many bits; as one number, which costs a fraction of a list."""
    return st.integers(0, 2**length - 1).map(
        lambda number: [bool(number >> place & 1) for place in range(length)]
    )


def observations(sensors: int, longest: int) -> st.SearchStrategy[Bits]:
    """Draw a run of observations; it often repeats itself, so that much is learned."""
    one = bit_rows(sensors)
    pool = st.lists(one, min_size=1, max_size=4)
    return pool.flatmap(
        lambda seen: st.lists(st.sampled_from(seen) | one, max_size=longest)
    )


@st.composite
def runs(draw: st.DrawFn, most: int = 5, longest: int = 20) -> tuple[int, Bits]:
    """Draw a number of sensors and a run of observations."""
    sensors = draw(st.integers(1, most))
    return sensors, draw(observations(sensors, longest))


@st.composite
def graphs(draw: st.DrawFn, most: int = 5) -> PocGraph:
    """Draw a graph in which no literal is equivalent to its own complement.

    Literals get levels, opposite ones for complements; edges go up, or along a level
    that is not 0, so that no cycle meets a literal and its complement.
    """
    sensors = draw(st.integers(0, most))
    level: list[int] = []
    for _ in range(sensors):
        height = draw(st.integers(-2, 2))
        level += [height, -height]
    allowed = [
        (a, b)
        for a in range(2 * sensors)
        for b in range(2 * sensors)
        if a != b and (level[a] < level[b] or level[a] == level[b] != 0)
    ]
    chosen = draw(st.lists(st.sampled_from(allowed), max_size=12)) if allowed else []
    return PocGraph.from_implications(sensors, chosen)


def subsets(graph: PocGraph) -> st.SearchStrategy[set[int]]:
    """Draw a set of the graph's literals."""
    if not len(graph):
        return st.just(set())
    return st.sets(st.integers(0, len(graph) - 1))


def as_set(literals: NDArray[Any]) -> set[int]:
    """Return a bool array as the set of its literals."""
    return set(literals.nonzero()[0].tolist())


# Readings of several sensors as a whole -----------------------------------------------


@st.composite
def tables(
    draw: st.DrawFn, most: int = 4, longest: int = 300, unknown: bool = True
) -> NDArray[np.float64]:
    """Draw ``(T, N)``: 0, 1 or NaN, in runs and often alike, as sensors are."""
    sensors, ticks = draw(st.integers(1, most)), draw(st.integers(0, longest))
    chance = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    table = np.zeros((ticks, sensors))
    for sensor in range(sensors):
        changes = chance.random(ticks) < draw(st.sampled_from([0.02, 0.3, 1.0]))
        levels = chance.choice([0.0, 1.0], ticks)
        if sensor and draw(st.booleans()):  # like the one before, but now and then
            differs = chance.random(ticks) < draw(st.sampled_from([0.0, 0.01, 0.2]))
            table[:, sensor] = np.where(differs, levels, table[:, sensor - 1])
        else:
            last = np.maximum.accumulate(np.where(changes, np.arange(ticks), 0))
            table[:, sensor] = levels[last] if ticks else levels
        if unknown and draw(st.booleans()):
            missing = chance.random(ticks) < draw(st.sampled_from([0.01, 0.5, 0.99]))
            table[missing, sensor] = np.nan
    return table
