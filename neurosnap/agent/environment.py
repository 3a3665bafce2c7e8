"""A Gymnasium environment: its sensors and actions, and an agent acting in it.

The observation space must be a flat ``MultiBinary``, the action space ``Discrete``.
Names are the attributes `sensors` and `actions`, of the environment or of a wrapper
around it; `orders` says how many steps a sensor looks back.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, Tuple
from gymnasium.wrappers import Autoreset

from neurosnap.errors import InvalidValueError, within
from neurosnap.sensorium import Sensorium


@dataclass(frozen=True)
class Description:
    """The sensors and actions of an environment."""

    sensors: tuple[str, ...]
    """The sensors' names; ``s0``, ``s1``, and so on where it has none for them."""
    orders: tuple[int, ...]
    """For each, how many steps it looks back; 0 where it does not say."""
    actions: tuple[str, ...]
    """The actions' names; ``action_0`` and so on where it has none."""
    start: int
    """The number the environment has for its first action."""
    discrete: bool
    """Whether what it shows is discrete before any wrapper changes it."""

    def step(self, action: int) -> int:
        """Return what to step the environment with for an action counted from 0.

        Raises:
            InvalidValueError: There is no such action.
        """
        if not 0 <= action < len(self.actions):
            rule = f"must be a whole number in 0..{len(self.actions) - 1}"
            raise InvalidValueError("action", rule, action)
        return self.start + action


def describe(name: str, env: gymnasium.Env[Any, Any]) -> Description:
    """Return what `env` says of itself.

    Args:
        name: What to call it in an error.
        env: Any environment; it is neither reset nor stepped.

    Raises:
        InvalidValueError: It has other spaces, or its names are no names.
    """
    sensors = _sensors(name, env)
    space = env.action_space
    if not isinstance(space, Discrete):
        raise InvalidValueError(f"{name}: action space", "must be Discrete", space)
    return Description(
        sensors=sensors,
        orders=_orders(name, env, len(sensors)),
        actions=_actions(name, env, int(space.n)),
        start=int(space.start),
        discrete=_is_discrete(env.unwrapped.observation_space),
    )


def _is_discrete(space: gymnasium.Space[Any]) -> bool:
    """Return whether no number in a space is a real one."""
    match space:
        case Box():
            return not np.issubdtype(space.dtype, np.floating)
        case Dict():
            return all(map(_is_discrete, space.values()))
        case Tuple():
            return all(map(_is_discrete, space))
        case _:
            return True


def _sensors(name: str, env: gymnasium.Env[Any, Any]) -> tuple[str, ...]:
    space = env.observation_space
    if not isinstance(space, MultiBinary) or len(space.shape) != 1:
        rule = (
            "must be MultiBinary with one axis (wrap the environment in "
            "neurosnap.BinarySensors, which makes sensors of what it shows"
            f"{_ready(env)})"
        )
        raise InvalidValueError(f"{name}: observation space", rule, space)
    count = space.shape[0]
    names = attribute(env, "sensors")
    if names is None:
        return Sensorium.of(count).names
    if not isinstance(names, Sequence) or len(names) != count:
        rule = f"must be a sequence of {count} names"
        raise InvalidValueError(f"{name}: sensors", rule, names)
    return _checked(name, names)


def _ready(env: gymnasium.Env[Any, Any]) -> str:
    """Return the advice to take the same environment with sensors, if there is one."""
    known = env.spec.name if env.spec else ""
    ours = [id_ for id_ in gymnasium.registry if id_.startswith(f"neurosnap/{known}-v")]
    return f"; or take {ours[-1]}" if ours else ""


def _actions(name: str, env: gymnasium.Env[Any, Any], count: int) -> tuple[str, ...]:
    names = attribute(env, "actions")
    # Other people's environments have attributes of that name that are no names.
    if (
        isinstance(names, Sequence)
        and len(names) == count
        and all(isinstance(one, str) for one in names)
    ):
        return _checked(name, names)
    return tuple(f"action_{number}" for number in range(count))


def _checked(name: str, names: Sequence[str]) -> tuple[str, ...]:
    try:
        return Sensorium(names).names
    except InvalidValueError as error:
        raise within(name, error) from error


def _orders(name: str, env: gymnasium.Env[Any, Any], count: int) -> tuple[int, ...]:
    orders = attribute(env, "orders")
    if orders is None:
        return (0,) * count
    if (
        isinstance(orders, Sequence)
        and len(orders) == count
        and all(type(order) is int and order >= 0 for order in orders)
    ):
        return tuple(orders)
    rule = f"must be {count} whole numbers from 0 up"
    raise InvalidValueError(f"{name}: orders", rule, orders)


def attribute(env: gymnasium.Env[Any, Any], name: str) -> Any:  # noqa: ANN401
    """Return what an environment or a wrapper around it says of itself; else None."""
    return env.get_wrapper_attr(name) if env.has_wrapper_attr(name) else None


class Continuing(Autoreset):
    """An environment that begins its next episode by itself, one step after an end.

    As in `gymnasium.wrappers.Autoreset`: that step resets, whatever the action is, with
    reward 0.0. But no end is ever reported. An action that is ignored is no action:
    what is observed then is no consequence of it, and what learns from actions has to
    know.

    Info says `begins`: whether the observation is a reset's, the caller's or its own,
    or of one the environment says so of; `episode`, counted from 0 since the last reset
    by the caller; and `cut`, whether the episode before was cut off by a limit, and did
    not come to its own end.
    """

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self._episode = 0
        self._cut = False  # the episode that is over

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment and count its episodes from 0."""
        self._episode = 0
        observation, info = super().reset(seed=seed, options=options)
        told = {"episode": self._episode, "begins": True, "cut": False}
        return observation, {**info, **told}

    def step(
        self,
        action: Any,  # noqa: ANN401 - the environment knows
    ) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the environment, or reset it if its episode is over."""
        resets = self.autoreset
        self._episode += resets
        observation, reward, ends, cut, info = super().step(action)
        begins = bool(resets or info.get("begins", False))
        told = {"episode": self._episode, "begins": begins, "cut": resets and self._cut}
        self._cut = bool(cut) and not ends
        return observation, reward, False, False, {**info, **told}


@dataclass(frozen=True, slots=True)
class Outing:
    """The result of an agent's steps in an environment."""

    steps: int
    """Actions taken."""
    episodes: int
    """Episodes begun."""
    reward: float
    """The rewards of all steps, added up."""
    reached: bool
    """Whether the target was sensed, where there is one."""
