"""A world that ends or hangs after some ticks."""

import sys
from pathlib import Path

import gymnasium
import pytest

from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.fit_agent import body_of
from neurosnap.sources.open import open_source


def ending_world(folder: Path, monkeypatch: pytest.MonkeyPatch, end: str) -> RunOptions:
    """Return a run whose world does as `end` says, a statement, after tick 6."""
    (folder / "ending.py").write_text(f"""
import threading

import gymnasium
import numpy as np


class Ending(gymnasium.Env):
    observation_space = gymnasium.spaces.MultiBinary(3)
    action_space = gymnasium.spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.steps = 0
        return np.zeros(3, np.int8), {{}}

    def step(self, action):
        self.steps += 1
        if self.steps > 5:
            {end}
        return np.array([self.steps % 2, 0, 1], np.int8), 0.0, False, False, {{}}


gymnasium.register("test/Ending-v0", Ending, disable_env_checker=True)
""")
    monkeypatch.syspath_prepend(folder)
    # Another test's may be known by that name.
    monkeypatch.delitem(sys.modules, "ending", raising=False)
    gymnasium.registry.pop("test/Ending-v0", None)
    name = "ending:test/Ending-v0"
    source = open_source(name, 1)
    source.close()
    return RunOptions(source=name, body=body_of(source, "walker"), ticks=50)


SILENT = r"^coordinator: world: must answer the decision of tick 6 within 3 s, got no"
