"""Describes the world of a run for drawing, if its places are known.

A recording holds what was sensed and not where that was. But a world of places says of
every sensor where it is on, so a place follows from what is read there, wherever no
other place reads the same.

A recording may name any module, and any size. Only environments under ``neurosnap/``
that are registered here are made, and none whose places and sensors would fill the
memory.
"""

import math
from collections import Counter
from typing import Any, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.environment import attribute
from neurosnap.apps.viewer.api import Stage
from neurosnap.errors import MissingExtraError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.sensorium import Sensorium
from neurosnap.sources.gymnasium_source import import_worlds

_KINDS: dict[str, Literal["path", "cycle", "grid"]] = {
    "neurosnap/Path-v0": "path",
    "neurosnap/Cycle-v0": "cycle",
    "neurosnap/Rail-v0": "cycle",
    "neurosnap/Grid-v0": "grid",
    "neurosnap/PuncturedGrid-v0": "grid",
    "neurosnap/RandomFields-v0": "path",
}
_LARGEST = 2**26
"""The most sensors times places."""
_SEEDS = ("layout_seed", "target")
"""Whole numbers among the arguments that are no sizes."""


class Scene:
    """The world of a run, to be drawn; empty if it is none of neurosnap's worlds."""

    def __init__(self, options: RunOptions) -> None:
        self.stage: Stage | None = None
        self._aims: NDArray[np.bool_] | None = None
        self._places: dict[bytes, int] = {}
        self._count = 0
        env = _make(options)
        if env is not None:
            try:
                self._survey(env, options)
            finally:
                env.close()

    def place(self, observed: NDArray[np.bool_]) -> int | None:
        """Return where the sensors read so; None if nowhere, or if not all are known.

        Args:
            observed: ``(2N,)``, the literals of the sensors whose reading is known.
        """
        read, off = observed[: 2 * self._count : 2], observed[1 : 2 * self._count : 2]
        return self._places.get(read.tobytes()) if (read | off).all() else None

    def is_at_target(self, observed: NDArray[np.bool_]) -> bool:
        """Return whether the place that is wanted is known and reads so."""
        place = self.place(observed)
        return place is not None and self._aims is not None and bool(self._aims[place])

    def _survey(self, env: gymnasium.Env[Any, Any], options: RunOptions) -> None:
        names = tuple(attribute(env, "sensors") or ())
        if names != options.body.own:
            return
        fields = np.asarray(attribute(env, "fields"), np.bool_)
        self._count = len(fields)
        if not 0 < self._count <= len(names):
            return
        columns = [column.tobytes() for column in fields.T]
        often = Counter(columns)
        self._places = {c: place for place, c in enumerate(columns) if often[c] == 1}
        self._aims = _aims(env, options, fields)
        self.stage = _stage(env, options, len(columns), self._aims)


def _make(options: RunOptions) -> gymnasium.Env[Any, Any] | None:
    """Return the environment of a run, if it is a world that can be looked at."""
    import_worlds()
    known = options.source.startswith("neurosnap/")
    if not known or options.source not in gymnasium.registry:
        return None
    sizes = (
        value
        for name, value in options.arguments.items()
        if type(value) is int and name not in _SEEDS
    )
    if len(options.body.own) * math.prod(max(1, size) for size in sizes) > _LARGEST:
        return None
    given: dict[str, Any] = dict(options.arguments)
    given.pop("render_mode", None)  # nothing is to be drawn: no window opens
    try:
        env = gymnasium.make(options.source, disable_env_checker=True, **given)
    except (MissingExtraError, ValueError, gymnasium.error.Error, TypeError, KeyError):
        return None  # another machine's or version's, or made up
    env.reset(seed=options.seed)  # some draw their fields, or the target, only then
    if not env.has_wrapper_attr("fields"):
        env.close()
        return None
    return env


def _aims(
    env: gymnasium.Env[Any, Any], options: RunOptions, fields: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which places are wanted: the world's target, or where a planner's is."""
    target = attribute(env, "target")
    if target is not None:
        there: NDArray[np.bool_] = np.arange(fields.shape[1]) == target
        return there
    sensorium = Sensorium(options.sensors)
    wanted = [sensorium.literal(name) for name in options.target]
    if not wanted or max(wanted) >= 2 * len(fields):
        return np.zeros(fields.shape[1], np.bool_)
    held = [fields[literal >> 1] ^ bool(literal & 1) for literal in wanted]
    everywhere: NDArray[np.bool_] = np.all(held, axis=0)
    return everywhere


def _stage(
    env: gymnasium.Env[Any, Any],
    options: RunOptions,
    places: int,
    aims: NDArray[np.bool_],
) -> Stage | None:
    kind = _KINDS.get(options.source)
    if kind is None:
        return None
    there = attribute(env, "coordinates")
    if there is None:
        there = np.stack([np.arange(places), np.zeros(places, np.int64)], axis=1)
    width, height = (np.max(there, axis=0) + 1).tolist()
    return Stage(
        kind=kind,
        places=places,
        coordinates=[(x, y) for x, y in np.asarray(there).tolist()],
        width=width,
        height=height,
        target=int(aims.argmax()) if aims.sum() == 1 else None,
        moves=np.asarray(attribute(env, "moves")).tolist(),
    )
