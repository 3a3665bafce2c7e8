"""The default threshold: the same in Python and in runs, and better than others."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, Tuple

from neurosnap.agent.agent import Agent
from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.body import Body
from neurosnap.agent.environment import describe
from neurosnap.agent.policy import EXACT, default_threshold
from neurosnap.agent.policy_kinds import new_policy
from neurosnap.agent.sensor import thresholds
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.protocol.run_options import RunOptions
from tests.support.exhaustive import rows
from tests.support.taught_agents import Taught, attempt, taught, tile
from world.toy_text import cliff_walking, frozen_lake

FULL = Body.full(["a"], ["x"])
USUAL = EmpiricalSnapshot.THRESHOLD


def angle(state: Any) -> Any:
    return state[2]


def turn(state: Any) -> Any:
    return state[3]


def cart_pole() -> BinarySensors:
    sensors = (
        *thresholds("angle", (-0.1, -0.05, 0, 0.05, 0.1), of=angle),
        *thresholds("turn", (-1, -0.5, 0, 0.5, 1), of=turn),
    )
    return BinarySensors(gymnasium.make("CartPole-v1"), sensors)


def test_the_rule() -> None:
    growing = Body.full(["a"], ["x"], room=1)
    walker = Body(own=("a",), actions=("x",))
    assert default_threshold(FULL, discrete=True) == EXACT
    assert default_threshold(FULL, discrete=False) == "auto"
    assert default_threshold(growing, discrete=False) == EXACT
    assert default_threshold(walker, discrete=True) == "auto"


@pytest.mark.parametrize(
    ("space", "discrete"),
    [
        (MultiBinary(2), True),
        (Discrete(3), True),
        (Box(0, 255, (2,), np.uint8), True),
        (Box(0, 1, (2,), np.float32), False),
        (Dict({"a": Discrete(2), "b": Tuple([Box(0, 1), Discrete(2)])}), False),
        (Dict({"a": Discrete(2), "b": Box(0, 9, (1,), np.int64)}), True),
    ],
)
def test_what_is_discrete(space: gymnasium.Space[Any], discrete: bool) -> None:
    env: gymnasium.Env[Any, Any] = gymnasium.Env()
    env.observation_space, env.action_space = space, Discrete(1)
    seen = BinarySensors(env, thresholds("a", [1]))
    assert describe("shown", seen).discrete == discrete


@pytest.mark.parametrize(
    ("more", "recorded"),
    [
        ({"agent.kind": "planner", "agent.target": "below_2"}, EXACT),
        ({"agent.kind": "excited"}, EXACT),
        ({"agent.kind": "excited", "snapshot.threshold": "auto"}, EXACT),
        ({"agent.kind": "walker"}, "auto"),
        ({"agent.kind": "excited", "snapshot.threshold": 0.02}, 0.02),
        ({"agent.kind": "excited", "snapshot.kind": "discounted"}, None),
    ],
)
def test_what_a_run_uses_is_in_its_options(
    more: dict[str, object], recorded: float | str | None
) -> None:
    source = {"kind": "world", "id": "neurosnap/Path-v0"}
    given = {"source": source, "recording.record": False, **more}
    options = prepare(load(None, given)).options
    assert options.threshold == recorded


def test_a_run_that_was_recorded_without_one_keeps_its_own() -> None:
    old = RunOptions(source="a", body=FULL, agent="planner", target=("a",))
    again = msgspec.json.decode(msgspec.json.encode(old), type=RunOptions)
    assert again.in_force == {"threshold": USUAL}


def test_in_python_it_is_the_same() -> None:
    discrete = Agent.of(cliff_walking(), "planner", target=["tile=goal"])
    assert discrete.snapshot.threshold == EXACT
    binned = Agent.of(cart_pole(), "planner", target=["angle<0"])
    assert binned.snapshot.threshold == "auto"
    growing = Agent.of(cart_pole(), "planner", target=["angle<0"], grow=True)
    assert growing.snapshot.threshold == EXACT
    assert describe("pole", cart_pole()).discrete is False


def arrivals(world: Taught, *goals: Sequence[str]) -> int:
    """Return how often a planner gets to a goal, from every start."""
    starts = (~world.table.over).nonzero()[0].tolist()
    found = 0
    for goal in goals:
        at = world.at(goal)
        ways = [attempt(world, start, at, "planner", goal) for start in starts]
        found += sum(bool(at[world.table.situations.index(way[-1])]) for way in ways)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("seed", rows([0], [1, 2]))
def test_on_the_lake_it_is_the_better_one(seed: int) -> None:
    def arrived(threshold: float) -> int:
        lake = taught(frozen_lake(), threshold, 5000, seed)
        goals = [tile(lake.env, *divmod(place, 4)) for place in (1, 4, 9, 10, 14)]
        return arrivals(lake, *goals)

    assert arrived(EXACT) > arrived(USUAL)


@pytest.mark.exhaustive
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_pole_is_balanced_longer_by_a_memory_that_allows_for_exceptions(
    seed: int,
) -> None:
    goal = ["angle<0.05", "angle<-0.05*", "turn<0.5", "turn<-0.5*"]

    def balanced(threshold: float | str) -> float:
        env = cart_pole()
        body = Body.full(env.sensors, ["left", "right"])
        snapshot = EmpiricalSnapshot(len(body.sensors), threshold)
        agent = Agent(body, new_policy("walker", body, seed), snapshot)
        steps = 0
        for learns in (True, False):
            if not learns:
                planner = new_policy("planner", body, seed, target=goal, explore=0.0)
                agent = Agent(body, planner, snapshot)
            count, episode = 0, 0
            while count < 10_000 if learns else episode < 20:
                bits, _ = env.reset(seed=1000 * seed + episode)
                agent.set_down()
                begins, ends = True, False
                while not ends:
                    action = agent.act(bits, begins).action
                    bits, _, over, cut, _ = env.step(action)
                    begins, ends, count = False, over or cut, count + 1
                episode += 1
            steps = count
        return steps / 20

    usual = balanced(USUAL)
    assert usual > 1.2 * balanced(EXACT)
    assert balanced("auto") > usual
