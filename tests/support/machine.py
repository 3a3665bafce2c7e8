"""A small machine whose sensors say much of each other, step by step."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.health.level_evidence import Levels

SENSORS = ("told", "motor", "belt", "flow", "valve", "hot")
TOLD, MOTOR, BELT, FLOW, VALVE, HOT = range(6)
Floats = NDArray[np.float64]


def machine(steps: int, seed: int) -> Floats:
    """Return the level of each sensor, ``(steps, 6)``.

    The motor obeys within two steps and the belt moves with it, but for a step in a
    hundred; the flow goes with the valve, a step late; it is hot now and then.
    """
    rng = np.random.default_rng(seed)
    told, valve = (_spells(steps, mean, rng) for mean in (12, 30))
    motor = _late(told, 2)
    belt = np.where(rng.random(steps) < 0.01, rng.random(steps), motor)
    flow, hot = _late(valve, 1), _spells(steps, 40, rng) * 0.5
    return np.column_stack([told, motor, belt, flow, valve, hot])


def levels(on: Floats) -> Levels:
    """Return levels that are known all the time."""
    return Levels(np.ascontiguousarray(on), np.ones_like(on))


def _spells(steps: int, mean: float, rng: np.random.Generator) -> Floats:
    turns = rng.random(steps) < 1 / mean
    return (np.cumsum(turns) % 2).astype(float)


def _late(level: Floats, by: int) -> Floats:
    return np.concatenate([np.zeros(by), level[:-by]])
