"""Environments: what they say of themselves, and what is refused or ignored."""

import re
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Space

from neurosnap.agent.environment import Description, describe
from neurosnap.errors import InvalidValueError, ShapeError, within
from neurosnap.sources.gymnasium_source import import_worlds
from neurosnap.sources.open import open_source


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


def test_one_that_says_nothing_gets_numbers_for_names() -> None:
    assert describe("w", Said()) == Description(
        sensors=("s0", "s1"),
        orders=(0, 0),
        actions=("action_0", "action_1"),
        exclusive=True,
        start=0,
        discrete=True,
    )


@pytest.mark.parametrize("several", [tuple, list])
def test_what_it_says_is_taken_over(several: Any) -> None:
    said = Said(
        acts=Discrete(3, start=4),
        sensors=several(["door", "smell"]),
        orders=several([0, 1]),
        actions=several(["go", "stay", "turn"]),
    )
    assert describe("w", said) == Description(
        sensors=("door", "smell"),
        orders=(0, 1),
        actions=("go", "stay", "turn"),
        exclusive=True,
        start=4,
        discrete=True,
    )


def test_a_flat_multibinary_action_space_is_any_choice() -> None:
    said = describe("w", Said(acts=MultiBinary(3), actions=("x", "y", "z")))
    assert (said.actions, said.exclusive, said.start) == (("x", "y", "z"), False, 0)
    assert describe("w", Said(acts=MultiBinary([2]))).actions == (
        "action_0",
        "action_1",
    )


def test_a_wrapper_may_say_it_and_has_the_last_word() -> None:
    class Wrapped(gymnasium.Wrapper[Any, Any, Any, Any]):
        sensors = ("c", "d")
        actions = ("x", "y")

    said = describe("w", Wrapped(Said(sensors=("a", "b"), orders=(1, 0))))
    assert (said.sensors, said.orders, said.actions) == (
        ("c", "d"),
        (1, 0),
        ("x", "y"),
    )


@pytest.mark.parametrize(
    "foreign",
    [
        None,
        3,
        [],
        ["x"],
        ["x", "y", "z"],
        [0, 1],
        ["x", 1],
        {"x": 0, "y": 1},
        pytest.param({"x", "y"}, id="a set"),  # in no order that lasts
        np.array([0, 1]),
        "longer",
        print,
    ],
    ids=repr,
)
def test_an_attribute_called_actions_that_is_no_names_is_ignored(
    foreign: object,
) -> None:
    assert describe("w", Said(actions=foreign)).actions == ("action_0", "action_1")


@pytest.mark.parametrize(
    ("attributes", "says"),
    [
        ({"sensors": ("a",)}, "w: sensors: must be a sequence of 2 names, got ('a',)"),
        ({"sensors": 7}, "w: sensors: must be a sequence of 2 names, got 7"),
        ({"sensors": ("a", "a")}, "w: names: must be unique, got 'a'"),
        ({"sensors": ("a", 1)}, "w: sensor name: must be text, got 1"),
        ({"sensors": ("a", "b*")}, "w: sensor name: must not end with *, got 'b*'"),
        ({"actions": ("x", "x")}, "w: names: must be unique, got 'x'"),
        ({"actions": ("x", "")}, "w: sensor name: must not be empty, got ''"),
        ({"orders": (0,)}, "w: orders: must be 2 whole numbers from 0 up, got (0,)"),
        (
            {"orders": (0, -1)},
            "w: orders: must be 2 whole numbers from 0 up, got (0, -1)",
        ),
        (
            {"orders": (0, 0.5)},
            "w: orders: must be 2 whole numbers from 0 up, got (0, 0.5)",
        ),
        (
            {"orders": (0, True)},
            "w: orders: must be 2 whole numbers from 0 up, got (0, True)",
        ),
        ({"orders": 0}, "w: orders: must be 2 whole numbers from 0 up, got 0"),
    ],
)
def test_bad_words_are_refused(attributes: dict[str, object], says: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
        describe("w", Said(**attributes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "space",
    [Box(0, 1, (2,)), Discrete(4), MultiBinary((2, 2)), Dict({"a": MultiBinary(2)})],
    ids=repr,
)
def test_another_observation_space_is_refused(space: Space[Any]) -> None:
    says = (
        "w: observation space: must be MultiBinary with one axis (wrap the environment "
        "in neurosnap.BinarySensors, which makes sensors of what it shows), "
        f"got {space!r}"
    )
    with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
        describe("w", Said(observes=space))


def test_where_it_is_there_with_sensors_the_refusal_names_it() -> None:
    import_worlds()
    lake = gymnasium.make("FrozenLake-v1")
    with pytest.raises(InvalidValueError, match=r"; or take neurosnap/FrozenLake-v0\)"):
        describe("FrozenLake-v1", lake)


@pytest.mark.parametrize(
    "space", [Box(0, 1, (2,)), MultiBinary((2, 2)), MultiDiscrete([2, 2])], ids=str
)
def test_another_action_space_is_refused(space: Space[Any]) -> None:
    rule = "must be Discrete, or MultiBinary with one axis"
    says = f"w: action space: {rule}, got {space!r}"
    with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
        describe("w", Said(acts=space))


class TestStep:
    @pytest.mark.parametrize("start", [-2, 0, 5])
    def test_exclusive_choices_count_from_where_the_space_starts(
        self, start: int
    ) -> None:
        space = Discrete(3, start=start)
        said = describe("w", Said(acts=space))
        steps = [said.step(choice) for choice in range(3)]
        assert steps == [start, start + 1, start + 2]
        assert all(space.contains(step) for step in steps)

    def test_free_choices_are_bits_the_first_action_lowest(self) -> None:
        space = MultiBinary(3)
        said = describe("w", Said(acts=space))
        steps = [said.step(choice) for choice in range(8)]
        assert all(space.contains(step) for step in steps)
        assert [list(step) for step in steps] == [
            [low, middle, high]
            for high in (0, 1)
            for middle in (0, 1)
            for low in (0, 1)
        ]

    @pytest.mark.parametrize(
        ("space", "choice", "most"),
        [
            (Discrete(3), 3, 2),
            (Discrete(3), -1, 2),
            (Discrete(3, start=5), 5, 2),
            (MultiBinary(2), 4, 3),
            (MultiBinary(2), -1, 3),
        ],
        ids=repr,
    )
    def test_no_other_choice_is_taken(
        self, space: Space[Any], choice: int, most: int
    ) -> None:
        said = describe("w", Said(acts=space))
        says = f"^action: must be a whole number in 0..{most}, got {choice}$"
        with pytest.raises(InvalidValueError, match=says):
            said.step(choice)


class TestSource:
    """A source hands an environment's own words on."""

    @pytest.fixture
    def stepped(self) -> Any:
        class Stepped(Said):
            taken: list[Any] = []  # noqa: RUF012

            def reset(self, *, seed: int | None = None, options: Any = None) -> Any:
                gymnasium.Env.reset(self, seed=seed)
                return np.zeros(2, np.int8), {}

            def step(self, action: Any) -> Any:
                self.taken.append(action)
                return np.ones(2, np.int8), 0.0, False, False, {}

        def make(**_: Any) -> Stepped:
            return Stepped(acts=MultiBinary(2), orders=(0, 1), actions=("x", "y"))

        gymnasium.register("Said-v0", make)
        yield Stepped.taken
        del gymnasium.registry["Said-v0"]

    def test_it_says_what_the_environment_says(self, stepped: list[Any]) -> None:
        source = open_source("Said-v0", seed=0)
        assert source.orders == (0, 1)
        assert source.actions == ("x", "y")
        assert source.exclusive is False
        assert stepped == []

    def test_its_choices_are_bits(self, stepped: list[Any]) -> None:
        source = open_source("Said-v0", seed=0)
        source.first()
        for choice in range(4):
            assert source.step(choice) is not None
        assert [list(bits) for bits in stepped] == [[0, 0], [1, 0], [0, 1], [1, 1]]
        with pytest.raises(
            InvalidValueError, match=r"^action: must be .* 0\.\.3, got 4$"
        ):
            source.step(4)


@pytest.mark.parametrize("kind", [InvalidValueError, ShapeError])
def test_an_error_says_where_and_stays_of_its_kind(
    kind: type[InvalidValueError],
) -> None:
    error = within("there", kind("thing", "must be", 3))
    assert type(error) is kind
    assert str(error) == "there: thing: must be, got 3"
    assert error.value == 3
