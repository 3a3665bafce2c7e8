"""Any Gymnasium environment, seen through binary sensors.

`BinarySensors` gives what `Sensor` predicates read along the trajectory instead of the
environment's own observation. Where episodes follow each other
(`Continuing`), every one of them is a trajectory of its own, whichever of the two
wrappers is around the other.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import Any, SupportsFloat, TypeAlias

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiBinary
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from neurosnap.agent.sensor import Sensor, Trajectory
from neurosnap.errors import InvalidValueError, ShapeError

Environment: TypeAlias = gymnasium.Env[Any, Any]
StateOf: TypeAlias = Callable[[Environment, Any, dict[str, Any]], Any]
"""Returns the state that predicates see, of environment, observation and info."""


class BinarySensors(
    gymnasium.Wrapper[NDArray[np.int8], Any, Any, Any], RecordConstructorArgs
):
    """An environment that shows the readings of binary sensors.

    Observations are ``MultiBinary(N)``. A reset begins a trajectory, and so does a step
    whose info has `begins`; any other step extends it ([GK] "Observation Model for
    DBAs"), with its reward, which sensors may read (`rewarded`).

    Args:
        env: With a ``Discrete`` action space.
        sensors: In the order of the observation, at least one.
        state: What the predicates see; if None, the observation itself.
        actions: Names for the actions; if None, those the environment has, if any.

    Attributes:
        sensors: The sensors' names.
        orders: For each, how many steps it looks back.
        definitions: The sensors themselves.
        actions: The names given; absent where none were.

    Raises:
        InvalidValueError: The action space is another, there is no sensor, one is no
            `Sensor`, or two have the same name; from `reset` and `step`: a predicate
            cannot read the state.
        ShapeError: Another number of names than of actions.

    Examples:
        >>> from neurosnap.agent.sensor import one_hot
        >>> walk = gymnasium.make("CliffWalking-v1")
        >>> env = BinarySensors(walk, one_hot("place", [36, 47]))
        >>> env.sensors, env.reset()[0]
        (('place=36', 'place=47'), array([1, 0], dtype=int8))
    """

    actions: tuple[str, ...]

    def __init__(
        self,
        env: Environment,
        sensors: Iterable[Sensor],
        state: StateOf | None = None,
        actions: Sequence[str] | None = None,
    ) -> None:
        sensors = tuple(sensors)
        # Not copied: sensors do not change, and a copy of a method that serves as a
        # predicate would come with a copy of its object.
        RecordConstructorArgs.__init__(
            self, sensors=sensors, state=state, actions=actions, _disable_deepcopy=True
        )
        gymnasium.Wrapper.__init__(self, env)
        if not isinstance(env.action_space, Discrete):
            raise InvalidValueError(
                "action space", "must be Discrete", env.action_space
            )
        if not sensors:
            raise InvalidValueError("sensors", "must be at least one", sensors)
        self._trajectory = Trajectory(sensors)
        self._state = state
        self.definitions: tuple[Sensor, ...] = sensors
        self.sensors: tuple[str, ...] = tuple(sensor.name for sensor in sensors)
        self.orders: tuple[int, ...] = tuple(sensor.order for sensor in sensors)
        self.observation_space = MultiBinary(len(sensors))
        if actions is not None:
            if len(actions) != env.action_space.n:
                rule = f"must be {env.action_space.n} names"
                raise ShapeError("actions", rule, len(actions))
            self.actions = tuple(actions)

    def state_of(self, observation: Any, info: dict[str, Any]) -> Any:  # noqa: ANN401
        """Return what the predicates see of an observation of the environment's own."""
        if self._state is None:
            return observation
        return self._state(self.env, observation, info)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Reset the environment and begin a trajectory."""
        observation, info = self.env.reset(seed=seed, options=options)
        readings = self._trajectory.begin(self.state_of(observation, info))
        return readings.astype(np.int8), info

    def step(
        self,
        action: Any,  # noqa: ANN401 - the environment knows
    ) -> tuple[NDArray[np.int8], SupportsFloat, bool, bool, dict[str, Any]]:
        """Step the environment and extend the trajectory, or begin one."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        state = self.state_of(observation, info)
        if info.get("begins", False):
            readings = self._trajectory.begin(state)
        else:
            readings = self._trajectory.extend(state, float(reward))
        return readings.astype(np.int8), reward, terminated, truncated, info
