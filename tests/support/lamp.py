"""A world of eight states in which two sensations together say what an action does."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray

from neurosnap.agent.growth.birth import Birth
from neurosnap.protocol.run_options import RunOptions
from tests.support import run_options

NAME = "tests.support.lamp:Lamp-v0"
LIMITED = "tests.support.lamp:LimitedLamp-v0"
"""Its episodes are cut off after eight steps, and never end."""
BIRTH, GROWN = 22, "press&a&b"
"""What `lamp_options` grow, and the tick whose decision says so."""


class Lamp(gymnasium.Env[Any, Any]):
    """A lamp and two switches: to press it lights it if both are on, else puts it out.

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
        super().reset(seed=seed)
        self._on = [0, 0, 0]
        return np.array(self._on, np.int8), {}

    def step(
        self, action: Any
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        if action == self.actions.index("press"):
            self._on[2] = self._on[0] & self._on[1]
        else:
            self._on[action] ^= 1
        return np.array(self._on, np.int8), 0.0, False, False, {}


gymnasium.register("Lamp-v0", f"{__name__}:Lamp")
gymnasium.register("LimitedLamp-v0", f"{__name__}:Lamp", max_episode_steps=8)


def lamp_options(name: str = NAME, /, **more: object) -> RunOptions:
    """Return a run of an agent that explores the lamp and grows what it takes."""
    given: dict[str, Any] = {
        "grow": 3,
        "imagine": 8,
        "target": (),
        "explore": 0.4,
        "threshold": 0.001,
        "keyframe_every": 10,
    }
    return run_options.options_for(name, 3, agent="planner", **{**given, **more})


BIRTHS = (
    Birth("turn_a", ("a", "b*")),
    Birth("press", ("b", "a"), 12),
    Birth("press", ("a*", "lit"), 12),
)


def scripted_births(**more: object) -> RunOptions:
    """Return a run of the lamp in which sensors are grown by a script."""
    return lamp_options(**{"ticks": 30, "births": BIRTHS, "grow": 0, **more})
