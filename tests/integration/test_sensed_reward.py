"""The reward of a step as a sensor and as the agent's target."""

from typing import Any

import gymnasium
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.environment import Continuing
from neurosnap.agent.sensor import Sensor, Trajectory, one_hot, rewarded
from neurosnap.errors import InvalidValueError
from world.toy_text import frozen_lake

DOWN, RIGHT = 1, 2
WAY = (DOWN, DOWN, RIGHT, RIGHT, DOWN, RIGHT)  # from the start of the lake to its goal


def fell(reward: float) -> bool:
    return reward <= -100


@pytest.mark.parametrize("outside", [False, True])
def test_at_the_beginning_of_an_episode_nothing_was_rewarded(outside: bool) -> None:
    sensors = [rewarded(), *one_hot("place", [0])]
    lake = gymnasium.make("FrozenLake-v1", is_slippery=False)
    env: gymnasium.Env[Any, Any]
    if outside:
        env = Continuing(BinarySensors(lake, sensors))
    else:
        env = BinarySensors(Continuing(lake), sensors)
    env.reset(seed=0)
    assert [env.step(action)[0].tolist() for action in WAY][-1] == [1, 0]
    assert env.step(DOWN)[0].tolist() == [0, 1]


def test_any_predicate_may_read_it() -> None:
    sensors = [Sensor("fell", fell, order=1, of_reward=True), rewarded("fine", -1.5)]
    env = BinarySensors(gymnasium.make("CliffWalking-v1"), sensors)
    env.reset(seed=0)
    assert env.step(0)[0].tolist() == [0, 1]  # up
    env.step(1)
    assert env.step(2)[0].tolist() == [1, 0]  # and down the cliff


def test_what_reads_a_reward_looks_back_one_step_and_gets_one_number() -> None:
    with pytest.raises(InvalidValueError, match=r"^order: must be 1 for a reward, got"):
        Sensor("fell", fell, of_reward=True)
    trajectory = Trajectory([rewarded()])
    assert trajectory.begin(3).tolist() == [False]
    assert trajectory.extend(3, 0.5).tolist() == [True]
    assert trajectory.extend(3).tolist() == [False]


def test_an_agent_goes_where_it_was_rewarded() -> None:
    env = frozen_lake(senses_reward=True)
    agent = Agent.of(env, "planner", grow=True, imagine=True, seed=1)
    agent.learn(env, 700, seed=1)
    outing = agent.send(env, ["rewarded"], 50)
    assert (outing.steps, outing.reached, outing.reward) == (6, True, 1.0)
