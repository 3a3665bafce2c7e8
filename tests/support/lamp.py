"""Runs of the lamp world, where two sensors together determine an action's effect."""

from typing import Any

import gymnasium

from neurosnap.protocol.run_options import RunOptions
from tests.support import run_options
from tools.simulate.lamp import NAME

LIMITED = "tests.support.lamp:LimitedLamp-v0"
"""Its episodes are cut off after eight steps, and never end."""
BIRTH, GROWN = 22, "press&a&b"
"""What `lamp_options` grow, and the tick whose decision says so."""


gymnasium.register("LimitedLamp-v0", "tools.simulate.lamp:Lamp", max_episode_steps=8)


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
