"""Entry points for `gymnasium.make`: make every world, with or without a target.

A world that is asked for with a target comes with the action ``wait`` unless that is
declined: an agent that has found its target must be able to stay. Two sensors report
whether the last step came nearer: they sense a transition and nothing else, neither how
far the target is nor where. Far and near are counted in actions, along the shortest way
that the world's moves allow.
"""

from collections.abc import Callable
from typing import Any, Literal, SupportsFloat, TypeAlias

import gymnasium
import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.spaces import MultiBinary
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError

from .grid import GridWorld
from .path_and_cycle import CycleWorld, PathWorld, RandomFieldsWorld
from .places import PlacesWorld, frozen, is_whole

Made: TypeAlias = gymnasium.Env[NDArray[np.int8], np.int64]
"""A world, or one with a target."""


def _maker(
    kind: Callable[..., PlacesWorld], *, waits: bool = False, **defaults: int | str
) -> Callable[..., Made]:
    def make(
        *,
        target: int | Literal["drawn"] | None = None,
        wait: bool | None = None,
        **arguments: Any,  # noqa: ANN401 - whatever the kind takes
    ) -> Made:
        """Return a world of this kind.

        Args:
            target: A place, or ``"drawn"``: one drawn at every reset. None if there is
                no target, and the world is bare.
            wait: Whether there is an action that stays. If None, where there is a
                target, and in a kind that has it of itself.
            arguments: The kind's own.

        Raises:
            InvalidValueError: An argument breaks its rule.
        """
        if wait is None:
            wait = waits or target is not None
        world = kind(wait=wait, **{**defaults, **arguments})
        if target is None:
            return world
        return Target(world, None if target == "drawn" else target)

    return make


path = _maker(PathWorld)
cycle = _maker(CycleWorld)
grid = _maker(GridWorld)
random_fields = _maker(RandomFieldsWorld)
punctured_grid = _maker(GridWorld, hole="middle")
rail = _maker(CycleWorld, waits=True, places=24)


class Target(
    gymnasium.Wrapper[NDArray[np.int8], np.int64, NDArray[np.int8], np.int64],
    RecordConstructorArgs,
):
    """A world with a target, for excitation-driven agents.

    Description:
        The world as it is, and one of its places the target. Being there ends nothing.

    Sensors:
        The world's own, then ``better`` and ``worse``: on iff the last step lowered or
        raised the distance to the target. Both are off after a reset, and after a step
        that leaves the distance as it was. Observations are ``MultiBinary(N + 2)``.

    Actions:
        The world's.

    Start:
        The world's. Then, where the target is to be drawn, a place is drawn uniformly
        from the same random numbers; it may be the start.

    Info:
        The world's, and ``target``: the place; ``distance``: the fewest actions that
        lead there, a float, ``inf`` where none do.

    Arguments:
        env: A `PlacesWorld`, or one in wrappers that leave observations and actions
            as they are.
        target: The number of a place; None if it is drawn at every reset.

    Attributes:
        sensors: The sensors' names, in the order of the observation.
        orders: How many steps each sensor looks back: 0, for the two last 1.

    Raises:
        InvalidValueError: `env` or `target` is something else.
        ResetNeeded: From `target` and `distances`, if it is drawn: there was no reset.

    References:
        [GK] "Closing the Loop: Excitation-Driven Navigation".
    """

    def __init__(
        self,
        env: gymnasium.Env[NDArray[np.int8], np.int64],
        target: int | None = None,
    ) -> None:
        RecordConstructorArgs.__init__(self, target=target)
        self._world = _world(env)
        super().__init__(env)
        places = self._world.moves.shape[1]
        if target is not None and not (is_whole(target) and 0 <= target < places):
            rule = f"must be a place in 0..{places - 1}, or drawn"
            raise InvalidValueError("target", rule, target)
        self.sensors = (*self._world.sensors, "better", "worse")
        self.orders = (*self._world.orders, 1, 1)
        self.observation_space = MultiBinary(len(self.sensors))
        self._is_drawn = target is None
        self._target: int | None = None
        self._distances = np.empty(0)
        self._distance = np.nan
        if target is not None:
            self._aim(int(target))

    @property
    def target(self) -> int:
        """The place that is the target now."""
        if self._target is None:
            raise ResetNeeded("target: is drawn at a reset, and there was none")
        return self._target

    @property
    def distances(self) -> NDArray[np.float64]:
        """How far each place is from the target now: ``(places,)``, read-only.

        In actions, as `distances_to` counts them.
        """
        if self._target is None:
            raise ResetNeeded("distances: are from a target drawn at a reset")
        return self._distances

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Reset the world, then draw the target where it is to be drawn.

        Returns:
            The observation, with ``better`` and ``worse`` off, and the info.
        """
        observation, info = self.env.reset(seed=seed, options=options)
        if self._is_drawn:
            self._aim(int(self._world.np_random.integers(self._world.moves.shape[1])))
        self._distance = np.nan  # neither more nor less than any
        return self._sensed(observation, info)

    def step(
        self, action: np.int64
    ) -> tuple[NDArray[np.int8], SupportsFloat, bool, bool, dict[str, Any]]:
        """Move in the world, and observe ``better`` and ``worse``; its errors stay."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        observation, info = self._sensed(observation, info)
        return observation, reward, terminated, truncated, info

    def _aim(self, target: int) -> None:
        self._target = target
        there = np.arange(self._world.moves.shape[1]) == target
        self._distances = frozen(distances_to(self._world.moves, there))

    def _sensed(
        self, observation: NDArray[np.int8], info: dict[str, Any]
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Add to what the world says what is sensed of the target."""
        before, self._distance = self._distance, float(self._distances[info["place"]])
        scent = [self._distance < before, self._distance > before]
        told = {**info, "target": self._target, "distance": self._distance}
        return np.concatenate([observation, np.array(scent, dtype=np.int8)]), told


def _world(env: gymnasium.Env[NDArray[np.int8], np.int64]) -> PlacesWorld:
    """Return the world that `env` shows unaltered."""
    world = getattr(env, "unwrapped", None)
    if (
        not isinstance(world, PlacesWorld)
        or env.observation_space != world.observation_space
        or env.action_space != world.action_space
    ):
        rule = "must be a World, its observations and actions unaltered"
        raise InvalidValueError("env", rule, env)
    return world


def distances_to(
    moves: NDArray[np.intp], aims: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the fewest actions that lead from each place to one that is wanted.

    Moves need no way back: what counts is the way there. A place from which no actions
    lead there is infinitely far, so a step to it from elsewhere is for the worse and a
    step between two of them is neither.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        aims: ``(places,)``; which places are wanted.

    Returns:
        ``(places,)``, whole numbers from 0 up or ``inf``. Takes a pass over `moves` for
        each distance there is.
    """
    distances = np.where(aims, 0.0, np.inf)
    found = aims.copy()
    distance = 0
    while True:
        # Backwards, all at once: the places from which one action leads to a found one.
        nearest = found[moves].any(axis=0) & ~found
        if not nearest.any():
            return distances
        distance += 1
        distances[nearest] = distance
        found |= nearest
