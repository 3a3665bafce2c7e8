"""A world of your own: a tank that is filled, drained and heated, with binary sensors.

Try it: ``PYTHONPATH=examples neurosnap run tank:Tank-v0``.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiDiscrete
from numpy.typing import NDArray

from neurosnap import BinarySensors
from neurosnap.agent.sensor import thresholds

FULL, HOT = 6, 4
ACTIONS = ("fill", "drain", "heat", "wait")

Reading = NDArray[np.int64]


class Tank(gymnasium.Env[Reading, int]):
    """A tank. Cold water cools it, and heating needs a heater that is under water."""

    def __init__(self) -> None:
        self.observation_space = MultiDiscrete([FULL + 1, HOT + 1])
        self.action_space = Discrete(len(ACTIONS))
        self.level = self.warmth = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Reading, dict[str, Any]]:
        """Empty it."""
        super().reset(seed=seed)
        self.level = self.warmth = 0
        return self._reading(), {}

    def step(self, action: int) -> tuple[Reading, float, bool, bool, dict[str, Any]]:
        """Do one thing."""
        match ACTIONS[action]:
            case "fill" if self.level < FULL:
                self.level += 1
                self.warmth = max(0, self.warmth - 1)
            case "drain":
                self.level = max(0, self.level - 1)
            case "heat" if self.level >= 2:
                self.warmth = min(HOT, self.warmth + 1)
        return self._reading(), 0.0, False, False, {}

    def _reading(self) -> Reading:
        return np.array([self.level, self.warmth])


def level(reading: Reading) -> int:
    """Return how full the tank is."""
    return int(reading[0])


def warmth(reading: Reading) -> int:
    """Return how warm the water is."""
    return int(reading[1])


def tank() -> BinarySensors:
    """Return the tank with its sensors: ``level<1``, ``level<2``, ... ``warmth<4``."""
    sensors = [
        *thresholds("level", range(1, FULL + 1), of=level),
        *thresholds("warmth", range(1, HOT + 1), of=warmth),
    ]
    return BinarySensors(Tank(), sensors, actions=ACTIONS)


gymnasium.register(id="Tank-v0", entry_point=f"{__name__}:tank")
