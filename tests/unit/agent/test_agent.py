"""The agent in one process: its inputs, its outputs and its learning."""

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.policy_kinds import Walker, new_policy
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.sensorium import Sensorium
from tests.support.strategies import as_set
from world.path_and_cycle import PathWorld
from world.worlds_with_targets import Target

BODY = Body.full(["a", "b"], ["x", "y"])


def agent(kind: AgentKind = "walker", seed: int = 0, body: Body = BODY) -> Agent:
    target = ["a"] if kind == "planner" else []
    return Agent(body, new_policy(kind, body, seed, target=target))


class TestActing:
    @pytest.mark.parametrize(
        ("bits", "known", "says"),
        [
            ([1], None, "observation: must hold 2 bits, one a sensor, got (1,)"),
            ([1, np.nan], None, "observation: must be 0 or 1 (at 1), got nan"),
            ([1, 0], np.ones(3, np.bool_), "known: must hold 2 flags, one a sensor"),
            ([1, 0], np.ones(2), "known: must be bool, got dtype('float64')"),
            ([1, 0], np.zeros(2, np.bool_), "known: must hold one at least, got [Fal"),
        ],
    )
    def test_what_cannot_be_observed_is_refused_and_changes_nothing(
        self, bits: list[float], known: Any, says: str
    ) -> None:
        acting, other = agent(), agent()
        for one in (acting, other):
            assert one.decision.tick == 0
            assert one.act([1, 0]).tick == 1
        with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}"):
            acting.act(bits, known=known)
        assert acting.decision == other.decision
        assert acting.act([0, 1]) == other.act([0, 1])
        assert (acting.state == other.state).all()
        assert acting.snapshot.clock == 2

    def test_a_body_without_actions_only_watches(self) -> None:
        body = Body.full(["a", "b"], [])
        watching = Agent(body, Walker(0, 1))
        for _ in range(3):
            assert watching.act([1, 0]).action == -1
        assert as_set(watching.state) == {0, 3}

    def test_what_is_known_may_be_said_in_the_same_array_again(self) -> None:
        acting, other = agent("planner"), agent("planner")
        known = np.zeros(2, np.bool_)
        for tick in range(12):
            known[:] = tick % 3 > 0, tick % 3 != 1
            bits = [tick % 2, tick % 5 > 0]
            assert acting.act(bits, known=known) == other.act(bits, known=known.copy())
        assert acting.snapshot.to_bytes() == other.snapshot.to_bytes()

    def test_a_snapshot_of_another_size_is_refused(self) -> None:
        rule = r"^snapshot: must have 12 sensors, as the body, got 2$"
        with pytest.raises(ShapeError, match=rule):
            Agent(BODY, Walker(2, 0), EmpiricalSnapshot(2))


class TestConsequences:
    def test_an_action_goes_by_its_name_and_by_its_number(self) -> None:
        literal = Sensorium(BODY.sensors).literal
        for number, name in enumerate(BODY.actions):
            assert as_set(agent().consequences(name)) == {literal(name)}
            assert as_set(agent().consequences(number)) == {literal(name)}

    @pytest.mark.parametrize("action", ["z", "", -1, 2])
    def test_an_action_that_does_not_exist_is_refused(self, action: int | str) -> None:
        says = re.escape(f"action: must be one of x, y, got {action!r}")
        with pytest.raises(InvalidValueError, match=f"^{says}$"):
            agent().consequences(action)


class TestOf:
    def test_it_takes_names_orders_and_actions_from_the_environment(self) -> None:
        env: Any = Target(PathWorld(), 0)
        body = Body.full(env.sensors, env.get_wrapper_attr("actions"), env.orders)
        assert Agent.of(env, "excited").body == body
        env.observation_space = Discrete(4)
        with pytest.raises(
            InvalidValueError, match=r"^PathWorld: observation space: m"
        ):
            Agent.of(env, "walker")


class Doors(gymnasium.Env[Any, Any]):
    """Two doors with a prize behind one of them; the left, as often as it is told.

    One who took a door sees nothing of it but the prize; then it is over.
    """

    sensors, actions = ("there", "prize"), ("go", "left", "right")

    def __init__(self, left: float) -> None:
        self.observation_space, self.action_space = MultiBinary(2), Discrete(3)
        self.left = left
        self._there = False

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self._there = False
        return np.array([0, 0], np.int8), {}

    def step(self, action: int) -> Any:
        prize = bool(self.np_random.random() < self.left)
        prize = self._there and action > 0 and prize == (action == 1)
        over = self._there and action > 0
        self._there = self._there or action == 0
        seen = np.array([self._there, prize], np.int8)
        return seen, float(prize), over, False, {}


@pytest.mark.parametrize(("left", "door"), [(0.7, 1), (0.3, 2)])
def test_what_it_prefers_comes_as_often_as_it_can(left: float, door: int) -> None:
    env = Doors(left)
    going = Agent.of(env, "planner", grow=9, imagine=True, seed=1)
    going.learn(env, 400, seed=1)
    going.aim({"prize": 1.0})
    going.set_down()
    assert going.act([0, 0], begins=True).action == 0
    decision = going.act([1, 0])
    assert decision.action == door
    told = re.fullmatch(r"expects (0\.\d+) of what it prefers: \w+", decision.why)
    assert told is not None
    assert abs(float(told[1]) - 0.7) < 0.15
    going.aim({"prize": -1.0})
    going.set_down()
    assert going.act([1, 0], begins=True).action == 0  # takes neither


def test_where_nothing_is_known_what_is_preferred_is_looked_for() -> None:
    env = Doors(0.9)
    going = Agent.of(
        *(env, "planner"),
        prefer={"prize": 1.0},
        explore="planned",
        grow=9,
        imagine=True,
        seed=1,
    )
    going.run(env, 300, seed=1)
    walking = Agent.of(env, "walker", seed=1).run(env, 300, seed=2)
    assert going.run(env, 300, seed=2).reward > 1.5 * walking.reward > 0
