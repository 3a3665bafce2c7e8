"""Gymnasium's toy-text environments: sensor readings, and what agents learn."""

from collections import Counter
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from neurosnap.agent.environment import describe
from tests.support.taught_agents import (
    BEDS,
    Bed,
    Taught,
    attempt,
    distances,
    tile,
    walker,
)
from tests.support.transition_tables import Table, state_fields
from world.toy_text import cliff_walking, frozen_lake, taxi

VARIANTS: list[tuple[Bed, dict[str, Any]]] = [
    *((bed, {}) for bed in BEDS),
    (frozen_lake, {"map_name": "8x8"}),
    (frozen_lake, {"is_slippery": True}),
    (cliff_walking, {"is_slippery": True}),
    (taxi, {"is_rainy": True}),
]


# The checker would rather see the environment within, which has no binary sensors.
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
@pytest.mark.parametrize(("bed", "arguments"), VARIANTS)
def test_gymnasium_finds_nothing_wrong(bed: Bed, arguments: dict[str, Any]) -> None:
    entry = f"world.toy_text:{bed.__name__}"
    env = gymnasium.make(EnvSpec("neurosnap/Bed-v0", entry_point=entry), **arguments)
    check_env(env, skip_render_check=True)
    seen, plain = describe("bed", env), bed(**arguments)
    assert seen.sensors == plain.sensors
    assert seen.orders == (0,) * len(seen.sensors)
    assert len(seen.actions) == env.action_space.n  # type: ignore[attr-defined]
    # No sensor is always on, or always off.
    fields = state_fields(plain, Table.of(plain))
    assert fields.any(axis=1).all()
    assert not fields.all(axis=1).any()


def readings(bed: Bed) -> dict[str, set[int]]:
    """Return at which states of the table each sensor should be on, by arithmetic."""
    states = set(Table.of(bed()).states.tolist())
    width, rows = (4, 4) if bed is frozen_lake else (12, 4)
    tiles = {"start": {0}, "hole": {5, 7, 11, 12}, "goal": {15}}
    kinds = {f"tile={tile}": places for tile, places in tiles.items()}
    where = {s: divmod(s, width) for s in states}
    if bed is cliff_walking:
        kinds = {"tile=start": {36}, "tile=goal": {47}}
    if bed is taxi:
        width = rows = 5
        stops = ("red", "green", "yellow", "blue", "taxi")
        where = {s: (s // 100, s // 20 % 5) for s in states}
        kinds = {
            **{f"passenger={stop}": {s for s in states if s // 4 % 5 == k}
               for k, stop in enumerate(stops)},
            **{f"destination={stop}": {s for s in states if s % 4 == k}
               for k, stop in enumerate(stops[:4])},
        }  # fmt: skip
    return {
        **{f"row<{k}": {s for s in states if where[s][0] < k} for k in range(1, rows)},
        **{
            f"column<{k}": {s for s in states if where[s][1] < k}
            for k in range(1, width)
        },
        **kinds,
    }


@pytest.mark.parametrize("bed", BEDS)
def test_each_sensor_is_on_where_plain_arithmetic_says(bed: Bed) -> None:
    env, expected = bed(), readings(bed)
    table = Table.of(env)
    states, fields = table.states.tolist(), state_fields(env, table)
    assert list(expected) == list(env.sensors)
    for name, field in zip(env.sensors, fields, strict=True):
        assert {states[k] for k in field.nonzero()[0]} == expected[name]


DIRECTIONS = {
    "left": (0, -1),
    "right": (0, 1),
    "up": (-1, 0),
    "down": (1, 0),
    "west": (0, -1),
    "east": (0, 1),
    "north": (-1, 0),
    "south": (1, 0),
}


@pytest.mark.parametrize("bed", BEDS)
def test_actions_are_called_what_they_do(bed: Bed) -> None:
    env = bed()
    inner: Any = env.unwrapped
    # In the open: row 2, column 1 of the lake; row 1, column 2; row 2, column 2.
    state = {frozen_lake: 9, cliff_walking: 14, taxi: 241}[bed]
    for action, name in enumerate(env.actions):
        if name in DIRECTIONS:
            env.reset(seed=0)
            inner.s = state
            before = env.state_of(inner.s, {})
            env.step(action)
            after = env.state_of(inner.s, {})
            moved = (after.row - before.row, after.column - before.column)
            assert moved == DIRECTIONS[name]


def test_a_taxi_picks_up_and_drops_off() -> None:
    env = taxi()
    inner: Any = env.unwrapped
    env.reset(seed=0)
    inner.s = inner.encode(0, 4, 1, 2)  # at green, where the passenger is
    env.step(env.actions.index("pickup"))
    assert env.state_of(inner.s, {}) == (0, 4, "taxi", "yellow")
    env.step(env.actions.index("dropoff"))
    assert env.state_of(inner.s, {}) == (0, 4, "green", "yellow")


# What is learned ----------------------------------------------------------------------


# A planner on the lake and at the cliff -----------------------------------------------

HOLES = (5, 7, 11, 12)


def outcomes(who: Taught) -> tuple[Counter[str], list[float]]:
    """How a planner fares from everywhere to everywhere, and the steps too many."""
    table, found, extra = who.table, Counter[str](), []
    holes = {(state, True) for state in HOLES}
    for goal, place in enumerate(table.situations):
        if place in holes:
            continue
        kind = "goal" if place[1] else "tile"
        literals = ("tile=goal",) if place[1] else tile(who.env, *divmod(place[0], 4))
        at = who.at(literals)
        assert at.nonzero()[0].tolist() == [goal]
        far = distances(table, at)
        for start in (~table.over & ~at).nonzero()[0].tolist():
            way = attempt(who, start, at, "planner", literals)
            if way[-1] == place:
                found[f"{kind} reached"] += 1
                extra.append(len(way) - 1 - far[start])
            else:
                found[f"{kind} {'drowned' if way[-1] in holes else 'missed'}"] += 1
    return found, extra


def test_on_the_lake_the_planner_gets_there_or_falls_into_a_hole() -> None:
    found, extra = outcomes(walker(frozen_lake))
    # It never goes round and round; of 110 pairs of tiles it does 77.
    assert found == {
        "tile reached": 77,
        "tile drowned": 33,
        "goal reached": 4,
        "goal drowned": 7,
    }
    assert min(extra) == 0
    assert np.mean(np.array(extra) == 0) > 0.7


@pytest.mark.slow
def test_walking_by_the_cliff_the_planner_reaches_the_goal_from_everywhere() -> None:
    cliff = walker(cliff_walking)
    at = cliff.at(["tile=goal"])
    far = distances(cliff.table, at)
    for start in (~cliff.table.over).nonzero()[0].tolist():
        way = attempt(cliff, start, at, "planner", ["tile=goal"])
        assert way[-1] == (47, True)
        assert len(way) - 1 <= far[start] + 12
        # And does not fall: none of its steps leads from the edge to the start.
        edge = {(state, False) for state in range(25, 35)}
        assert not any(a in edge and b == (36, False) for a, b in pairwise(way))
