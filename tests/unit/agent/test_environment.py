"""Environments: their descriptions, and agents that act in them."""

import dataclasses
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space

from neurosnap.agent.agent import Agent
from neurosnap.agent.environment import Continuing, Description, Outing, describe
from neurosnap.agent.experience import Experience
from neurosnap.errors import InvalidValueError
from neurosnap.sources.gymnasium_source import import_worlds
from world.toy_text import cliff_walking, frozen_lake


class Said(gymnasium.Env[Any, Any]):
    """Says whatever it is given, and is never reset or stepped."""

    def __init__(
        self,
        observes: Space[Any] | None = None,
        acts: Space[Any] | None = None,
        **attributes: object,
    ) -> None:
        self.observation_space = MultiBinary(2) if observes is None else observes
        self.action_space = Discrete(2) if acts is None else acts
        for name, value in attributes.items():
            setattr(self, name, value)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        raise AssertionError("reset")

    def step(self, action: Any) -> Any:
        raise AssertionError("step")


class Named(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A wrapper has the last word."""

    sensors = ("c", "d")
    actions = ("x", "y")


NUMBERED = Description(
    sensors=("s0", "s1"),
    orders=(0, 0),
    actions=("action_0", "action_1"),
    start=0,
    discrete=True,
)


@pytest.mark.parametrize(
    ("env", "said"),
    [
        pytest.param(Said(), {}, id="nothing"),
        *(
            pytest.param(
                Said(
                    acts=Discrete(2, start=4),
                    sensors=several(["door", "smell"]),
                    orders=several([0, 1]),
                    actions=several(["go", "stay"]),
                ),
                {
                    "sensors": ("door", "smell"),
                    "orders": (0, 1),
                    "actions": ("go", "stay"),
                    "start": 4,
                },
                id=f"each as a {several.__name__}",
            )
            for several in (tuple, list)
        ),
        pytest.param(
            Named(Said(sensors=("a", "b"), orders=(1, 0))),
            {"sensors": ("c", "d"), "orders": (1, 0), "actions": ("x", "y")},
            id="a wrapper",
        ),
        *(
            pytest.param(Said(actions=foreign), {}, id=f"actions={foreign!r}"[:30])
            for foreign in (
                *(None, 3, [], ["x"], ["x", "y", "z"], [0, 1], ["x", 1]),
                *({"x": 0, "y": 1}, np.array([0, 1]), "longer", len),
            )
        ),
        # They come in no order that lasts.
        pytest.param(Said(actions={"x", "y"}), {}, id="actions in a set"),
    ],
)
def test_what_it_says_is_taken_over_and_else_it_has_numbers(
    env: Any, said: dict[str, Any]
) -> None:
    assert describe("w", env) == dataclasses.replace(NUMBERED, **said)


NO_WORLD = (
    "must be MultiBinary with one axis (wrap the environment in "
    "neurosnap.BinarySensors, which makes sensors of what it shows), got "
)
NO_ACTIONS = "must be Discrete, got "
NO_ORDERS = "must be 2 whole numbers from 0 up, got "


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"sensors": ("a",)}, "sensors: must be a sequence of 2 names, got ('a',)"),
        ({"sensors": 7}, "sensors: must be a sequence of 2 names, got 7"),
        ({"sensors": ("a", "a")}, "names: must be unique, got 'a'"),
        ({"sensors": ("a", 1)}, "sensor name: must be text, got 1"),
        ({"sensors": ("a", "b*")}, "sensor name: must not end with *, got 'b*'"),
        ({"actions": ("x", "x")}, "names: must be unique, got 'x'"),
        ({"actions": ("x", "")}, "sensor name: must not be empty, got ''"),
        *(
            ({"orders": orders}, f"orders: {NO_ORDERS}{orders!r}")
            for orders in [(0,), (0, -1), (0, 0.5), (0, True), 0]
        ),
        *(
            ({"observes": space}, f"observation space: {NO_WORLD}{space!r}")
            for space in (
                *(Box(0, 1, (2,)), Discrete(4), MultiBinary((2, 2))),
                Dict({"a": MultiBinary(2)}),
            )
        ),
        *(
            ({"acts": space}, f"action space: {NO_ACTIONS}{space!r}")
            for space in (Box(0, 1, (2,)), MultiBinary(2), MultiDiscrete([2, 2]))
        ),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], says: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^w: {re.escape(says)}$"):
        describe("w", Said(**given))


def test_where_it_is_there_with_sensors_the_refusal_names_it() -> None:
    import_worlds()
    lake = gymnasium.make("FrozenLake-v1")
    with pytest.raises(InvalidValueError, match=r"; or take neurosnap/FrozenLake-v0\)"):
        describe("FrozenLake-v1", lake)


# Agents that act by themselves --------------------------------------------------------


def experience_of(agent: Agent) -> Experience:
    experience = agent._mind.memory.experience
    assert experience is not None
    return experience


def test_it_acts_for_so_many_steps_and_counts_episodes_and_rewards() -> None:
    agent = Agent.of(cliff_walking(), "walker", seed=3)
    outing = agent.run(cliff_walking(), 50, seed=1)
    assert outing.steps == 50
    assert not outing.reached
    assert outing.reward <= -50
    # What the last step led to is observed as well; what is decided then is not done.
    assert agent.snapshot.clock == 51
    assert agent.decision.action == -1


def test_after_it_has_learned_it_can_be_sent_anywhere() -> None:
    explorer = Agent.of(frozen_lake(), "planner", grow=True, imagine=True, seed=1)
    learned = explorer.learn(frozen_lake(), 700, seed=1)
    assert learned.steps == 700
    assert learned.episodes > 1
    assert 1 < len(experience_of(explorer).ends) <= 5  # four holes and the goal
    env = frozen_lake()
    assert explorer.send(env, ["tile=goal"], 100) == Outing(6, 1, 1.0, True)
    # Another target without learning again.
    corner = explorer.send(env, ["row<1", "column<3*"], 100)
    assert (corner.steps, corner.reached) == (3, True)
    nowhere = explorer.send(env, ["tile=hole", "tile=goal"], 30)
    assert (nowhere.steps, nowhere.reached) == (30, False)


def test_one_that_is_not_shown_how_episodes_end_still_arrives() -> None:
    agent = Agent.of(frozen_lake(), "planner", grow=True, imagine=True, seed=1)
    agent.learn(frozen_lake(), 700, seed=1)
    agent.aim(["tile=goal"])
    env = frozen_lake()
    for _ in range(5):
        bits, _ = env.reset()
        begins, over, steps, total = True, False, 0, 0.0
        while not over:
            decision = agent.act(bits, begins)
            bits, reward, over, _, _ = env.step(decision.action)
            begins, steps, total = False, steps + 1, total + float(reward)
        assert (total, steps) == (1, 6)


def test_to_learn_or_to_be_sent_leaves_the_policy_as_it_was() -> None:
    agent, env = Agent.of(frozen_lake(), "walker", seed=2, grow=True), frozen_lake()
    for steps in (1, 2, 97):
        agent.learn(env, steps)
        assert experience_of(agent).plan is None  # one to explore is not followed
    agent.send(env, ["row<1*"], 5)
    agent.run(env, 3)
    assert agent.decision.why == "random walk"


def test_an_episode_that_was_cut_off_is_no_end() -> None:
    # Too short to get to the goal, where an episode comes to an end.
    env = Continuing(gymnasium.wrappers.TimeLimit(cliff_walking(), 5))
    agent = Agent.of(env, "walker", grow=True)
    assert agent.run(env, 60).episodes > 5
    assert experience_of(agent).ends == set()


def test_an_agent_that_does_not_imagine_cannot_be_sent() -> None:
    agent = Agent.of(frozen_lake(), "walker")
    rule = "agent: must be one that imagines or grows sensors, got"
    with pytest.raises(InvalidValueError, match=re.escape(rule)):
        agent.send(frozen_lake(), ["tile=goal"])
    with pytest.raises(InvalidValueError, match=r"^imagine: must go with a planner"):
        Agent.of(frozen_lake(), "walker", imagine=True)
    with pytest.raises(InvalidValueError, match=r"^steps: must be 0 or more, got -1"):
        agent.run(frozen_lake(), -1)
