"""A Gymnasium environment as a source of observations."""

import functools
import importlib
import logging
import os
import warnings
from collections.abc import Mapping
from importlib.metadata import entry_points
from typing import Any

import gymnasium
from numpy.typing import ArrayLike

from neurosnap.agent.environment import Continuing, describe
from neurosnap.errors import InvalidValueError, similar, within
from neurosnap.sensorium import Sensorium
from neurosnap.sources.protocol import Argument, Observed

WORLDS = "neurosnap.worlds"
"""The entry-point group of modules that register environments when imported."""
_MODE = "rgb_array"
_DRAWS = f"must go with an environment that has the render mode {_MODE}"
_logger = logging.getLogger(__name__)


class GymnasiumSource:
    """The observations of an environment.

    What they are is told by `neurosnap.agent.environment`; choices count from 0 here
    even where the space starts elsewhere. They go on from episode to episode: the
    observation that comes with an episode's end is given out, and the next step begins
    another episode, whatever the action is.

    Args:
        name: The environment's id.
        seed: For its reset.
        arguments: Its own.
        renders: Whether `render` will be called. Then it is made with the render mode
            ``rgb_array``.

    Raises:
        InvalidValueError: There is no such environment, or it does not take such
            arguments, or it has other spaces, or its names are no names, or it has no
            such render mode.
    """

    live: bool = False

    def __init__(
        self,
        name: str,
        seed: int,
        arguments: Mapping[str, Argument] | None = None,
        renders: bool = False,
    ) -> None:
        self._name = name
        self._seed = seed
        given = {} if arguments is None else arguments
        made = _rendering(name, given) if renders else _make(name, given)
        self._env = Continuing(made)
        try:
            self._said = describe(name, self._env)
        except Exception:  # whatever it is, it goes on, and the environment is closed
            self._env.close()
            raise
        self._sensorium = Sensorium(self._said.sensors)
        self.sensors: tuple[str, ...] = self._said.sensors
        self.orders: tuple[int, ...] = self._said.orders
        self.actions: tuple[str, ...] = self._said.actions
        self.discrete: bool = self._said.discrete
        self.length: int | None = None

    def first(self) -> Observed:
        """Reset the environment with the seed and return the first observation.

        Raises:
            InvalidValueError: The observation is not in the observation space.
        """
        observation, info = self._env.reset(seed=self._seed)
        return self._observed(observation, info)

    def step(self, action: int) -> Observed:
        """Take `action` and return what follows; after an episode's end, begin another.

        Raises:
            InvalidValueError: There is no such action, or the observation is not in the
                observation space.
        """
        chosen = self._said.step(action)
        observation, *_, info = self._env.step(chosen)
        return self._observed(observation, info)

    def render(self) -> Any:  # noqa: ANN401 - the environment knows
        """Return what the environment draws of itself, once it was reset."""
        return self._env.render()

    def close(self) -> None:
        """Close the environment."""
        self._env.close()

    def _observed(self, observation: ArrayLike, info: Mapping[str, Any]) -> Observed:
        """Check an observation and copy it: an environment may use its buffer again."""
        try:
            bits = self._sensorium.observation(observation).copy()
        except InvalidValueError as error:
            raise within(self._name, error) from error
        return Observed(bits, begins=info["begins"], cut=info["cut"])


def _make(name: str, arguments: Mapping[str, Argument]) -> gymnasium.Env[Any, Any]:
    """Return the environment called `name`, wrapped as Gymnasium wraps it.

    Without its passive checker: that only warns, and what matters here is checked here.
    """
    with warnings.catch_warnings():
        # Advice to developers of the environment; here it would be noise, and fatal
        # where warnings are errors.
        warnings.simplefilter("ignore")
        import_worlds()
        module, _, identifier = name.rpartition(":")
        try:
            if ":" in name:
                _import(module, name)
            given: dict[str, Any] = dict(arguments)
            return gymnasium.make(identifier, disable_env_checker=True, **given)
        except (ImportError, gymnasium.error.DependencyNotInstalled) as error:
            rule = f"must be an environment that can be imported ({error})"
            raise InvalidValueError("source", rule, name) from error
        except gymnasium.error.Error as error:
            raise _unknown(name, identifier) from error
        except TypeError as error:
            # The only way Gymnasium names an argument that one lacks, or needs.
            if "argument" not in str(error) or not (
                arguments or "missing" in str(error)
            ):
                raise
            told, *_ = str(error).split(" was raised")
            rule = f"must be ones that {name} takes, and all that it needs: {told}"
            raise InvalidValueError("arguments", rule, dict(arguments)) from error


def _rendering(name: str, arguments: Mapping[str, Argument]) -> gymnasium.Env[Any, Any]:
    """Return the environment called `name`, which draws itself as arrays."""
    if "render_mode" in arguments:
        rule = "must not have render_mode where frames are recorded"
        raise InvalidValueError("arguments", rule, arguments["render_mode"])
    # pygame says hello on standard output, and looks for a screen.
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
    os.environ.setdefault("SDL_AUDIODRIVER", "dummy")
    try:
        env = _make(name, {**arguments, "render_mode": _MODE})
    except (InvalidValueError, TypeError) as error:
        if "render_mode" not in str(error):
            raise
        raise InvalidValueError("frames", _DRAWS, name) from error
    if env.render_mode != _MODE:
        env.close()
        raise InvalidValueError("frames", _DRAWS, name)
    return env


@functools.cache  # to look for them takes 8 ms
def import_worlds() -> None:
    """Import the modules that installed packages name under `WORLDS`."""
    for entry in entry_points(group=WORLDS):
        try:
            entry.load()
        except Exception:  # a broken package must not keep the others from being used
            _logger.exception("%s: cannot be imported", entry.value)


def _import(module: str, name: str) -> None:
    if not all(part.isidentifier() for part in module.split(".")):
        raise InvalidValueError("source", "must have a module before its colon", name)
    importlib.import_module(module)


def _unknown(name: str, identifier: str) -> InvalidValueError:
    ours = sorted(
        known for known in gymnasium.registry if known.startswith("neurosnap/")
    )
    rule = "must be a registered environment id or a CSV file"
    if os.path.isdir(name):  # noqa: PTH112 - the path's own raises for a long name
        rule = f"{rule}, not a folder"
    else:
        rule += similar(identifier, ours) or f" (such as {', '.join(ours)})"
    return InvalidValueError("source", rule, name)
