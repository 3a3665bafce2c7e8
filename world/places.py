"""The base of the worlds: places, moves, and the places where each sensor is on.

An agent is at exactly one place. An action takes it to the place that `moves` says, and
it observes of every sensor whether the place is in that sensor's field. There is no
noise; chance enters only at a reset.

Unless a kind says otherwise, it starts at a place drawn uniformly; the reward is always
0.0; it never ends; and info has ``place``, the number of the place.
"""

from typing import Any, SupportsInt, TypeGuard

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.dual.realization import inclusions

_MUCH = 1 << 28  # bytes that any machine has


class PlacesWorld(gymnasium.Env[NDArray[np.int8], np.int64]):
    """The base class of worlds of places; subclasses pass it their moves and sensors.

    Args:
        sensors: A name for each sensor.
        actions: A name for each action.
        moves: ``(actions, places)``; where an action leads from a place.
        fields: ``(sensors, places)``; where each sensor is on. None if they are drawn
            at a reset, by an override of `_begin`.
        wait: Whether to add a last action, ``wait``, that stays: [GK] "Closing the
            Loop" gives it to the excitation-driven agents.

    Attributes:
        sensors: The sensors' names, in the order of the observation.
        orders: How many steps each sensor looks back: 0, all are of the state.
        actions: The actions' names, in the order of their numbers.
        moves: ``(actions, places)``, with ``wait`` where there is one; read-only.

    Raises:
        InvalidValueError: `wait` is neither true nor false.
        ResetNeeded: From `fields`, if these are drawn, and `step`: there was no reset.
    """

    def __init__(
        self,
        *,
        sensors: tuple[str, ...],
        actions: tuple[str, ...],
        moves: NDArray[np.intp],
        fields: NDArray[np.bool_] | None,
        wait: bool,
    ) -> None:
        if not isinstance(wait, bool):
            raise InvalidValueError("wait", "must be True or False", wait)
        if wait:
            actions = (*actions, "wait")
            moves = np.vstack([moves, np.arange(moves.shape[1])])
        self.sensors = sensors
        self.orders = (0,) * len(sensors)
        self.actions = actions
        self.moves = frozen(moves)
        self.observation_space = MultiBinary(len(sensors))
        self.action_space = Discrete(len(actions))
        self._fields = None if fields is None else frozen(fields)
        self._place: int | None = None

    @property
    def fields(self) -> NDArray[np.bool_]:
        """Where each sensor is on: ``(sensors, places)``, read-only."""
        if self._fields is None:
            raise ResetNeeded("fields: are drawn at a reset, and there was none")
        return self._fields

    @property
    def implications(self) -> list[tuple[str, str]]:
        """All true implications between literals of different sensors, by name.

        ``(a, b)`` is there iff the field of `a` lies within the field of `b`; this
        includes those of empty, full and equal fields. ``name*`` is a complement.
        """
        names = [literal for name in self.sensors for literal in (name, f"{name}*")]
        # [GK] eqn:true dir matrix
        pairs = np.argwhere(inclusions(self.fields)).tolist()
        return [(names[a], names[b]) for a, b in pairs if a >> 1 != b >> 1]

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Put the agent at a place drawn uniformly; a seed starts the numbers over."""
        super().reset(seed=seed, options=options)
        self._begin(seeded=seed is not None)
        self._place = int(self.np_random.integers(self.moves.shape[1]))
        return self._observation(self._place), self._info(self._place)

    def step(
        self, action: SupportsInt
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        """Move: actions count from 0; nothing is rewarded, nor ever ends.

        Raises:
            InvalidValueError: There is no such action.
        """
        if self._place is None:
            raise ResetNeeded("step: needs a reset before")
        if not self.action_space.contains(action):
            rule = f"must be a whole number in 0..{len(self.moves) - 1}"
            raise InvalidValueError("action", rule, action)
        self._place = int(self.moves[int(action), self._place])
        seen, info = self._observation(self._place), self._info(self._place)
        return seen, 0.0, False, False, info

    def _begin(self, *, seeded: bool) -> None:
        """Prepare a run; called by every reset before the start is drawn."""

    def _observation(self, place: int) -> NDArray[np.int8]:
        return self.fields[:, place].astype(np.int8)

    def _info(self, place: int) -> dict[str, Any]:
        return {"place": place}


def check_at_least(name: str, least: int, value: object) -> None:
    """Raise InvalidValueError for a size that is no whole number or below `least`."""
    if not is_whole(value) or value < least:
        rule = f"must be a whole number of at least {least}"
        raise InvalidValueError(name, rule, value)


def check_fits(name: str, value: int, sensors: int, room: int) -> None:
    """Refuse a world too large to be learned here, before any memory is taken.

    Args:
        name: The argument that its size comes from.
        value: What it is.
        sensors: How many it would have.
        room: Bytes that it would take itself.

    Raises:
        InvalidValueError: It does not fit; the text has the figure.
    """
    if max(room, sensors**2) > _MUCH:
        from neurosnap.runtime.preflight import check_world

        check_world(name, value, sensors, room + 120 * sensors)


def is_whole(value: object) -> TypeGuard[int]:
    """Return whether `value` is a whole number; a bool counts as none."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def frozen(array: NDArray[Any]) -> NDArray[Any]:
    """Return a read-only array: moves and fields are the truth others compare with.

    One that can be written to is copied; a view of `thresholds` would grow by that.
    """
    if not array.flags.writeable:
        return array
    copy = array.copy()
    copy.flags.writeable = False
    return copy
