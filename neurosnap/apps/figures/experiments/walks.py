"""The four settings of the paper, and random walks through them.

A walk is a function of the seed, the setting and the number of the run. All learners
are shown the same walks, so what differs between them is not luck.
"""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from threading import Lock
from typing import Protocol, cast

import gymnasium
import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments import kernels, truth
from neurosnap.errors import InvalidValueError
from neurosnap.sources.gymnasium_source import import_worlds

_DRAWING = Lock()


class Setting(msgspec.Struct, frozen=True):
    """One of the paper's environments ([GK] settings (a) to (d))."""

    name: str
    """What it is called in the data."""
    letter: str
    """What the paper calls it."""
    world: str
    """The environment's id."""


SETTINGS = (
    Setting("path", "a", "neurosnap/Path-v0"),
    Setting("cycle", "b", "neurosnap/Cycle-v0"),
    Setting("grid", "c", "neurosnap/Grid-v0"),
    Setting("random", "d", "neurosnap/RandomFields-v0"),
)
"""Each has 20 sensors. Their order goes into the seed of every walk: add last."""


class _World(Protocol):
    """What a setting's environment tells beyond Gymnasium's interface."""

    fields: NDArray[np.bool_]
    moves: NDArray[np.intp]


@dataclass(frozen=True)
class Walk:
    """A walk, and the world it went through.

    Args:
        fields: ``(N, places)`` bool; where each sensor is on.
        moves: ``(actions, places)``; where an action leads from a place.
        places: ``(steps,)``; where the walk is at each observation.
    """

    fields: NDArray[np.bool_]
    moves: NDArray[np.intp]
    places: NDArray[np.intp]

    @cached_property
    def views(self) -> NDArray[np.uint8]:
        """``(places, N)``, 0 or 1: the observation at each place."""
        return np.ascontiguousarray(self.fields.T).view(np.uint8)

    @cached_property
    def law(self) -> NDArray[np.float64]:
        """``(places,)``: the walk's stationary law."""
        return truth.stationary(self.moves, int(self.places[0]))

    @cached_property
    def contained(self) -> NDArray[np.uint8]:
        """``(N (N - 1) / 2,)``: the codes of the true containments."""
        return truth.contained(self.fields)


def setting(name: str) -> Setting:
    """Return the setting of that name.

    Raises:
        InvalidValueError: There is none.
    """
    for each in SETTINGS:
        if each.name == name:
            return each
    rule = f"must be one of {', '.join(each.name for each in SETTINGS)}"
    raise InvalidValueError("setting", rule, name)


def walks(name: str, seed: int, runs: int, steps: int) -> tuple[Walk, ...]:
    """Return the walks of a setting; any thread may ask, one draws.

    Args:
        name: The setting's.
        seed: From 0 up; with the setting and the run it says all.
        runs: How many, at least 1; the first of more walks are the same walks.
        steps: Observations in each, at least 1: the first at a place drawn uniformly,
            the one at ``t`` after ``t - 1`` moves drawn uniformly.

    Raises:
        InvalidValueError: There is no such setting.
    """
    with _DRAWING:  # the cache alone would let two threads draw the same
        return _drawn(name, seed, runs, steps)


@lru_cache(maxsize=len(SETTINGS))
def _drawn(name: str, seed: int, runs: int, steps: int) -> tuple[Walk, ...]:
    chosen = setting(name)
    import_worlds()
    env = gymnasium.make(chosen.world).unwrapped
    try:
        return tuple(_draw(env, chosen, seed, run, steps) for run in range(runs))
    finally:
        env.close()


def _draw(
    env: gymnasium.Env[object, object],
    chosen: Setting,
    seed: int,
    run: int,
    steps: int,
) -> Walk:
    """Return one walk: world and moves have a stream of random numbers each."""
    key = (SETTINGS.index(chosen), run)
    of_world, of_moves = np.random.SeedSequence(seed, spawn_key=key).spawn(2)
    _, info = env.reset(seed=int(of_world.generate_state(1)[0]))
    world = cast("_World", env)
    draws = np.random.default_rng(of_moves).integers(len(world.moves), size=steps - 1)
    places = kernels.follow(world.moves, info["place"], draws)
    return Walk(world.fields, world.moves, places)
