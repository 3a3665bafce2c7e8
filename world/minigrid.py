"""MiniGrid's mazes, seen through binary sensors.

The layout is drawn once and stays: what happens next is a function of where the agent
is, which way it looks, what it carries, the doors, and where things lie. There is no
limit on time.
It needs the package `minigrid`, which the extra of that name brings.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
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
    "Unlock",
    "MultiRoom-N2-S4",
    "KeyCorridorS3R1",
)
"""The mazes, by the names that MiniGrid has for them."""
_THINGS = ("key", "ball")  # that can be carried
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
    """``key``, ``ball`` or ``nothing``."""
    doors: tuple[str, ...]
    """Each ``locked``, ``closed`` or ``open``, row by row."""
    lies: tuple[int, ...]
    """Row and column of the key, then of the ball; 0 if it is carried or not there."""


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
        A maze of cells. In most there is a goal, in some behind a door that a key
        opens. ``Unlock`` has a locked door to open, ``KeyCorridorS3R1`` a ball to pick
        up: give it the action ``drop``, as one who carries the key can take no ball.

    Sensors:
        ``row<2``, ``row<3``, ...; ``column<2``, ...; ``facing=east``, ``=south``,
        ``=west``, ``=north``. Where there is one ``tile=goal``; ``carries=key``;
        ``carries=ball``; ``door=locked`` and ``door=open``, of several
        ``door_1=locked`` and so on. And if things can be dropped ``key_row<2``, ...,
        ``ball_column<2``, ...: where they lie.

    Actions:
        Those of MiniGrid, unless some are left out: ``drop`` and ``done`` are.

    Start:
        Always the same place.

    Reward:
        1 when it ends, 0 before.

    End:
        At the goal; in ``Unlock`` with the door open, in ``KeyCorridorS3R1`` with the
        ball.

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
    return BinarySensors(maze, _sensors(maze, actions), standing, tuple(actions))


def _sensors(maze: Maze, actions: Sequence[str]) -> list[Sensor]:
    """Return what is sensed in a maze; of kinds of things those that are there."""
    inner: Any = maze.unwrapped
    rows, columns = range(2, inner.height - 1), range(2, inner.width - 1)
    begun, kinds = standing(maze), {one.type for one in inner.grid.grid if one}
    sensors: list[Sensor] = [
        *thresholds("row", rows, of=Attribute("row")),
        *thresholds("column", columns, of=Attribute("column")),
        *one_hot("facing", _FACING, of=Attribute("facing")),
    ]
    if "goal" in kinds:
        sensors += one_hot("tile", ["goal"], of=Attribute("tile"))
    things = [kind for kind in _THINGS if kind in kinds]
    sensors += one_hot("carries", things, of=Attribute("carries"))
    for door in range(len(begun.doors)):
        name = "door" if len(begun.doors) == 1 else f"door_{door + 1}"
        sensors += one_hot(name, ["locked", "open"], of=_Entry("doors", door))
    for thing in things if "drop" in actions else ():
        at = 2 * _THINGS.index(thing)
        sensors += thresholds(f"{thing}_row", rows, of=_Entry("lies", at))
        sensors += thresholds(f"{thing}_column", columns, of=_Entry("lies", at + 1))
    return sensors


@dataclass(frozen=True)
class _Entry:
    """An entry of a state's attribute, as `Attribute` is the whole of it."""

    name: str
    place: int

    def __call__(self, state: object) -> Any:  # noqa: ANN401 - the sensor knows
        return getattr(state, self.name)[self.place]


def standing(env: Environment, *_: object) -> MazeStanding:
    """Return where the agent of a maze is, and what it has done."""
    maze: Any = env.unwrapped
    column, row = (int(x) for x in maze.agent_pos)
    under = maze.grid.get(column, row)
    doors, lies = [], dict.fromkeys(_THINGS, (0, 0))
    for number, one in enumerate(maze.grid.grid):
        if one is not None and one.type == "door":
            doors.append(
                "locked" if one.is_locked else "open" if one.is_open else "closed"
            )
        elif one is not None and one.type in lies:
            lies[one.type] = divmod(number, maze.width)
    tile = "floor" if under is None else under.type
    carries = "nothing" if maze.carrying is None else maze.carrying.type
    facing = _FACING[int(maze.agent_dir)]
    at = tuple(chain.from_iterable(lies.values()))
    return MazeStanding(row, column, facing, tile, carries, tuple(doors), at)
