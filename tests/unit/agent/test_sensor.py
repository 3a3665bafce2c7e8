"""Sensors over the last n states of a trajectory: their readings, and invalid input."""

import pickle
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.sensor import (
    Sensor,
    Trajectory,
    decreased,
    increased,
    one_hot,
    thresholds,
)
from neurosnap.errors import InvalidValueError


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
