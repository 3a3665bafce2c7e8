"""Sensors over the last states, environments seen through them, and their episodes."""

import pickle
import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Discrete, MultiBinary, Space
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.environment import Continuing
from neurosnap.agent.sensor import (
    Sensor,
    Trajectory,
    decreased,
    increased,
    one_hot,
    thresholds,
)
from neurosnap.errors import InvalidValueError


class Counter(gymnasium.Env[Any, Any]):
    """Counts up by the action; an episode is over at 3, one way or the other.

    A reset draws 0 or 1, so that one can see whether it was seeded.
    """

    def __init__(self, truncates: bool = False) -> None:
        self.observation_space = Discrete(10)
        self.action_space: Space[Any] = Discrete(3)
        self.resets: list[int | None] = []
        self.taken: list[int] = []
        self._count = 0
        self._truncates = truncates

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed, options=options)
        self.resets.append(seed)
        self._count = int(self.np_random.integers(2))
        return self._count, {"parity": self._count % 2}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        self.taken.append(action)
        self._count += action
        over = self._count >= 3
        info = {"parity": self._count % 2}
        return (
            self._count,
            1.0,
            over and not self._truncates,
            over and self._truncates,
            info,
        )


SENSORS = (*thresholds("count", [1, 2]), increased("up"), decreased("down"))


def test_observations_are_what_the_sensors_read() -> None:
    env = BinarySensors(Counter(), SENSORS)
    assert (env.sensors, env.orders) == (
        ("count<1", "count<2", "up", "down"),
        (0, 0, 1, 1),
    )
    assert env.definitions == SENSORS
    assert env.observation_space == MultiBinary(4)
    assert env.action_space == Discrete(3)
    observation, info = env.reset(seed=0)
    count = info["parity"]
    assert observation in env.observation_space
    assert observation.tolist() == [count < 1, count < 2, 0, 0]
    observation, *rest = env.step(1)
    assert observation in env.observation_space
    assert observation.tolist() == [0, count < 1, 1, 0]
    assert rest == [1.0, False, False, {"parity": 1 - count}]
    assert env.step(0)[0].tolist() == [0, count < 1, 0, 0]
    assert env.step(2)[2] is True


def test_actions_have_the_names_given_or_those_of_the_environment() -> None:
    named = BinarySensors(Counter(), SENSORS, actions=["stay", "walk", "run"])
    outer = BinarySensors(named, one_hot("bit", [1], of=lambda bits: bits[0]))
    for env in (named, outer):
        assert env.get_wrapper_attr("actions") == ("stay", "walk", "run")
    assert outer.sensors == ("bit=1",)
    assert not BinarySensors(Counter(), SENSORS).has_wrapper_attr("actions")


@pytest.mark.parametrize(
    ("space", "sensors", "actions", "rule"),
    [
        (Box(0, 1), SENSORS, None, "action space: must be Discrete, got "),
        (Discrete(3), (), None, "sensors: must be at least one, got "),
        (Discrete(3), (*SENSORS, *SENSORS), None, "names: must be unique, got 'count<"),
        (Discrete(3), SENSORS, ["stay", "walk"], "actions: must be 3 names, got 2"),
    ],
)
def test_what_does_not_fit_is_refused(
    space: Space[Any], sensors: Any, actions: Any, rule: str
) -> None:
    env = Counter()
    env.action_space = space
    with pytest.raises(InvalidValueError) as caught:
        BinarySensors(env, sensors, actions=actions)
    assert str(caught.value).startswith(rule)


def test_predicates_may_see_something_else() -> None:
    seen = []

    def state(env: Any, observation: int, info: dict[str, Any]) -> tuple[int, int]:
        seen.append((env is inner, observation))
        return info["parity"], env.unwrapped._count

    inner = Counter()
    odd = Sensor("odd", lambda state: state[0])
    grew = increased("grew", of=lambda state: state[1])
    env = BinarySensors(inner, [odd, grew], state=state)
    env.reset(seed=1)
    count = inner._count
    assert env.step(1)[0].tolist() == [(count + 1) % 2, 1]
    assert seen == [(True, count), (True, count + 1)]
    assert env.state_of(7, {"parity": 5}) == (5, count + 1)
    assert BinarySensors(Counter(), [odd]).state_of(7, {}) == 7


def test_it_can_be_made_again_from_its_spec() -> None:
    walk = gymnasium.make("CliffWalking-v1")
    env = BinarySensors(walk, one_hot("place", [36, 24]), actions=["n", "e", "s", "w"])
    assert env.spec is not None
    again = env.spec.make()
    assert isinstance(again, BinarySensors)
    assert again.definitions == env.definitions
    assert again.actions == env.actions
    assert again.reset()[0].tolist() == [1, 0]
    assert again.step(0)[0].tolist() == [0, 1]


@pytest.mark.parametrize("truncates", [False, True])
def test_the_step_after_an_end_resets_and_no_end_is_reported(truncates: bool) -> None:
    inner = Counter(truncates)
    env = Continuing(inner)
    start, info = env.reset(seed=5)
    told = {"episode": 0, "begins": True, "cut": False}
    assert info == {"parity": start, **told}
    assert env.step(0)[4]["episode"] == 0
    last = env.step(2)
    steps = [last] if start + 2 == 3 else [last, env.step(2)]
    for observation, reward, terminated, truncated, info in steps:
        assert (reward, terminated, truncated) == (1.0, False, False)
        told = {"episode": 0, "begins": False, "cut": False}
        assert info == {"parity": observation % 2, **told}
    taken = list(inner.taken)
    observation, reward, terminated, truncated, info = env.step(2)
    assert inner.taken == taken  # the action was not taken
    assert observation in (0, 1)
    assert (reward, terminated, truncated) == (0.0, False, False)
    told = {"episode": 1, "begins": True, "cut": truncates}
    assert info == {"parity": observation, **told}
    info = env.step(1)[4]
    assert (info["episode"], info["begins"]) == (1, False)
    assert inner.resets == [5, None]  # its random numbers go on
    assert env.reset()[1]["episode"] == 0  # the caller's counts anew
    assert env.step(0)[4]["episode"] == 0


def test_every_episode_is_a_trajectory_whichever_wrapper_is_within() -> None:
    sensors = [increased("up"), decreased("down")]
    inside = Continuing(BinarySensors(Counter(), sensors))
    outside = BinarySensors(Continuing(Counter()), sensors)
    for env in (inside, outside):
        env.reset(seed=0)
        rollout = [env.step(1) for _ in range(30)]
        assert rollout[-1][4]["episode"] >= 5
        # It counts up by one at every step that is taken, and does nothing in others.
        for observation, *_, info in rollout:
            assert observation.tolist() == [not info["begins"], 0]


def test_a_beginning_that_the_environment_tells_of_is_passed_on() -> None:
    class Restless(Counter):
        """It begins again by itself, after every third step."""

        def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
            _, reward, *_, info = super().step(action)
            begins = len(self.taken) % 3 == 0
            self._count = 0 if begins else self._count
            return self._count, reward, False, False, {**info, "begins": begins}

    env = Continuing(BinarySensors(Restless(), [decreased("down")]))
    env.reset(seed=0)
    rollout = [env.step(1) for _ in range(6)]
    begun = [info["begins"] for *_, info in rollout]
    assert begun == [False, False, True, False, False, True]
    assert not any(observation[0] for observation, *_ in rollout)


@given(
    orders=st.lists(st.integers(0, 4), max_size=5),
    walks=st.lists(st.lists(st.integers(0, 3), min_size=1, max_size=8), max_size=3),
)
def test_a_sensor_reads_as_many_states_as_its_order_says(
    orders: list[int], walks: list[list[int]]
) -> None:
    heard: list[tuple[int, ...]] = []

    def listener(*states: int) -> bool:
        heard.append(states)
        return sum(states) % 2 == 1

    trajectory = Trajectory(Sensor(f"s{k}", listener, n) for k, n in enumerate(orders))
    for number, walk in enumerate(walks):
        for t, state in enumerate(walk):
            heard.clear()
            # The first state of all may come without a beginning.
            begins = t == 0 and number > 0
            bits = trajectory.begin(state) if begins else trajectory.extend(state)
            past = [walk[0]] * 4 + walk[: t + 1]
            expected = [tuple(past[len(past) - 1 - n :]) for n in orders]
            assert heard == expected
            assert bits.dtype == np.bool_
            assert bits.tolist() == [sum(states) % 2 == 1 for states in expected]


def test_a_buffer_that_is_used_again_is_no_matter() -> None:
    buffer = np.array([1])
    trajectory = Trajectory([increased("up", of=lambda state: state[0])])
    trajectory.begin(buffer)
    buffer[0] = 2
    assert trajectory.extend(buffer).tolist() == [True]
    buffer[0] = 3
    assert trajectory.extend(buffer).tolist() == [True]
    assert trajectory.extend(buffer).tolist() == [False]


def test_a_state_that_cannot_be_read_leaves_no_trace() -> None:
    trajectory = Trajectory([increased("up", of=lambda state: 1 / state)])
    trajectory.begin(4)
    with pytest.raises(InvalidValueError):
        trajectory.extend(0)
    assert trajectory.extend(2).tolist() == [True]  # since 4, not since 0


@pytest.mark.parametrize(
    "bit", [True, 1, np.True_, np.int8(1), np.uint64(1)], ids=lambda bit: type(bit)
)
def test_an_answer_may_be_any_kind_of_bit(bit: object) -> None:
    assert Sensor("on", lambda _: bit)(0) is True
    zero = type(bit)(0)  # type: ignore[call-arg]
    assert Sensor("off", lambda _: zero)(0) is False


@pytest.mark.parametrize("answer", [2, -1, 1.0, None, "yes", np.array([True])])
def test_an_answer_that_is_no_bit_is_refused(answer: Any) -> None:
    sensor = Sensor("near", lambda before, after: answer, order=1)
    with pytest.raises(InvalidValueError) as caught:
        sensor(3, 4)
    assert str(caught.value) == (
        "sensor near: must answer with a bool, 0 or 1 "
        f"(it did with {answer!r}), got (3, 4)"
    )


def test_a_predicate_that_raises_is_named_with_its_states() -> None:
    sensor = Sensor("odd", lambda _: [][0])
    with pytest.raises(
        InvalidValueError, match=r"^sensor odd: must not raise"
    ) as caught:
        sensor((3, 4))
    assert caught.value.value == ((3, 4),)
    assert "IndexError" in caught.value.rule
    assert isinstance(caught.value.__cause__, IndexError)


@pytest.mark.parametrize(
    ("make", "given", "message"),
    [
        (Sensor, ("", bool), "sensor name: must not be empty"),
        (Sensor, ("near*", bool), "sensor name: must not end with *"),
        *(
            (Sensor, ("near", bool, n), "order: must be a whole number from 0 up")
            for n in (-1, True, 0.5)
        ),
        (Trajectory, ([*one_hot("x", [1] * 2)],), "names: must be unique, got 'x=1'"),
        (Trajectory, ([len],), "sensors: must each be a Sensor"),
    ],
)
def test_what_makes_no_sense_is_refused(
    make: Any, given: tuple[Any, ...], message: str
) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(message)}"):
        make(*given)


def test_what_is_made_alike_is_equal_and_can_be_pickled() -> None:
    def made() -> tuple[Sensor, ...]:
        return (*thresholds("x", [1, 2]), *one_hot("x", [1]), increased("up"))

    assert made() == made()
    assert pickle.loads(pickle.dumps(made())) == made()
    assert thresholds("x", [1]) != thresholds("x", [1], of=len)
    assert increased("x") != decreased("x")
