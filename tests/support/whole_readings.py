"""Readings of several sensors as a whole, with long runs and unknown stretches."""

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

LEVELS = {-1: np.nan, 0: 0.0, 1: 1.0}


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
