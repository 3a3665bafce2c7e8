"""MiniGrid's mazes, seen through binary sensors.

The layout is drawn once and stays: what happens next is a function of where the agent
is, which way it looks, what it carries, and the door. All that can happen is tried in
MiniGrid itself when the world is made, and kept as a table like those of Gymnasium's
toy texts. There is no limit on time.

It needs the package `minigrid`, which the extra of that name brings.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple, SupportsInt, TypeAlias

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete

from neurosnap.agent.binary_sensors import BinarySensors, Environment
from neurosnap.agent.sensor import Attribute, Sensor, one_hot, thresholds
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.system.distribution import must_have

ACTIONS = ("left", "right", "forward", "pickup", "drop", "toggle", "done")
"""All that MiniGrid has, in its order."""
LAYOUTS: dict[str, tuple[str, dict[str, int]]] = {
    "Empty-5x5": ("EmptyEnv", {"size": 5}),
    "Empty-8x8": ("EmptyEnv", {"size": 8}),
    "FourRooms": ("FourRoomsEnv", {}),
    "DoorKey-5x5": ("DoorKeyEnv", {"size": 5}),
    "DoorKey-6x6": ("DoorKeyEnv", {"size": 6}),
    "DoorKey-8x8": ("DoorKeyEnv", {"size": 8}),
}
"""The mazes by name: MiniGrid's class, and what it is made with."""
_FACING = ("east", "south", "west", "north")

_State: TypeAlias = tuple[Any, ...]


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


class Maze(gymnasium.Env[np.int64, np.int64]):
    """A maze of MiniGrid with one layout, as a table.

    Args:
        layout: One of `LAYOUTS`.
        seed: Draws the layout, the place the agent begins at, and the goal.
        actions: What can be done, of `ACTIONS`.
        render_mode: As in MiniGrid; None if it is never drawn.

    Attributes:
        P: For each state and action, ``[(1.0, next state, reward, end)]``.
        initial_state_distrib: ``(states,)``: it begins at the first.
        s: The state it is in.
        cells: What each state is.

    Raises:
        InvalidValueError: There is no such layout or action, or no action.
        MissingExtraError: MiniGrid is not installed.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(
        self,
        layout: str,
        seed: int,
        actions: Sequence[str],
        render_mode: str | None = None,
    ) -> None:
        if layout not in LAYOUTS:
            raise InvalidValueError(
                "layout", f"must be one of {', '.join(LAYOUTS)}", layout
            )
        if not actions or not set(actions).issubset(ACTIONS):
            rule = f"must be some of {', '.join(ACTIONS)}"
            raise InvalidValueError("actions", rule, tuple(actions))
        try:
            from minigrid import envs
        except ImportError as error:
            rule = must_have("minigrid", "minigrid")
            raise MissingExtraError(f"MiniGrid: {rule}") from error
        kind, arguments = LAYOUTS[layout]
        inner = getattr(envs, kind)(**arguments, render_mode=render_mode)
        inner.reset(seed=seed)
        self.size = inner.width, inner.height
        numbers = [ACTIONS.index(one) for one in actions]
        self.P, self.cells, states = _explored(inner, numbers)
        self.render_mode = render_mode
        self._drawn = None if render_mode is None else (inner, states)
        if render_mode is None:
            inner.close()
        self.initial_state_distrib = np.eye(1, len(self.cells))[0]
        self.action_space = Discrete(len(actions))
        self.observation_space = Discrete(len(self.cells))
        self.s = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.int64, dict[str, Any]]:
        """Begin where the layout says."""
        super().reset(seed=seed, options=options)
        self.s = 0
        return np.int64(self.s), {}

    def step(
        self, action: SupportsInt
    ) -> tuple[np.int64, float, bool, bool, dict[str, Any]]:
        """Take an action."""
        ((_, self.s, reward, over),) = self.P[self.s][int(action)]
        return np.int64(self.s), reward, over, False, {}

    def render(self) -> Any:  # noqa: ANN401 - an array, MiniGrid has no types
        """Return what MiniGrid draws of the state; None without a render mode."""
        if self._drawn is None:
            return None
        inner, states = self._drawn
        _restore(inner, states[self.s])
        return inner.render()

    def close(self) -> None:
        """Close what is drawn."""
        if self._drawn is not None:
            self._drawn[0].close()


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
    maze = Maze(layout, layout_seed, actions, render_mode)
    columns, rows = maze.size
    sensors: list[Sensor] = [
        *thresholds("row", range(2, rows - 1), of=Attribute("row")),
        *thresholds("column", range(2, columns - 1), of=Attribute("column")),
        *one_hot("facing", _FACING, of=Attribute("facing")),
        *one_hot("tile", ["goal"], of=Attribute("tile")),
    ]
    if maze.cells[0].door != "none":
        sensors += one_hot("carries", ["key"], of=Attribute("carries"))
        sensors += one_hot("door", ["locked", "open"], of=Attribute("door"))
    return BinarySensors(maze, sensors, _in_the_maze, tuple(actions))


def _explored(
    maze: Any,  # noqa: ANN401 - MiniGrid has no types
    actions: list[int],
) -> tuple[
    dict[int, dict[int, list[tuple[float, int, float, bool]]]],
    list[MazeStanding],
    list[_State],
]:
    """Try every action wherever one can get to; states are numbered as they are found.

    Returns:
        The table, what each state is, and how MiniGrid is brought there.
    """
    maze.max_steps = 2**62
    states = [_saved(maze)]
    cells = [_cell(maze)]
    number = {_key(maze): 0}
    table: dict[int, dict[int, list[tuple[float, int, float, bool]]]] = {}
    for state, saved in enumerate(states):
        table[state] = {}
        for place, action in enumerate(actions):
            _restore(maze, saved)
            if cells[state].tile == "goal":
                table[state][place] = [(1.0, state, 0.0, True)]
                continue
            _, _, over, _, _ = maze.step(action)
            key = _key(maze)
            if key not in number:
                number[key] = len(states)
                states.append(_saved(maze))
                cells.append(_cell(maze))
            table[state][place] = [(1.0, number[key], float(over), bool(over))]
    return table, cells, states


def _saved(maze: Any) -> _State:  # noqa: ANN401
    doors = [(one, one.is_open, one.is_locked) for one in _doors(maze)]
    where = tuple(int(x) for x in maze.agent_pos), int(maze.agent_dir)
    return (*where, maze.carrying, list(maze.grid.grid), doors)


def _restore(maze: Any, saved: _State) -> None:  # noqa: ANN401
    position, maze.agent_dir, maze.carrying, grid, doors = saved
    maze.agent_pos, maze.grid.grid = np.array(position), list(grid)
    for door, is_open, is_locked in doors:
        door.is_open, door.is_locked = is_open, is_locked
    maze.step_count = 0


def _doors(maze: Any) -> list[Any]:  # noqa: ANN401
    return [one for one in maze.grid.grid if one is not None and one.type == "door"]


def _key(maze: Any) -> _State:  # noqa: ANN401
    """Return what tells one state of a layout from another."""
    keys = tuple(
        place
        for place, one in enumerate(maze.grid.grid)
        if one is not None and one.type == "key"
    )
    return (*_cell(maze), keys)


def _cell(maze: Any) -> MazeStanding:  # noqa: ANN401
    column, row = (int(x) for x in maze.agent_pos)
    under = maze.grid.get(column, row)
    door = "none"
    for one in _doors(maze):
        door = "locked" if one.is_locked else "open" if one.is_open else "closed"
    return MazeStanding(
        row=row,
        column=column,
        facing=_FACING[int(maze.agent_dir)],
        tile="floor" if under is None else under.type,
        carries="nothing" if maze.carrying is None else maze.carrying.type,
        door=door,
    )


def _in_the_maze(env: Environment, observation: int, _: dict[str, Any]) -> MazeStanding:
    maze: Any = env.unwrapped
    cell: MazeStanding = maze.cells[int(observation)]
    return cell
