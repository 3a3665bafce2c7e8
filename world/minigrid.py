"""MiniGrid's mazes, seen through binary sensors.

The layout is drawn once and stays: what happens next is a function of where the agent
is, which way it looks, what it carries, and the door. There is no limit on time.
It needs the package `minigrid`, which the extra of that name brings.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, SupportsInt

import gymnasium
from gymnasium.spaces import Discrete

from neurosnap.agent.binary_sensors import BinarySensors, Environment
from neurosnap.agent.sensor import Attribute, Sensor, one_hot, thresholds
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.system.distribution import must_have

ACTIONS = ("left", "right", "forward", "pickup", "drop", "toggle", "done")
"""All that MiniGrid has, in its order."""
LAYOUTS = (
    "Empty-5x5",
    "Empty-8x8",
    "FourRooms",
    "DoorKey-5x5",
    "DoorKey-6x6",
    "DoorKey-8x8",
)
"""The mazes, by the names that MiniGrid has for them."""
_FACING = ("east", "south", "west", "north")
_LAST = 10**30
"""The last step of an episode: so far off that MiniGrid's reward does not shrink."""


class MazeStanding(NamedTuple):
    """Where the agent is, and what it has done."""

    row: int
    """Counted from 0 at the top, which is a wall."""
    column: int
    """Counted from 0 at the left, which is a wall."""
    facing: str
    """``east``, ``south``, ``west`` or ``north``."""
    tile: str
    """What the agent stands on: ``goal``, ``door`` or ``floor``."""
    carries: str
    """``key`` or ``nothing``."""
    door: str
    """``locked``, ``closed`` or ``open``; ``none`` where there is no door."""


class Maze(gymnasium.ActionWrapper[Any, Any, Any]):
    """A maze of MiniGrid whose layout stays.

    Args:
        env: MiniGrid's.
        seed: Draws the layout, the place the agent begins at, and the goal.
        actions: What can be done, of `ACTIONS`.
    """

    def __init__(self, env: Environment, seed: int, actions: Sequence[str]) -> None:
        super().__init__(env)
        self._seed = seed
        self._numbers = dict(enumerate(map(ACTIONS.index, actions)))
        self.action_space = Discrete(len(actions))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin where the layout says; the seed changes nothing of it."""
        begun = self.env.reset(seed=self._seed, options=options)
        gymnasium.Env.reset(self.unwrapped, seed=seed)
        return begun

    def action(self, action: SupportsInt) -> int:
        """Return MiniGrid's number for an action."""
        return self._numbers[int(action)]


def minigrid(
    layout: str = "Empty-8x8",
    layout_seed: int = 0,
    actions: Sequence[str] = ("left", "right", "forward", "pickup", "toggle"),
    render_mode: str | None = None,
) -> BinarySensors:
    """Return a maze of MiniGrid.

    Description:
        A maze of cells, and a goal; there may be a locked door before it, and a key.

    Sensors:
        ``row<2``, ``row<3``, ...; ``column<2``, ...; ``facing=east``, ``=south``,
        ``=west``, ``=north``; ``tile=goal``; and where there is a door
        ``carries=key``, ``door=locked``, ``door=open``.

    Actions:
        Those of MiniGrid, unless some are left out: ``drop`` and ``done`` are.

    Start:
        Always the same place.

    Reward:
        1 at the goal, 0 elsewhere.

    End:
        At the goal.

    Info:
        There is none.

    Args:
        layout: One of `LAYOUTS`.
        layout_seed: Draws it.
        actions: What can be done.
        render_mode: None, or ``rgb_array``.

    Raises:
        InvalidValueError: There is no such layout, or no such action.
        MissingExtraError: MiniGrid is not installed.
    """
    if layout not in LAYOUTS:
        rule = f"must be one of {', '.join(LAYOUTS)}"
        raise InvalidValueError("layout", rule, layout)
    if not actions or not set(actions).issubset(ACTIONS):
        rule = f"must be some of {', '.join(ACTIONS)}"
        raise InvalidValueError("actions", rule, tuple(actions))
    try:
        inner: Any = gymnasium.make(
            f"minigrid:MiniGrid-{layout}-v0", max_steps=_LAST, render_mode=render_mode
        ).unwrapped
    except ImportError as error:
        rule = must_have("minigrid", "minigrid")
        raise MissingExtraError(f"MiniGrid: {rule}") from error
    maze = Maze(inner, layout_seed, actions)
    maze.reset()
    sensors: list[Sensor] = [
        *thresholds("row", range(2, inner.height - 1), of=Attribute("row")),
        *thresholds("column", range(2, inner.width - 1), of=Attribute("column")),
        *one_hot("facing", _FACING, of=Attribute("facing")),
        *one_hot("tile", ["goal"], of=Attribute("tile")),
    ]
    if standing(maze).door != "none":
        sensors += one_hot("carries", ["key"], of=Attribute("carries"))
        sensors += one_hot("door", ["locked", "open"], of=Attribute("door"))
    return BinarySensors(maze, sensors, standing, tuple(actions))


def standing(env: Environment, *_: object) -> MazeStanding:
    """Return where the agent of a maze is, and what it has done."""
    maze: Any = env.unwrapped
    column, row = (int(x) for x in maze.agent_pos)
    under = maze.grid.get(column, row)
    door = "none"
    for one in maze.grid.grid:
        if one is not None and one.type == "door":
            door = "locked" if one.is_locked else "open" if one.is_open else "closed"
    tile = "floor" if under is None else under.type
    carries = "nothing" if maze.carrying is None else maze.carrying.type
    return MazeStanding(row, column, _FACING[int(maze.agent_dir)], tile, carries, door)
