"""Bodies and senses: which sensors there are, and what each reads."""

import re
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.body import Body
from neurosnap.agent.senses import Senses
from neurosnap.errors import InvalidValueError
from tests.support import agent_oracles as oracles


class TestBody:
    def test_its_sensors_stand_in_order_own_actions_context(self) -> None:
        body = Body(
            own=("door", "light"),
            actions=("push", "pull"),
            senses_actions=True,
            context=((1, 3), (0, 0)),
        )
        assert body.sensors == (
            "door",
            "light",
            "push",
            "pull",
            "pull&~light",
            "push&door",
        )

    def test_actions_that_are_not_sensed_are_no_sensors(self) -> None:
        body = Body(own=("door",), actions=("push",), context=((0, 1),))
        assert body.sensors == ("door", "push&~door")

    def test_a_full_body_has_every_action_at_every_position_literal(self) -> None:
        body = Body.full(["a", "better", "b"], ["go", "stay"], [0, 1, 0])
        assert body.sensors == (
            *("a", "better", "b", "go", "stay"),
            *("go&a", "go&~a", "go&b", "go&~b"),
            *("stay&a", "stay&~a", "stay&b", "stay&~b"),
        )
        assert body.orders == (0, 1, 0)
        assert body.exclusive
        assert body.position[:6].tolist() == [True, True, False, False, True, True]
        assert not body.position[6:].any()
        assert body.position.shape == (2 * len(body.sensors),)

    @pytest.mark.parametrize(
        "body",
        [
            Body(own=("a",)),
            Body(own=("a",), actions=("go",)),
            Body.full(["a", "b"], ["go", "stay"], room=3),
            Body.full(["a", "b"], ["go"], room=3).grow((0, (0, 3))).retire(0),
            Body.full(["a", "b"], ["go"], [0, 2], room=1),
        ],
    )
    def test_it_has_as_many_sensors_as_names(self, body: Body) -> None:
        assert body.count == len(body.sensors)
        assert body.position.shape == (2 * body.count,)

    def test_a_sensor_that_looks_back_two_steps_is_no_position_either(self) -> None:
        assert Body.full(["a", "b"], ["go"], [0, 2]).sensors[3:] == ("go&a", "go&~a")

    def test_a_full_body_without_orders_has_state_sensors_only(self) -> None:
        body = Body.full(["a", "b"], ["go"])
        assert body.orders == (0, 0)
        assert len(body.context) == 4

    def test_a_full_body_without_actions_is_the_world_alone(self) -> None:
        body = Body.full(["a", "b"], [])
        assert body.sensors == ("a", "b")
        assert body.choices.shape == (0, 0)
        assert not body.senses_actions

    def test_bodies_without_orders_have_all_their_own_as_position(self) -> None:
        body = Body(own=("a", "b"), actions=("go",), senses_actions=True)
        assert body.position.tolist() == [True] * 4 + [False] * 2

    def test_exclusive_choices_are_the_pure_actions_in_order(self) -> None:
        body = Body(own=("a",), actions=("x", "y", "z"))
        assert body.choices.tolist() == np.eye(3, dtype=bool).tolist()

    def test_free_choices_count_in_binary_the_first_action_lowest(self) -> None:
        body = Body(own=("a",), actions=("x", "y"), exclusive=False)
        assert body.choices.tolist() == [
            [False, False],
            [True, False],
            [False, True],
            [True, True],
        ]

    def test_it_survives_json(self) -> None:
        body = Body.full(["a", "b"], ["go"], [0, 1], exclusive=False)
        assert msgspec.json.decode(msgspec.json.encode(body), type=Body) == body

    @pytest.mark.parametrize(
        ("given", "says"),
        [
            (
                {"own": ("a", "b"), "orders": (0,)},
                "orders: must be one for each of 2 sensors, got (0,)",
            ),
            (
                {"own": ("a",), "actions": ("x",), "context": ((1, 0),)},
                "context: must be of one of 1 actions, got (1, 0)",
            ),
            (
                {"own": ("a",), "actions": ("x",), "context": ((-1, 0),)},
                "context: must be of one of 1 actions, got (-1, 0)",
            ),
            (
                {"own": ("a",), "actions": ("x",), "context": ((0, 2),)},
                "context: must be of a literal of 1 sensors, got (0, 2)",
            ),
            (
                {"own": ("a",), "actions": ("x",), "context": ((0, -1),)},
                "context: must be of a literal of 1 sensors, got (0, -1)",
            ),
            (
                {"own": ("a",), "actions": ("x", "x")},
                "actions: must have different names, got ('x', 'x')",
            ),
            (
                {"own": ("a",), "actions": ("x",), "context": ((0, 1), (0, 1))},
                "names: must be unique, got 'x&~a'",
            ),
            (
                {"own": ("a", "x"), "actions": ("x",), "senses_actions": True},
                "names: must be unique, got 'x'",
            ),
            (
                {
                    "own": ("a",),
                    "actions": tuple("abcdefghijk"),
                    "exclusive": False,
                },
                "actions: must be at most 10 where they do not exclude each other, "
                "got 11",
            ),
            ({"own": ("a*",)}, "sensor name: must not end with *, got 'a*'"),
        ],
    )
    def test_what_makes_no_body_is_refused(
        self, given: dict[str, Any], says: str
    ) -> None:
        with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
            Body(**given)

    def test_ten_free_actions_are_not_too_many(self) -> None:
        body = Body(own=("a",), actions=tuple("abcdefghij"), exclusive=False)
        assert body.choices.shape == (1024, 10)
        assert body.choices[513].nonzero()[0].tolist() == [0, 9]


@st.composite
def bodies(draw: st.DrawFn) -> Body:
    own = draw(st.integers(0, 3))
    actions = draw(st.integers(0, 3))
    pairs = [(action, a) for action in range(actions) for a in range(2 * own)]
    chosen = draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else []
    return Body(
        own=tuple(f"s{k}" for k in range(own)),
        orders=tuple(draw(st.integers(0, 1)) for _ in range(own)),
        actions=tuple(f"a{k}" for k in range(actions)),
        exclusive=draw(st.booleans()),
        senses_actions=draw(st.booleans()),
        context=tuple(chosen),
    )


class TestSenses:
    @given(bodies(), st.data())
    def test_a_step_is_sensed_as_the_definition_has_it(
        self, body: Body, data: st.DataObject
    ) -> None:
        count = len(body.own)
        readings = st.lists(st.booleans(), min_size=count, max_size=count)
        now, before = data.draw(readings), data.draw(readings)
        held: dict[int, bool | None] = {
            sensor: data.draw(st.sampled_from([True, False, None]))
            for sensor in range(len(body.sensors))
        }
        state = np.zeros(2 * len(body.sensors), np.bool_)
        state[[2 * s + (not on) for s, on in held.items() if on is not None]] = True

        def was(literal: int) -> bool | None:
            """Whether a literal was on; None: unknown."""
            on = held[literal // 2]
            if on is None:  # with a reading it was contradicted
                return False if before[literal // 2] else None
            return on != bool(literal % 2)

        senses, own = Senses(body), np.array(now, np.bool_)
        # At the beginning no action and no context is on, and all of that is known.
        for number, taken in enumerate([set[int](), *oracles.choices(body)], -1):
            expected: list[bool | None] = [True if known else None for known in now]
            felt = [action in taken for action in range(len(body.actions))]
            expected += felt if body.senses_actions else []
            for action, literal in body.context:  # of a conjunction, one off decides
                expected.append(was(literal) if action in taken else False)
            known = senses.known(own, number, state, np.array(before, np.bool_))
            told = np.ones(len(expected), np.bool_) if known is None else known
            assert told.tolist() == [value is not None for value in expected]
            seen = senses.observe(own, number, state)
            assert seen.tolist() == [value is True for value in expected]
        assert number + 1 == len(body.choices)

    def test_all_is_known_where_nothing_is_said(self) -> None:
        senses = Senses(Body.full(["a"], ["go"]))
        assert senses.known(None) is None
        assert senses.known(np.array([True])) is None
        assert senses.known(None, 0, np.zeros(8, np.bool_), None) is None

    def test_observations_share_no_memory(self) -> None:
        senses, bits = Senses(Body.full(["a"], ["go"])), np.array([True])
        first = senses.observe(bits)
        kept = first.copy()
        bits[0] = False
        senses.observe(bits, 0, np.ones(8, np.bool_))
        assert (first == kept).all()

    @pytest.mark.parametrize(
        ("body", "back"),
        [
            (Body(own=("a",)), False),
            (Body(own=("a",), actions=("go",)), False),
            (Body(own=("a",), actions=("go",), senses_actions=True), True),
            (Body(own=("a",), actions=("go",), context=((0, 0),)), True),
        ],
    )
    def test_it_looks_back_iff_it_senses_the_step(self, body: Body, back: bool) -> None:
        assert Senses(body).looks_back is back
