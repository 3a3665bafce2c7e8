"""Entry points for `gymnasium.make`: every world, with or without a target.

A world that is asked for with a target comes with the action ``wait`` unless that is
declined: an agent that has found its target must be able to stay.
"""

from collections.abc import Callable
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np
from numpy.typing import NDArray

from .line import CycleWorld, PathWorld, RandomFieldsWorld
from .places import PlacesWorld
from .plane import GridWorld
from .target import Target

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
