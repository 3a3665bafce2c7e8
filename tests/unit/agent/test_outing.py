"""Agents that act by themselves: episodes, rewards, targets and what is left out."""

import re
from typing import Any

import gymnasium
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.environment import Continuing, Outing
from neurosnap.errors import InvalidValueError
from world.toy_text import cliff_walking, frozen_lake


def explorer(**options: Any) -> Agent:
    return Agent.of(frozen_lake(), "planner", grow=True, imagine=True, **options)


def test_it_acts_for_so_many_steps_and_counts_episodes_and_rewards() -> None:
    agent = Agent.of(cliff_walking(), "walker", seed=3)
    outing = agent.run(cliff_walking(), 50, seed=1)
    assert outing.steps == 50
    assert not outing.reached
    assert outing.reward <= -50
    # What the last step led to is observed as well.
    assert agent.snapshot.clock == 51


def test_after_it_has_learned_it_can_be_sent_anywhere() -> None:
    agent, env = explorer(seed=1), frozen_lake()
    learned = agent.learn(env, 700, seed=1)
    assert learned.steps == 700
    assert learned.episodes > 1
    goal = agent.send(env, ["tile=goal"], 100)
    assert goal == Outing(6, 1, 1.0, True)
    # Another target without learning again.
    corner = agent.send(env, ["row<1", "column<3*"], 100)
    assert (corner.steps, corner.reached) == (3, True)
    nowhere = agent.send(env, ["tile=hole", "tile=goal"], 30)
    assert (nowhere.steps, nowhere.reached) == (30, False)


def test_to_learn_or_to_be_sent_leaves_the_policy_as_it_was() -> None:
    agent, env = Agent.of(frozen_lake(), "walker", seed=2, grow=True), frozen_lake()
    agent.learn(env, 100)
    agent.send(env, ["row<1*"], 5)
    agent.run(env, 3)
    assert agent.decision.why == "random walk"


def test_a_plan_to_explore_is_not_followed_by_whoever_wants_something_else() -> None:
    agent, env = explorer(seed=1, target=["tile=goal"]), frozen_lake()
    for steps in range(1, 6):
        agent.learn(env, steps)
        experience = agent._mind.memory.experience
        assert experience is not None
        assert experience.plan is None


def test_actions_can_be_left_out() -> None:
    agent = Agent.of(cliff_walking(), "walker", without=["down", "left"])
    assert agent.body.actions == ("up", "right")
    env = Counted(cliff_walking())
    agent.run(env, 40)
    assert env.taken == {0, 1}


class Counted(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Keeps which actions were taken."""

    def __init__(self, env: gymnasium.Env[Any, Any]) -> None:
        super().__init__(env)
        self.taken: set[int] = set()

    def step(self, action: Any) -> Any:
        self.taken.add(int(action))
        return super().step(action)


def test_an_episode_that_was_cut_off_is_no_end() -> None:
    env = Continuing(gymnasium.wrappers.TimeLimit(cliff_walking(), 5))
    agent = Agent.of(env, "walker", grow=True, without=["right"])
    agent.run(env, 60)  # the goal is not reached without going right
    experience = agent._mind.memory.experience
    assert experience is not None
    assert experience.ends == set()


def test_where_episodes_end_is_remembered() -> None:
    agent, env = explorer(seed=1), frozen_lake()
    agent.learn(env, 300)
    experience = agent._mind.memory.experience
    assert experience is not None
    assert 1 < len(experience.ends) <= 5  # four holes and the goal


@pytest.mark.parametrize("names", [["left"], ["up", "right", "down", "left"], ["fly"]])
def test_only_some_of_its_actions_can_be_left_out(names: list[str]) -> None:
    if names == ["left"]:
        assert len(Agent.of(cliff_walking(), "walker", without=names).body.actions) == 3
        return
    rule = "without: must be some of up, right, down, left, and not all, got"
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        Agent.of(cliff_walking(), "walker", without=names)


def test_who_does_not_imagine_cannot_be_sent() -> None:
    agent = Agent.of(frozen_lake(), "walker")
    rule = "agent: must be one that imagines or grows sensors, got"
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        agent.send(frozen_lake(), ["tile=goal"])
    with pytest.raises(InvalidValueError, match=r"^imagine: must go with a planner"):
        Agent.of(frozen_lake(), "walker", imagine=True)
    with pytest.raises(InvalidValueError, match=r"^steps: must be 0 or more, got -1"):
        agent.run(frozen_lake(), -1)
