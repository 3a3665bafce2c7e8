"""Where observations come from: Gymnasium, a CSV file of readings, or from outside.

What a source gives after k steps is a function of its name, the seed and the actions,
and of nothing else; but for live sources, which cannot be brought back to where they
were. Whatever can be checked beforehand is checked by `open_source`: a
file with a bad row 900 is refused before anything is started, not at tick 900.
"""

import difflib
import importlib
import logging
import os
import warnings
from collections.abc import Mapping
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Protocol, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.wrappers import Autoreset
from numpy.typing import ArrayLike, NDArray

from neurosnap.agent.environment import describe
from neurosnap.errors import InvalidValueError, within
from neurosnap.sensorium import Sensorium, visible
from neurosnap.sources.csv_source import CsvSource
from neurosnap.sources.live.open import Argument as Argument
from neurosnap.sources.live.open import is_outside, open_outside
from neurosnap.sources.live.zenoh_source import Hub

WORLDS = "neurosnap.worlds"
"""The entry-point group of modules that register environments when imported."""

_logger = logging.getLogger(__name__)


class Source(Protocol):
    """A sequence of observations, which actions may influence."""

    sensors: tuple[str, ...]
    """The sensors' names, in the order of the observations."""
    orders: tuple[int, ...]
    """For each, how many steps it looks back; 0: a state sensor."""
    actions: tuple[str, ...]
    """The names of the atomic actions; none: it takes none."""
    exclusive: bool
    """Exactly one of them is taken at each step."""
    length: int | None
    """Observations it has in all, the first included; None: no end is known."""
    begins: bool
    """The last observation begins a trajectory: it follows no action."""
    known: NDArray[np.bool_] | None
    """``(N,)``, which readings of the last observation are known, one at least; what
    the others are means nothing. None: all are known."""
    live: bool
    """It observes what goes on by itself: it takes its time, and never starts over. In
    a run that is resumed its first call is a `step`."""

    def first(self) -> NDArray[np.bool_] | None:
        """Start, or start over, and return the first observation: ``(N,)``.

        None: it is over already. A live source may make its caller wait.
        """

    def step(self, action: int) -> NDArray[np.bool_] | None:
        """Return the observation that follows a choice; None: it is over, for good.

        Choices count from 0: where actions exclude each other, a choice is an action;
        otherwise its bits say which are taken. A live source may make its caller wait.
        """

    def close(self) -> None:
        """Give up what it holds; may be called twice.

        With a live source it may be called from any thread: whoever waits in `first` or
        `step` gets None.
        """


def open_source(
    name: str,
    seed: int,
    arguments: Mapping[str, Argument] | None = None,
    hub: Hub | None = None,
) -> Source:
    """Return the source called `name`.

    Args:
        name: The path of a CSV file (it ends with ``.csv``, or the file exists), or the
            id of a Gymnasium environment, ``module:Id`` to import a module first; or
            one that is outside, as `neurosnap.sources.live.open` has it.
        seed: For the environment's reset, from 0 up; a file does not use it.
        arguments: The environment's own; a file takes none.
        hub: The swarm's, for whoever is about to be its world.

    Raises:
        InvalidValueError: There is no such source, it does not take such arguments, or
            it is not fit for use; for a file the text names the row and the column.
    """
    opened = _opened(name, seed, arguments, hub)
    # Not refused by `Sensorium`: there may be recordings with such names.
    for called in (*opened.sensors, *opened.actions):
        if visible(called) != called:
            opened.close()
            rule = "must have no letters that hide, or turn the text around"
            raise InvalidValueError("name", rule, called)
    return opened


def _opened(
    name: str, seed: int, arguments: Mapping[str, Argument] | None, hub: Hub | None
) -> Source:
    if seed < 0:
        raise InvalidValueError("seed", "must be 0 or more", seed)
    arguments = {} if arguments is None else arguments
    if is_outside(name):
        return open_outside(name, arguments, hub)
    if name.lower().endswith(".csv") or _is_file(name):
        if arguments:
            rule = "must not be given for a file"
            raise InvalidValueError("arguments", rule, dict(arguments))
        return CsvSource(name)
    return GymnasiumSource(name, seed, arguments)


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

    Raises:
        InvalidValueError: There is no such environment, or it does not take such
            arguments, or it has other spaces, or its names are no names.
    """

    known: NDArray[np.bool_] | None = None
    live: bool = False

    def __init__(
        self, name: str, seed: int, arguments: Mapping[str, Argument] | None = None
    ) -> None:
        self._name = name
        self._seed = seed
        self._env = Continuing(_make(name, {} if arguments is None else arguments))
        try:
            self._said = describe(name, self._env)
        except Exception:  # whatever it is, it goes on, and the environment is closed
            self._env.close()
            raise
        self._sensorium = Sensorium(self._said.sensors)
        self.sensors: tuple[str, ...] = self._said.sensors
        self.orders: tuple[int, ...] = self._said.orders
        self.actions: tuple[str, ...] = self._said.actions
        self.exclusive: bool = self._said.exclusive
        self.length: int | None = None
        self.begins: bool = False

    def first(self) -> NDArray[np.bool_]:
        """Reset the environment with the seed and return the first observation.

        Raises:
            InvalidValueError: The observation is not in the observation space.
        """
        observation, info = self._env.reset(seed=self._seed)
        self.begins = info["begins"]
        return self._checked(observation)

    def step(self, action: int) -> NDArray[np.bool_]:
        """Take `action` and return what follows; after an episode's end, begin another.

        Raises:
            InvalidValueError: There is no such action, or the observation is not in the
                observation space.
        """
        chosen = self._said.step(action)
        observation, *_, info = self._env.step(chosen)
        self.begins = info["begins"]
        return self._checked(observation)

    def close(self) -> None:
        """Close the environment."""
        self._env.close()

    def _checked(self, observation: ArrayLike) -> NDArray[np.bool_]:
        """Return a copy, since an environment may use its buffer again."""
        try:
            return self._sensorium.observation(observation).copy()
        except InvalidValueError as error:
            raise within(self._name, error) from error


class Continuing(Autoreset):
    """An environment that goes on: the step after an episode's end begins the next.

    As in `gymnasium.wrappers.Autoreset`: that step resets, whatever the action is, with
    reward 0.0. But no end is ever reported. An action that is ignored is no action:
    what is observed then is no consequence of it, and whoever learns from actions has
    to know.

    Info says `begins`: whether the observation is a reset's, the caller's or its own,
    or of one the environment says so of; and `episode`, counted from 0 since the last
    reset by the caller.

    Args:
        env: Whose episodes are to follow each other.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._episode = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and count its episodes from 0."""
        self._episode = 0
        observation, info = super().reset(seed=seed, options=options)
        return observation, {**info, "episode": self._episode, "begins": True}

    def step(
        self,
        action: Any,  # noqa: ANN401 - the environment knows
    ) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the environment, or reset it if its episode is over."""
        resets = self.autoreset
        self._episode += resets
        observation, reward, _, _, info = super().step(action)
        begins = bool(resets or info.get("begins", False))
        told = {**info, "episode": self._episode, "begins": begins}
        return observation, reward, False, False, told


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except OSError:  # too long for a path, for one
        return False


def _make(name: str, arguments: Mapping[str, Argument]) -> gymnasium.Env[Any, Any]:
    """Return the environment called `name`, wrapped as Gymnasium wraps it.

    Without its passive checker: that only warns, and what matters here is checked here.
    """
    with warnings.catch_warnings():
        # Advice to whoever develops the environment; here it would be noise, and fatal
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
            # The only way Gymnasium tells of an argument that an environment lacks.
            if not arguments or "argument" not in str(error):
                raise
            rule = f"must be ones that {name} takes"
            raise InvalidValueError("arguments", rule, dict(arguments)) from error


def import_worlds() -> None:
    """Import the modules that installed packages name under `WORLDS`."""
    for entry in entry_points(group=WORLDS):
        try:
            entry.load()
        except Exception:
            # A broken package must not keep the others from being used.
            _logger.exception("%s: cannot be imported", entry.value)


def _import(module: str, name: str) -> None:
    if not all(part.isidentifier() for part in module.split(".")):
        raise InvalidValueError("source", "must have a module before its colon", name)
    importlib.import_module(module)


def _unknown(name: str, identifier: str) -> InvalidValueError:
    ours = sorted(
        known for known in gymnasium.registry if known.startswith("neurosnap/")
    )
    likely = difflib.get_close_matches(identifier, ours) or ours
    rule = "must be a registered environment id or a CSV file"
    if os.path.isdir(name):  # noqa: PTH112 - the path's own raises for a long name
        rule = f"{rule}, not a folder"
    elif likely:
        rule = f"{rule} (did you mean {' or '.join(likely)}?)"
    return InvalidValueError("source", rule, name)
