"""Worlds in which some places look alike, as tables."""

from collections.abc import Mapping, Sequence

import gymnasium
import numpy as np

from tools.paper.worlds_as_tables import Stage, StageEnv

NAME = "tests.support.aliased_worlds:TMaze-v0"
RING = "tests.support.aliased_worlds:Ring-v0"


def t_maze(delay: int = 0) -> Stage:
    """Return a T-maze: what is seen at the start tells where the food is.

    At the junction nothing tells, except what one has come from. There one may stay,
    and on the way, where nothing is sensed for so many steps as the delay.
    """
    ways = "left", "right"
    corridor = {
        f"{step}, {way}": (
            (),
            (f"{step + 1}, {way}" if step < delay else f"junction, {way}", None, None),
        )
        for way in ways
        for step in range(1, delay + 1)
    }
    first = "1" if delay else "junction"
    return _table(
        ("at_start", "light", "at_junction", "food", "nothing"),
        ("forward", "left", "right"),
        {
            "start, light": (("at_start", "light"), (f"{first}, left", None, None)),
            "start, dark": (("at_start",), (f"{first}, right", None, None)),
            "junction, left": (("at_junction",), (None, "food", "nothing")),
            "junction, right": (("at_junction",), (None, "nothing", "food")),
            "food": (("food",), ()),
            "nothing": (("nothing",), ()),
            **corridor,
        },
        starts=2,
    )


def ring(places: int, beacons: Sequence[int]) -> Stage:
    """Return a ring of which only the places with beacons can be told apart."""
    table = {
        str(place): (
            (f"beacon_{place}",) if place in beacons else (),
            (str((place - 1) % places), str((place + 1) % places)),
        )
        for place in range(places)
    }
    sensors = tuple(f"beacon_{place}" for place in beacons)
    return _table(sensors, ("left", "right"), table, starts=places)


def room(rows: int, columns: int, seed: int) -> Stage:
    """Return a room of which only a colour is seen, of four: each place has any."""
    colours = np.random.default_rng(seed).integers(0, 4, (rows, columns)).tolist()

    def name(row: int, column: int) -> str | None:
        inside = 0 <= row < rows and 0 <= column < columns
        return f"{row}, {column}" if inside else None

    table = {
        f"{row}, {column}": (
            (f"colour_{colours[row][column]}",),
            tuple(
                name(row + down, column + right)
                for down, right in ((0, -1), (0, 1), (-1, 0), (1, 0))
            ),
        )
        for row in range(rows)
        for column in range(columns)
    }
    sensors = tuple(f"colour_{number}" for number in range(4))
    actions = "left", "right", "up", "down"
    return _table(sensors, actions, table, starts=len(table))


def _table(
    sensors: tuple[str, ...],
    actions: tuple[str, ...],
    places: Mapping[str, tuple[tuple[str, ...], tuple[str | None, ...]]],
    starts: int,
) -> Stage:
    """Return a stage.

    Args:
        sensors: Their names.
        actions: Their names.
        places: By name: what is on there, and where each action leads, None if nowhere;
            no action at all: the episode is over there.
        starts: How many of the first places it may begin at.
    """
    names = list(places)
    here = range(len(names))
    return Stage(
        sensors=sensors,
        actions=actions,
        fields=np.array(
            [[name in on for on, _ in places.values()] for name in sensors]
        ),
        outcomes=tuple(
            tuple(
                ((1.0, place if after is None else names.index(after)),)
                for after in (places[names[place]][1] or (None,) * len(actions))
            )
            for place in here
        ),
        over=np.array([not ways for _, ways in places.values()]),
        start=np.array([1 / starts * (place < starts) for place in here]),
        goals=np.zeros(len(names), np.bool_),
    )


class TMaze(StageEnv):
    """The T-maze as an environment."""

    def __init__(self, delay: int = 0) -> None:
        super().__init__(t_maze(delay))


class Ring(StageEnv):
    """A ring with two beacons as an environment."""

    def __init__(self, places: int) -> None:
        super().__init__(ring(places, (0, places // 2)))


for _made in TMaze, Ring:
    gymnasium.register(f"{_made.__name__}-v0", f"{__name__}:{_made.__name__}")
