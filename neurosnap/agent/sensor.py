"""Sensors as predicates over the last n states of a trajectory, for any n.

A sensor of order n reads the state that has just been entered and the n before it.
Before its start a trajectory is taken to have rested at its first state, so every
sensor has a reading from the first state on, and nothing has changed yet. A sensor may
also read the reward of the step that has just ended; at the start that is 0.

The predicates made here are values: equal if made alike, and fit to be pickled where
`of` is. Gymnasium compares and copies what an environment was made with.

References:
    [GK] "Observation Model for DBAs": an n-sensor has a realization in ``X^(n+1)``
    (eqn:evaluation of state sensors). Orders start from 0 there as here.
"""

import operator
from collections.abc import Callable, Iterable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.sensorium import Sensorium


@dataclass(frozen=True)
class Sensor:
    """A named predicate over ``order + 1`` states in a row.

    Calling it with that many states, the oldest first, gives its reading.

    Args:
        name: As `Sensorium` wants names.
        predicate: Is given the states one by one, the oldest first; answers with a
            bool, 0 or 1.
        order: How many steps it looks back; 0: a state sensor, 1: a transition sensor.
        of_reward: Whether the predicate is given the reward of the last step instead of
            states; then the order is 1.

    Raises:
        InvalidValueError: `name` cannot name a sensor, or `order` is no whole number
            from 0 up, or not 1 for a reward.

    Examples:
        >>> moved = Sensor("moved", lambda before, after: before != after, order=1)
        >>> moved(3, 4), moved(4, 4)
        (True, False)
    """

    name: str
    predicate: Callable[..., object]
    order: int = 0
    of_reward: bool = False

    def __post_init__(self) -> None:
        Sensorium([self.name])
        if type(self.order) is not int or self.order < 0:
            rule = "must be a whole number from 0 up"
            raise InvalidValueError("order", rule, self.order)
        if self.of_reward and self.order != 1:
            raise InvalidValueError("order", "must be 1 for a reward", self.order)

    def __call__(self, *states: object) -> bool:
        """Return whether it is on at the last of `states`.

        Args:
            *states: ``order + 1`` states, the oldest first; or the reward alone.

        Raises:
            InvalidValueError: The predicate raised, or answered with something else
                than a bool, 0 or 1; the text names the sensor and shows the states.
        """
        try:
            answer = self.predicate(*states)
        except Exception as error:
            rule = f"must not raise (it did: {error!r})"
            raise InvalidValueError(f"sensor {self.name}", rule, states) from error
        is_number = isinstance(answer, int | np.integer | np.bool_)
        if not is_number or answer not in (0, 1):
            rule = f"must answer with a bool, 0 or 1 (it did with {answer!r})"
            raise InvalidValueError(f"sensor {self.name}", rule, states)
        return bool(answer)


class Trajectory:
    """The last states of a trajectory, as far back as any of its sensors looks.

    Sensors come in the order of the observation. It keeps copies, since an environment
    may write its next state where the last one was. A state that a predicate cannot
    read leaves the trajectory as it was.

    Raises:
        InvalidValueError: One of them is no `Sensor`, or two have the same name.

    Examples:
        >>> t = Trajectory([*thresholds("x", [2]), increased("up", of=abs)])
        >>> t.begin(1), t.extend(2)
        (array([ True, False]), array([False,  True]))
    """

    def __init__(self, sensors: Iterable[Sensor]) -> None:
        self.sensors: tuple[Sensor, ...] = tuple(sensors)
        for sensor in self.sensors:
            if not isinstance(sensor, Sensor):
                raise InvalidValueError("sensors", "must each be a Sensor", sensor)
        Sensorium(sensor.name for sensor in self.sensors)
        self._length = 1 + max((sensor.order for sensor in self.sensors), default=0)
        self._states: tuple[Any, ...] = ()

    def begin(self, state: object) -> NDArray[np.bool_]:
        """Start at rest in `state`; return the readings, ``(N,)``. O(N) calls.

        Raises:
            InvalidValueError: As for `Sensor.__call__`.
        """
        return self._enter((deepcopy(state),) * self._length, 0.0)

    def extend(self, state: object, reward: float = 0.0) -> NDArray[np.bool_]:
        """Enter the next state, by a step with that reward; the very first one begins.

        Readings and errors are those of `begin`.
        """
        if not self._states:
            return self.begin(state)
        return self._enter((*self._states[1:], deepcopy(state)), reward)

    def _enter(self, states: tuple[Any, ...], reward: float) -> NDArray[np.bool_]:
        readings = [
            sensor(reward) if sensor.of_reward else sensor(*states[-sensor.order - 1 :])
            for sensor in self.sensors
        ]
        self._states = states
        return np.array(readings, np.bool_)


@dataclass(frozen=True)
class Attribute:
    """The attribute of a state that a sensor reads, given by the attribute's name.

    No lambda: it stays the same under a copy, and an environment that Gymnasium makes
    again from its spec must compare equal.
    """

    name: str

    def __call__(self, state: object) -> Any:  # noqa: ANN401 - the sensor knows
        """Return it."""
        return getattr(state, self.name)


def itself(state: Any) -> Any:  # noqa: ANN401 - whatever a state is
    """Return the state itself: the default attribute of a sensor."""
    return state


def thresholds(
    name: str, values: Iterable[Any], of: Callable[[Any], Any] = itself
) -> tuple[Sensor, ...]:
    """Return a chain of state sensors ``name<v``, on iff ``of(state) < v``.

    Examples:
        >>> [sensor.name for sensor in thresholds("row", range(1, 4))]
        ['row<1', 'row<2', 'row<3']
    """
    return tuple(
        Sensor(f"{name}<{value}", _Compared(of, operator.lt, value)) for value in values
    )


def one_hot(
    name: str, values: Iterable[Any], of: Callable[[Any], Any] = itself
) -> tuple[Sensor, ...]:
    """Return state sensors ``name=v``, on iff ``of(state) == v``, so one at a time.

    Examples:
        >>> [sensor("b") for sensor in one_hot("letter", "abc")]
        [False, True, False]
    """
    return tuple(
        Sensor(f"{name}={value}", _Compared(of, operator.eq, value)) for value in values
    )


def decreased(name: str, of: Callable[[Any], Any] = itself) -> Sensor:
    """Return a transition sensor that is on iff ``of(state)`` fell in the last step."""
    return Sensor(name, _Changed(of, operator.lt), order=1)


def increased(name: str, of: Callable[[Any], Any] = itself) -> Sensor:
    """Return a transition sensor that is on iff ``of(state)`` rose in the last step."""
    return Sensor(name, _Changed(of, operator.gt), order=1)


def rewarded(name: str = "rewarded", above: float = 0.0) -> Sensor:
    """Return the sensor that is on iff the last step's reward was above a value.

    Examples:
        >>> Trajectory([rewarded()]).extend("goal", reward=1.0)
        array([False])

        The very first state is a beginning: no step led to it.
    """
    predicate = _Compared(itself, operator.gt, above)
    return Sensor(name, predicate, order=1, of_reward=True)


@dataclass(frozen=True)
class _Compared:
    """Whether a quantity of the state, or a reward, stands in a relation to a value."""

    of: Callable[[Any], Any]
    relation: Callable[[Any, Any], object]
    value: Any

    def __call__(self, state: object) -> object:
        return self.relation(self.of(state), self.value)


@dataclass(frozen=True)
class _Changed:
    """Whether a quantity of a state stands in a relation to that of the one before."""

    of: Callable[[Any], Any]
    relation: Callable[[Any, Any], object]

    def __call__(self, before: object, after: object) -> object:
        return self.relation(self.of(after), self.of(before))
