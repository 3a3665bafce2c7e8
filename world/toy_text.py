"""Gymnasium's toy-text environments, seen through binary sensors.

Their episodes end as Gymnasium's do, but there is no limit on time: with one, what
happens next would depend on more than the state. No sensor is always on or always off.
What is true of the sensors follows from their transition tables.
"""

from typing import Any, NamedTuple

from gymnasium.envs.toy_text.cliffwalking import CliffWalkingEnv
from gymnasium.envs.toy_text.frozen_lake import FrozenLakeEnv
from gymnasium.envs.toy_text.taxi import TaxiEnv

from neurosnap.agent.binary_sensors import BinarySensors, Environment
from neurosnap.agent.sensor import Attribute, one_hot, rewarded, thresholds

_LETTERS = {b"S": "start", b"F": "frozen", b"H": "hole", b"G": "goal"}
_STOPS = ("red", "green", "yellow", "blue")


class TilePlace(NamedTuple):
    """Where the walker is, and on what."""

    row: int
    """Counted from 0 at the top."""
    column: int
    """Counted from 0 at the left."""
    tile: str
    """What the place is: ``start``, ``goal``, ``hole``, ...; elsewhere ground."""


class Fare(NamedTuple):
    """Where the taxi is, where its passenger is, and where the passenger is to go."""

    row: int
    """Counted from 0 at the top."""
    column: int
    """Counted from 0 at the left."""
    passenger: str
    """One of the stops ``red``, ``green``, ``yellow``, ``blue``; or ``taxi``."""
    destination: str
    """One of the stops."""


def frozen_lake(
    render_mode: str | None = None,
    desc: list[str] | None = None,
    map_name: str = "4x4",
    is_slippery: bool = False,
    senses_reward: bool = False,
) -> BinarySensors:
    """Return Gymnasium's FrozenLake.

    Description:
        A walk on the ice, among holes, to a goal.

    Sensors:
        ``row<1``, ``row<2``, ...; ``column<1``, ...; ``tile=start``, ``tile=hole``,
        ``tile=goal``. 9 on the map of 4 times 4. If asked for, ``rewarded``: the last
        step was.

    Actions:
        ``left``, ``down``, ``right``, ``up``.

    Start:
        A start tile.

    Reward:
        1 at the goal, 0 elsewhere.

    End:
        In a hole, and at the goal.

    Info:
        ``prob``: of the move.

    Args:
        render_mode: As in Gymnasium, and so are the others.
        desc: A map of one's own.
        map_name: ``4x4`` or ``8x8``.
        is_slippery: Whether a move may go sideways; not, unless asked for.
        senses_reward: Whether there is the sensor ``rewarded``.
    """
    lake = FrozenLakeEnv(render_mode, desc, map_name, is_slippery)
    sensors = (
        *thresholds("row", range(1, lake.nrow), of=Attribute("row")),
        *thresholds("column", range(1, lake.ncol), of=Attribute("column")),
        *one_hot("tile", ("start", "hole", "goal"), of=Attribute("tile")),
        *([rewarded()] if senses_reward else ()),
    )
    actions = ("left", "down", "right", "up")
    return BinarySensors(lake, sensors, _on_the_lake, actions)


def cliff_walking(
    render_mode: str | None = None, is_slippery: bool = False
) -> BinarySensors:
    """Return Gymnasium's CliffWalking.

    Description:
        A walk on 4 rows of 12, from the bottom left to the bottom right; what lies
        between them is a cliff, and a step over it leads back to the start.

    Sensors:
        ``row<1`` to ``row<3``; ``column<1`` to ``column<11``; ``tile=start``,
        ``tile=goal``. 16 in all.

    Actions:
        ``up``, ``right``, ``down``, ``left``.

    Start:
        The bottom left.

    Reward:
        -1 a step, -100 for one over the cliff.

    End:
        At the goal.

    Info:
        ``prob``: of the move.

    Args:
        render_mode: As in Gymnasium, and so is the other.
        is_slippery: Whether a move may go sideways.
    """
    cliff = CliffWalkingEnv(render_mode, is_slippery)
    rows, columns = cliff.shape
    sensors = (
        *thresholds("row", range(1, rows), of=Attribute("row")),
        *thresholds("column", range(1, columns), of=Attribute("column")),
        *one_hot("tile", ("start", "goal"), of=Attribute("tile")),
    )
    actions = ("up", "right", "down", "left")
    return BinarySensors(cliff, sensors, _on_the_cliff, actions)


def taxi(
    render_mode: str | None = None, is_rainy: bool = False, senses_reward: bool = False
) -> BinarySensors:
    """Return Gymnasium's Taxi.

    Description:
        A taxi on a grid of 5 times 5 with walls, a passenger to be fetched at one of
        four stops and taken to another.

    Sensors:
        ``row<1`` to ``row<4``; ``column<1`` to ``column<4``; ``passenger=red``,
        ``=green``, ``=yellow``, ``=blue``, ``=taxi``; ``destination=red``, ``=green``,
        ``=yellow``, ``=blue``. 17 in all. If asked for, ``rewarded``: the last step
        was.

    Actions:
        ``south``, ``north``, ``east``, ``west``, ``pickup``, ``dropoff``.

    Start:
        Drawn uniformly from the 300 states with the passenger at a stop that is not the
        destination.

    Reward:
        20 for the delivery, -10 for picking up or dropping off where it cannot be done,
        -1 for any other step.

    End:
        With the delivery.

    Info:
        ``prob``: of the move; ``action_mask``: which actions change the state.

    Args:
        render_mode: As in Gymnasium, and so is the next.
        is_rainy: Whether a move may go sideways.
        senses_reward: Whether there is the sensor ``rewarded``.
    """
    cab = TaxiEnv(render_mode, is_rainy)
    sensors = (
        *thresholds("row", range(1, cab.max_row + 1), of=Attribute("row")),
        *thresholds("column", range(1, cab.max_col + 1), of=Attribute("column")),
        *one_hot("passenger", (*_STOPS, "taxi"), of=Attribute("passenger")),
        *one_hot("destination", _STOPS, of=Attribute("destination")),
        *([rewarded()] if senses_reward else ()),
    )
    actions = ("south", "north", "east", "west", "pickup", "dropoff")
    return BinarySensors(cab, sensors, _in_town, actions)


def _on_the_lake(env: Environment, observation: int, _: dict[str, Any]) -> TilePlace:
    lake: Any = env.unwrapped
    row, column = divmod(int(observation), lake.ncol)
    return TilePlace(row, column, _LETTERS[bytes(lake.desc[row, column])])


def _on_the_cliff(env: Environment, observation: int, _: dict[str, Any]) -> TilePlace:
    cliff: Any = env.unwrapped
    rows, columns = cliff.shape
    row, column = divmod(int(observation), columns)
    corners = {cliff.start_state_index: "start", rows * columns - 1: "goal"}
    return TilePlace(row, column, corners.get(int(observation), "ground"))


def _in_town(env: Environment, observation: int, _: dict[str, Any]) -> Fare:
    cab: Any = env.unwrapped
    row, column, passenger, destination = cab.decode(int(observation))
    return Fare(row, column, (*_STOPS, "taxi")[passenger], _STOPS[destination])
