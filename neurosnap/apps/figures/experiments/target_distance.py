"""Excitation-driven agents: distance from the target at every step.

Every agent starts with an empty snapshot, at a place and with a target drawn for its
run. Start, target, fields and random numbers are functions of the seed, the setting and
the run, so both snapshots face the same tasks with the same luck.
"""

from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.random_numbers import RandomNumbers
from neurosnap.apps.figures.experiments.compiled_agent import drive
from neurosnap.apps.figures.experiments.entry import key_of
from neurosnap.apps.figures.experiments.per_step import PerStepEntry
from neurosnap.apps.figures.experiments.walks import SETTINGS, setting
from neurosnap.sources.gymnasium_source import import_worlds

_VERSION = 2
"""Raised whenever the same options come to give other distances."""


@dataclass(frozen=True)
class Task:
    """A world, a place to start from and one to get to."""

    moves: NDArray[np.intp]
    """``(actions, places)``; where an action leads."""
    fields: NDArray[np.bool_]
    """``(N, places)``; where each sensor is on."""
    distances: NDArray[np.float64]
    """``(places,)``; how far each place is from the target, in actions."""
    start: int
    seed: int
    """Of the agent."""
    reset: int
    """What the environment was reset with."""


class TargetEntry(PerStepEntry, frozen=True, kw_only=True):
    """An excitation-driven agent in a setting; its runs are one entry of the table."""

    setting: str
    """The setting's name."""
    threshold: float
    """``tau`` of every pair."""
    decay: float | None
    """``q`` of a discounted snapshot; None: it is empirical."""
    explore: float
    """The share of random actions where nothing better than `worse*` is guaranteed."""
    target: int | None
    """The place to get to; None: one is drawn for every run."""

    @property
    def name(self) -> str:
        """What people see of it in a listing of files."""
        kind = "empirical" if self.decay is None else "discounted"
        to = "" if self.target is None else f"-to-{self.target}"
        return f"excited-{kind}-{self.setting}{to}"

    @property
    def key(self) -> str:
        """All that its rows depend on, as JSON."""
        return key_of(self, "excited", _VERSION)

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return the distance to the target at each observation of a run."""
        todo = task(self.setting, self.seed, run, self.target)
        distance, _, _ = drive(
            todo.moves,
            todo.fields.view(np.uint8),
            todo.distances,
            todo.start,
            self.threshold,
            -1.0 if self.decay is None else self.decay,
            self.explore,
            RandomNumbers(todo.seed).table(self.steps + 1),
        )
        return distance.astype(np.uint16)


def task(name: str, seed: int, run: int, target: int | None = None) -> Task:
    """Return what an agent is to do in one run of a setting.

    Args:
        name: The setting's.
        seed: From 0 up.
        run: From 0 up.
        target: The place to get to; None: one is drawn.
    """
    chosen = setting(name)
    key = (SETTINGS.index(chosen), run, 1)  # not the streams of the random walks
    reset, agent = np.random.SeedSequence(seed, spawn_key=key).generate_state(2)
    import_worlds()
    env: gymnasium.Env[Any, Any] = gymnasium.make(
        chosen.world, target="drawn" if target is None else target
    )
    try:
        _, info = env.reset(seed=int(reset))
        return Task(
            moves=env.get_wrapper_attr("moves"),
            fields=env.get_wrapper_attr("fields"),
            distances=env.get_wrapper_attr("distances"),
            start=info["place"],
            seed=int(agent),
            reset=int(reset),
        )
    finally:
        env.close()


def guaranteed(todo: Task) -> float:
    """Return at what share of the places but the target the truth guarantees better.

    That is where some sensation ``a`` of the place and some action lead nearer to the
    target from *every* place at which ``a`` holds ([GK] "Closing the Loop": what has to
    be verified for the true poc set). Where there is none, no agent that knows the
    truth, and nothing but the truth, has anything to go by.
    """
    literals = np.concatenate([todo.fields, ~todo.fields])
    nearer = todo.distances[todo.moves] < todo.distances
    # (actions, literals): no place has the literal and is not brought nearer.
    sound = ~(~nearer[:, np.newaxis] & literals[np.newaxis]).any(axis=2)
    helped = (sound.any(axis=0)[:, np.newaxis] & literals).any(axis=0)
    away = todo.distances > 0
    return float(helped[away].mean())
