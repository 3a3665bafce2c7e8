"""Worlds as tables: places, what each action leads to, and what is sensed.

A walk on a stage is drawn from the environment's own table of transitions, so that
agents with sensors and rivals that are told the number of the place meet the same
world. A place at which the episode is over is another than the same one before.
"""

from copy import deepcopy
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from typing import Any, SupportsInt

import gymnasium
import msgspec
import numpy as np
from gymnasium.spaces import Discrete, MultiBinary
from numpy.typing import NDArray

from neurosnap.agent.grower import ROOM
from neurosnap.sensorium import complete
from neurosnap.sources.gymnasium_source import import_worlds
from world.minigrid import ACTIONS, MazeStanding, standing

_FATAL = "tile=hole", "box=stuck"
_FALL = -100.0  # CliffWalking's reward for going over the cliff, and nobody else's


class Setting(msgspec.Struct, frozen=True, kw_only=True):
    """A world to explore, and how."""

    name: str
    """What it is called in the data."""
    world: str
    """The environment's id."""
    arguments: tuple[tuple[str, Any], ...] = ()
    """What it is made with."""
    steps: int
    """Steps of exploration."""
    walk: bool = False
    """Whether these are a random walk's; else exploration is planned."""
    room: int = ROOM
    """Sensors an agent may grow, those it retires among them."""
    coins: int = 0
    """Sensors added that are on or off by chance at every step."""
    journeys: int = 200
    """Drawn of all pairs of places, without putting back."""
    to_goal: bool = False
    """Whether journeys are to the world's goal only, from places drawn."""


def settings() -> tuple[Setting, ...]:
    """Return the worlds of the figure; MiniGrid's if it is installed."""
    lake, minigrid = "neurosnap/FrozenLake-v0", "neurosnap/MiniGrid-v0"
    slips = (("is_slippery", True),)
    always = (
        Setting(name="lake 4x4", world=lake, steps=1000),
        Setting(
            name="lake 8x8",
            world=lake,
            arguments=(("map_name", "8x8"),),
            steps=8000,
        ),
        Setting(name="cliff", world="neurosnap/CliffWalking-v0", steps=5000),
        Setting(name="taxi", world="neurosnap/Taxi-v0", steps=10_000, journeys=40),
        Setting(
            name="punctured grid",
            world="neurosnap/PuncturedGrid-v0",
            steps=30_000,
            walk=True,
        ),
        Setting(name="rail", world="neurosnap/Cycle-v0", steps=30_000, walk=True),
        Setting(name="lake, 3 coins", world=lake, steps=2000, coins=3),
        Setting(
            name="sokoban", world="neurosnap/Sokoban-v0", steps=20_000, to_goal=True
        ),
        *(
            Setting(name=name, world=world, arguments=where, steps=steps, room=120)
            for name, world, where, steps in (
                ("lake, slippery", lake, slips, 5000),
                ("lake 8x8, slippery", lake, (("map_name", "8x8"), *slips), 20_000),
                ("cliff, slippery", "neurosnap/CliffWalking-v0", slips, 20_000),
            )
        ),
    )
    if find_spec("minigrid") is None:
        return always
    return (
        *always,
        *(
            Setting(
                name=f"MiniGrid {name}",
                world=minigrid,
                arguments=(("layout", layout), *more),
                steps=20_000,
                room=300,
                to_goal=True,
            )
            for name, layout, *more in (
                ("empty 8x8", "Empty-8x8"),
                ("four rooms", "FourRooms"),
                ("door and key 5x5", "DoorKey-5x5"),
                ("door and key 8x8", "DoorKey-8x8"),
                ("unlock", "Unlock"),
                ("two rooms", "MultiRoom-N2-S4"),
                ("key corridor", "KeyCorridorS3R1", ("actions", ACTIONS[:6])),
            )
        ),
    )


@dataclass(frozen=True)
class Stage:
    """A world as a table."""

    sensors: tuple[str, ...]
    actions: tuple[str, ...]
    fields: NDArray[np.bool_]
    """``(sensors, places)``: where each is on."""
    outcomes: tuple[tuple[tuple[tuple[float, int], ...], ...], ...]
    """For each place and action, the chances and places that follow."""
    over: NDArray[np.bool_]
    """``(places,)``: whether the episode is over there."""
    start: NDArray[np.float64]
    """``(places,)``: the chance of beginning there."""
    goals: NDArray[np.bool_]
    """``(places,)``: what a rival that knows one goal only is to reach."""
    falls: frozenset[tuple[int, int, int]] = frozenset()
    """Place, action and the place after, of moves into a hole or over the cliff."""
    coins: int = 0

    def literals(self, place: int) -> list[int]:
        """Return what holds at a place; nothing of coins."""
        return complete(self.fields[:, place]).nonzero()[0].tolist()

    @property
    def certain(self) -> bool:
        """Whether every action has one outcome."""
        return all(len(ways) == 1 for row in self.outcomes for ways in row)

    def follow(self, place: int, action: int, draw: float) -> int:
        """Return the place that an action leads to, by a number in [0, 1)."""
        ways = self.outcomes[place][action]
        for chance, after in ways[:-1]:
            if draw < chance:
                return after
            draw -= chance
        return ways[-1][1]

    def distances(self, at: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the fewest steps to places of `at`, if one has luck: ``(places,)``."""
        far = np.where(at, 0.0, np.inf)
        ways = [
            (place, after)
            for place, row in enumerate(self.outcomes)
            if not self.over[place]
            for after in {after for way in row for _, after in way}
        ]
        before, then = np.array(ways, np.intp).reshape(-1, 2).T
        while True:
            nearer = far.copy()
            np.minimum.at(nearer, before, far[then] + 1)
            if np.array_equal(nearer, far):
                return far
            far = nearer


class StageEnv(gymnasium.Env[NDArray[np.int8], np.int64]):
    """A Gymnasium environment made from a `Stage`.

    Args:
        stage: Which.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        coins = tuple(f"coin_{k}" for k in range(stage.coins))
        self.sensors = (*stage.sensors, *coins)
        self.orders = (0,) * len(self.sensors)
        self.actions = stage.actions
        self.observation_space = MultiBinary(len(self.sensors))
        self.action_space = Discrete(len(stage.actions))
        self.place = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.int8], dict[str, Any]]:
        """Begin an episode."""
        super().reset(seed=seed, options=options)
        shares = self.stage.start
        self.put(int(self.np_random.choice(len(shares), p=shares)))
        return self.reading(), {}

    def put(self, place: int) -> None:
        """Put the agent at a place."""
        self.place = place

    def reading(self) -> NDArray[np.int8]:
        """Return what is sensed; coins are thrown."""
        own = self.stage.fields[:, self.place].astype(np.int8)
        if not self.stage.coins:
            return own
        thrown = self.np_random.integers(2, size=self.stage.coins, dtype=np.int8)
        return np.concatenate((own, thrown))

    def step(
        self, action: SupportsInt
    ) -> tuple[NDArray[np.int8], float, bool, bool, dict[str, Any]]:
        """Take an action."""
        draw = float(self.np_random.random())
        self.put(self.stage.follow(self.place, int(action), draw))
        return self.reading(), 0.0, bool(self.stage.over[self.place]), False, {}


@lru_cache(maxsize=16)
def stage_of(setting: Setting) -> Stage:
    """Return a world as a table."""
    import_worlds()
    env: gymnasium.Env[Any, Any] = gymnasium.make(
        setting.world, disable_env_checker=True, **dict(setting.arguments)
    )
    try:
        made = _of_moves(env) if env.has_wrapper_attr("moves") else _of_table(env)
    finally:
        env.close()
    return replace(made, coins=setting.coins)


def _of_moves(env: gymnasium.Env[Any, Any]) -> Stage:
    """Return one of the worlds without an end, whose moves are known."""
    moves = env.get_wrapper_attr("moves")
    places = moves.shape[1]
    return Stage(
        sensors=env.get_wrapper_attr("sensors"),
        actions=env.get_wrapper_attr("actions"),
        fields=env.get_wrapper_attr("fields"),
        outcomes=tuple(
            tuple(((1.0, after),) for after in row) for row in moves.T.tolist()
        ),
        over=np.zeros(places, np.bool_),
        start=np.full(places, 1 / places),
        goals=np.arange(places) == 0,
    )


def _of_table(env: gymnasium.Env[Any, Any]) -> Stage:
    """Return one of Gymnasium's toy texts, which have a table, or a maze."""
    inner: Any = env.unwrapped
    if env.has_wrapper_attr("P"):
        table, start = inner.P, inner.initial_state_distrib
        state_of = env.get_wrapper_attr("state_of")
        states = [state_of(state, {}) for state in table]
    else:
        table, states = maze_table(env)
        start = [1.0]
    begin = {
        (state, False): float(share) for state, share in enumerate(start) if share > 0
    }
    found: dict[tuple[int, bool], list[dict[tuple[int, bool], float]]] = {}
    over_the_cliff: set[tuple[tuple[int, bool], int, tuple[int, bool]]] = set()
    frontier = list(begin)
    while frontier:
        place = frontier.pop()
        if place in found:
            continue
        found[place] = rows = []
        for action, outcomes in table[place[0]].items():
            row: dict[tuple[int, bool], float] = {}
            for chance, state, reward, over in outcomes:
                after = int(state), bool(over)
                row[after] = row.get(after, 0.0) + float(chance)
                if reward <= _FALL and not place[1]:
                    over_the_cliff.add((place, int(action), after))
            rows.append(row)
            if not place[1]:
                frontier.extend(row)
    places = sorted(found)
    number = {place: k for k, place in enumerate(places)}
    # Where it is over, no action does anything.
    stay = ((1.0, -1),)
    seen = [states[state] for state, _ in places]
    sensors = env.get_wrapper_attr("definitions")
    fields = np.array([[sensor(one) for one in seen] for sensor in sensors])
    names = env.get_wrapper_attr("sensors")
    over = np.array([ends for _, ends in places])
    fatal = np.any(fields[[name in _FATAL for name in names]], axis=0)
    return Stage(
        sensors=names,
        actions=env.get_wrapper_attr("actions"),
        fields=fields,
        outcomes=tuple(
            tuple(
                stay
                if place[1]
                else tuple((chance, number[after]) for after, chance in row.items())
                for row in found[place]
            )
            for place in places
        ),
        over=over,
        start=np.array([begin.get(place, 0.0) for place in places]),
        goals=over & ~fatal,
        falls=frozenset(
            (number[place], action, number[after])
            for place in places
            if not place[1]
            for action, row in enumerate(found[place])
            for after in row
            if fatal[number[after]] or (place, action, after) in over_the_cliff
        ),
    )


def maze_table(
    env: gymnasium.Env[Any, Any],
) -> tuple[dict[int, dict[int, Any]], list[MazeStanding]]:
    """Return a table, as of the toy texts, of a maze of MiniGrid, and its states.

    Every action is tried in a copy of the maze, wherever one can get to. States are
    numbered as they are found, from the one it begins in.
    """
    env.reset()
    actions = [ACTIONS.index(name) for name in env.get_wrapper_attr("actions")]
    mazes: list[Any] = [env.unwrapped]
    number = {_told_apart_by(env.unwrapped): 0}
    table: dict[int, dict[int, Any]] = {}
    for state, maze in enumerate(mazes):
        stay = [(1.0, state, 0.0, True)]
        table[state] = dict.fromkeys(range(len(actions)), stay)
        for place, action in enumerate(actions):
            if standing(maze).tile == "goal":
                break
            # Walls are not copied: they do not change, and there are many.
            walls = {id(x): x for x in maze.grid.grid if x and x.type == "wall"}
            after = deepcopy(maze, walls)
            over = after.step(action)[2]
            reached = number.setdefault(_told_apart_by(after), len(mazes))
            if reached == len(mazes):
                mazes.append(after)
            table[state][place] = [(1.0, reached, float(over), over)]
    return table, [standing(maze) for maze in mazes]


def _told_apart_by(maze: Any) -> tuple[MazeStanding, bytes]:  # noqa: ANN401
    """Return where the agent of a maze is, and all that is in the grid."""
    return standing(maze), maze.grid.encode().tobytes()
