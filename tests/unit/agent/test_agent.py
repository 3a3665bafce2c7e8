"""The agent in one process: what it takes, what it tells, and what it learns to do."""

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Discrete, MultiBinary

from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner
from neurosnap.agent.policies import Walker, new_policy
from neurosnap.agent.policy import AgentKind
from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.sensorium import Sensorium
from tests.support.strategies import as_set

BODY = Body.full(["a", "b"], ["x", "y"])
KINDS: list[AgentKind] = ["walker", "excited", "planner"]


class Line(gymnasium.Env[Any, Any]):
    """Five places in a line; the actions count from 7."""

    sensors = ("below_2", "below_4", "better", "worse")
    orders = (0, 0, 1, 1)
    actions = ("left", "right")

    def __init__(self) -> None:
        self.observation_space = MultiBinary(4)
        self.action_space = Discrete(2, start=7)
        self.place = 2

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        self.place = 2
        return self._seen(0), {}

    def step(self, action: Any) -> Any:
        assert self.action_space.contains(action)
        after = min(4, max(0, self.place + (-1, 1)[action - 7]))
        change, self.place = after - self.place, after
        return self._seen(change), 0.0, False, False, {}

    def _seen(self, change: int) -> Any:
        bits = [self.place < 2, self.place < 4, change > 0, change < 0]
        return np.array(bits, np.int8)


class Lamps(gymnasium.Env[Any, Any]):
    """Two lamps, each as its button was left; the buttons do not exclude each other."""

    sensors = ("red", "green")
    actions = ("press_red", "press_green")

    def __init__(self) -> None:
        self.observation_space = MultiBinary(2)
        self.action_space = MultiBinary(2)

    def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
        super().reset(seed=seed)
        return np.zeros(2, np.int8), {}

    def step(self, action: Any) -> Any:
        assert self.action_space.contains(action)
        return action, 0.0, False, False, {}


def agent(kind: AgentKind = "walker", seed: int = 0, body: Body = BODY) -> Agent:
    target = ["a"] if kind == "planner" else []
    return Agent(body, new_policy(kind, body, seed, target=target))


class TestActing:
    def test_ticks_count_from_one_and_the_last_decision_is_kept(self) -> None:
        acting = agent()
        assert (acting.decision.tick, acting.decision.action) == (0, -1)
        for tick in (1, 2, 3):
            decision = acting.act([True, False])
            assert decision.tick == tick
            assert decision is acting.decision
        assert acting.snapshot.clock == 3

    def test_it_goes_on_with_a_snapshot_that_has_learned(self) -> None:
        snapshot = EmpiricalSnapshot(Sensorium(BODY.sensors))
        old = Agent(BODY, Walker(2, 0), snapshot)
        for _ in range(7):
            old.act([1, 0])
        new = Agent(BODY, Walker(2, 0), snapshot)
        assert new.act([1, 0]).tick == 1
        assert snapshot.clock == 8

    def test_a_body_without_actions_only_watches(self) -> None:
        body = Body.full(["a", "b"], [])
        watching = Agent(body, Walker(0, 1))
        for _ in range(3):
            assert watching.act([1, 0]).action == -1
        assert as_set(watching.state) == {0, 3}

    def test_who_says_what_is_known_may_use_the_same_array_again(self) -> None:
        acting, other = agent("planner"), agent("planner")
        known = np.zeros(2, np.bool_)
        for tick in range(12):
            known[:] = tick % 3 > 0, tick % 3 != 1
            bits = [tick % 2, tick % 5 > 0]
            assert acting.act(bits, known=known) == other.act(bits, known=known.copy())
        assert acting.snapshot.to_bytes() == other.snapshot.to_bytes()

    @pytest.mark.parametrize(
        ("known", "error", "says"),
        [
            (
                np.ones(3, np.bool_),
                ShapeError,
                "known: must hold 2 flags, one a sensor, got (3,)",
            ),
            (
                np.ones(2),
                InvalidValueError,
                "known: must be bool, got dtype('float64')",
            ),
            (
                np.zeros(2, np.bool_),
                InvalidValueError,
                "known: must hold one at least, got [False, False]",
            ),
        ],
    )
    def test_who_does_not_say_what_is_known_is_refused(
        self, known: Any, error: type[InvalidValueError], says: str
    ) -> None:
        acting, other = agent(), agent()
        with pytest.raises(error, match=f"^{re.escape(says)}$"):
            acting.act([1, 0], known=known)
        assert acting.act([0, 1]) == other.act([0, 1])
        assert acting.snapshot.clock == 1

    @pytest.mark.parametrize(
        ("bits", "says"),
        [
            ([1], "observation: must hold 2 bits, one a sensor, got (1,)"),
            ([1, 0, 0], "observation: must hold 2 bits, one a sensor, got (3,)"),
            ([1, 2], "observation: must be 0 or 1 (at 1), got 2"),
            ([1, float("nan")], "observation: must be 0 or 1 (at 1), got nan"),
        ],
    )
    def test_a_bad_observation_is_refused_and_changes_nothing(
        self, bits: list[float], says: str
    ) -> None:
        acting, other = agent(), agent()
        for one in (acting, other):
            one.act([1, 0])
        with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
            acting.act(bits)
        assert acting.decision == other.decision
        assert acting.act([0, 1]) == other.act([0, 1])
        assert (acting.state == other.state).all()
        assert acting.snapshot.clock == 2

    def test_a_snapshot_of_another_size_is_refused(self) -> None:
        rule = r"^snapshot: must have 12 sensors, as the body, got 2$"
        with pytest.raises(ShapeError, match=rule):
            Agent(BODY, Walker(2, 0), EmpiricalSnapshot(2))


class TestConsequences:
    def test_what_was_learned_is_foreseen_by_name_and_by_number(self) -> None:
        body = Body.full(["a"], ["x", "y"])
        acting = Agent(body, Walker(2, 3))
        for _ in range(200):  # x switches the sensor on, y switches it off
            action = acting.decision.action
            acting.act([action == 0])
        literal = Sensorium(body.sensors).literal
        for name, number, leads, not_to in (("x", 0, "a", "a*"), ("y", 1, "a*", "a")):
            bound = acting.consequences(name)
            assert bound.shape == (2 * len(body.sensors),)
            assert bound[literal(leads)]
            assert not bound[literal(not_to)]
            assert (bound == acting.consequences(number)).all()

    def test_a_name_among_free_actions_is_that_action_alone(self) -> None:
        body = Body.full(["a"], ["x", "y", "z"], exclusive=False)
        acting = Agent(body, Walker(8, 0))
        literal = Sensorium(body.sensors).literal
        for name, number in (("x", 0b001), ("y", 0b010), ("z", 0b100)):
            expected = {
                literal(one if one == name else f"{one}*") for one in body.actions
            }
            assert as_set(acting.consequences(name)) == expected
            assert as_set(acting.consequences(number)) == expected

    @pytest.mark.parametrize("action", ["z", "", -1, 2])
    def test_an_action_that_does_not_exist_is_refused(self, action: int | str) -> None:
        says = re.escape(f"action: must be one of x, y, got {action!r}")
        with pytest.raises(InvalidValueError, match=f"^{says}$"):
            agent().consequences(action)

    def test_actions_that_are_not_sensed_have_none(self) -> None:
        body = Body(own=("a",), actions=("x",))
        with pytest.raises(InvalidValueError, match=r"^agent: must have actions that"):
            Agent(body, Walker(1, 0)).consequences("x")


class TestOf:
    def test_it_takes_names_orders_and_actions_from_the_environment(self) -> None:
        body = Agent.of(Line(), "excited").body
        assert body == Body.full(Line.sensors, Line.actions, Line.orders)
        assert len(body.sensors) == 4 + 2 + 2 * 4

    def test_free_actions_stay_free(self) -> None:
        body = Agent.of(Lamps(), "walker").body
        assert body == Body.full(Lamps.sensors, Lamps.actions, exclusive=False)
        assert len(body.choices) == 4

    def test_an_unfit_environment_is_refused_by_its_name(self) -> None:
        env = Line()
        env.observation_space = Discrete(4)
        with pytest.raises(InvalidValueError, match=r"^Line: observation space: must"):
            Agent.of(env, "walker")

    @pytest.mark.parametrize("discounted", [False, True])
    def test_who_smells_the_target_learns_to_keep_to_it(self, discounted: bool) -> None:
        env = Line()  # better is to the right
        names = Sensorium(Agent.of(env, "walker").body.sensors)
        snapshot = (DiscountedSnapshot if discounted else EmpiricalSnapshot)(names)
        acting = Agent.of(env, "excited", seed=1, snapshot=snapshot)
        bits, _ = env.reset(seed=0)
        places = []
        for _ in range(1000):
            bits, *_ = env.step(7 + acting.act(bits).action)
            places.append(env.place)
        # A random walk is at either of the two places on the right 2 times in 5.
        assert np.mean(np.array(places[600:]) >= 3) > 0.9

    def test_who_may_press_both_buttons_reaches_any_pair_of_lamps(self) -> None:
        env = Lamps()
        walker = Agent.of(env, "walker", seed=2)
        bits, _ = env.reset()
        for _ in range(400):
            choice = walker.act(bits).action
            bits, *_ = env.step(walker.body.choices[choice].astype(np.int8))
        for target, number in (
            (["red*", "green*"], 0b00),
            (["red", "green*"], 0b01),
            (["red*", "green"], 0b10),
            (["red", "green"], 0b11),
        ):
            policy = Planner(walker.body, target, seed=3, explore=0.0)
            acting = Agent(walker.body, policy, walker.snapshot)
            bits, _ = env.reset()  # a lamp that was on unpressed would be news
            for _ in range(3):
                decision = acting.act(bits)
                assert decision.action == number
                names = ", ".join(target)
                assert decision.why == f"guarantees 2 of 2 subgoals ({names})"
                chosen = walker.body.choices[decision.action]
                bits, *_ = env.step(chosen.astype(np.int8))
            assert bits.tolist() == [number & 1, number >> 1]
