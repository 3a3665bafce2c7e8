"""An eight-state world: two sensors together determine an action's effect."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray

NAME = "tools.simulate.lamp:Lamp-v0"


class Lamp(gymnasium.Env[Any, Any]):
    """A lamp with two switches: a press lights it if both are on, and else puts it out.

    Actions 0 and 1 turn the switches, action 2 presses.
    """

    sensors = ("a", "b", "lit")
    actions = ("turn_a", "turn_b", "press")

    def __init__(self) -> None:
        self.observation_space = MultiBinary(3)
        self.action_space = Discrete(3)
        self._on = [0, 0, 0]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Put all out."""
        super().reset(seed=seed)
        self._on = [0, 0, 0]
        return np.array(self._on, np.int8), {}

    def step(
        self, action: int
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        """Turn a switch, or press; no episode ends."""
        if action == self.actions.index("press"):
            self._on[2] = self._on[0] & self._on[1]
        else:
            self._on[action] ^= 1
        return np.array(self._on, np.int8), 0.0, False, False, {}


gymnasium.register("Lamp-v0", f"{__name__}:Lamp")
