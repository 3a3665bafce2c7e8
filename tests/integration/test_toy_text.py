"""Worlds nobody made for us are what Gymnasium takes them for."""

from collections.abc import Callable
from typing import Any

import gymnasium
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.utils.env_checker import check_env

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.environment import describe
from tests.support.toy_text_beds import BEDS
from world.toy_text import cliff_walking, frozen_lake, taxi


# The checker would rather see the environment within, which has no binary sensors.
@pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version")
@pytest.mark.parametrize("bed", BEDS)
def test_gymnasium_finds_nothing_wrong(bed: Callable[..., BinarySensors]) -> None:
    spec = EnvSpec(id="neurosnap/Bed-v0", entry_point=f"world.toy_text:{bed.__name__}")
    env = gymnasium.make(spec)
    check_env(env, skip_render_check=True)
    seen = describe("bed", env)
    assert seen.sensors == bed().sensors
    assert seen.orders == (0,) * len(seen.sensors)
    assert len(seen.actions) == env.action_space.n  # type: ignore[attr-defined]


def test_their_sensors() -> None:
    lake = ("row<1", "row<2", "row<3", "column<1", "column<2", "column<3")
    assert frozen_lake().sensors == (*lake, "tile=start", "tile=hole", "tile=goal")
    assert len(frozen_lake(map_name="8x8").sensors) == 17
    cliff = cliff_walking().sensors
    assert cliff[:4] == ("row<1", "row<2", "row<3", "column<1")
    assert cliff[13:] == ("column<11", "tile=start", "tile=goal")
    cab = taxi().sensors
    assert cab[3:5] == ("row<4", "column<1")
    assert cab[8:] == (
        *("passenger=red", "passenger=green", "passenger=yellow", "passenger=blue"),
        *("passenger=taxi", "destination=red", "destination=green"),
        *("destination=yellow", "destination=blue"),
    )


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
def test_actions_are_called_what_they_do(bed: Callable[..., BinarySensors]) -> None:
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
    observation = env.step(env.actions.index("dropoff"))[0]
    assert env.state_of(inner.s, {}) == (0, 4, "green", "yellow")
    on = {name for name, bit in zip(env.sensors, observation, strict=True) if bit}
    rows = {"row<1", "row<2", "row<3", "row<4"}
    assert on == rows | {"passenger=green", "destination=yellow"}
