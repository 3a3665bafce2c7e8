"""Bodies and senses: sensors that exist or can be grown, and their readings."""

import re
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.actions import Actions
from neurosnap.agent.agent_observation import Senses
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Context
from neurosnap.errors import InvalidValueError


class TestBody:
    @pytest.mark.parametrize(
        ("body", "sensors"),
        [
            pytest.param(
                Body(
                    own=("door", "light"),
                    actions=("push", "pull"),
                    senses_actions=True,
                    context=((1, 3), (0, 0)),
                ),
                ("door", "light", "push", "pull", "pull&~light", "push&door"),
                id="its own, actions and contexts",
            ),
            pytest.param(
                Body(own=("door",), actions=("push",), context=((0, 1),)),
                ("door", "push&~door"),
                id="actions that are not sensed",
            ),
            pytest.param(
                Body.full(["a", "back", "b"], ["go", "stay"], [0, 2, 0], room=1),
                (
                    *("a", "back", "b", "go", "stay"),
                    *("go&a", "go&~a", "go&b", "go&~b"),
                    *("stay&a", "stay&~a", "stay&b", "stay&~b"),
                    "grown 1",
                ),
                id="full: every action at every literal of a position",
            ),
            pytest.param(Body.full(["a", "b"], []), ("a", "b"), id="no actions"),
        ],
    )
    def test_its_sensors_stand_in_order(
        self, body: Body, sensors: tuple[str, ...]
    ) -> None:
        assert body.sensors == sensors
        assert body.count == len(sensors)
        orders = body.orders or (0,) * len(body.own)
        position = [not order for order in orders for _ in (0, 1)]
        rest = 2 * (len(sensors) - len(body.own))
        assert body.position.tolist() == position + [False] * rest
        assert msgspec.json.decode(msgspec.json.encode(body), type=Body) == body

    @pytest.mark.parametrize(
        ("given", "says"),
        [
            *(
                ({"context": (pair,)}, f"context: must be of {rule}, got {pair}")
                for rule, pairs in [
                    ("one of 1 actions", ((1, 0), (-1, 0))),
                    ("a literal of 1 sensors", ((0, 2), (0, -1))),
                ]
                for pair in pairs
            ),
            ({"orders": (0, 0)}, "orders: must be one for each of 1 sensors"),
            ({"actions": ("x", "x")}, "actions: must have different names"),
            ({"context": ((0, 1), (0, 1))}, "names: must be unique, got 'x&~a'"),
            ({"own": ("a", "x"), "senses_actions": True}, "names: must be unique"),
            ({"own": ("a*",)}, "sensor name: must not end with *, got 'a*'"),
        ],
    )
    def test_what_makes_no_body_is_refused(
        self, given: dict[str, Any], says: str
    ) -> None:
        with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}"):
            Body(**{"own": ("a",), "actions": ("x",), **given})


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

        own, was_known = np.array(now, np.bool_), np.array(before, np.bool_)
        senses = Senses(body)
        assert senses.looks_back == (len(body.sensors) > count)
        # At the beginning no action and no context is on, and all of that is known.
        for taken in range(-1, len(body.actions)):
            expected: list[bool | None] = [True if known else None for known in now]
            felt = [action == taken for action in range(len(body.actions))]
            expected += felt if body.senses_actions else []
            for action, literal in body.context:  # of a conjunction, one off decides
                expected.append(was(literal) if action == taken else False)
            senses = Senses(body, was_known)
            seen, known = senses.observe(own, own, taken, state)
            told = np.ones(len(expected), np.bool_) if known is None else known
            assert told.tolist() == [value is not None for value in expected]
            assert seen.tolist() == [value is True for value in expected]


# Bodies that grow ---------------------------------------------------------------------

GROWING = Body.full(["a", "b", "c"], ["x", "y"], room=4)
FIRST = GROWING.first_grown


def test_a_grown_sensor_stands_behind_all_others_and_says_what_it_is() -> None:
    assert GROWING.sensors[FIRST:] == ("grown 1", "grown 2", "grown 3", "grown 4")
    body = GROWING.grow(Context(0, (0, 3))).grow(Context(1, (1, 2, 5)))
    assert body.sensors[:FIRST] == GROWING.sensors[:FIRST]
    assert body.sensors[FIRST:] == ("x&a&~b", "y&~a&b&~c", "grown 3", "grown 4")
    assert body.first_grown == FIRST
    assert body.in_use == body.grown == (Context(0, (0, 3)), Context(1, (1, 2, 5)))
    assert not body.position[2 * FIRST :].any()
    assert (body.looked_at == body.position).all()


def single(name: str) -> int:
    """Return the literal that a sensor is on."""
    return 2 * GROWING.sensors.index(name)


def test_one_may_tell_of_the_step_before_what_was_done_and_where() -> None:
    last = single("y&~c")
    body = GROWING.grow(Context(0, (0, last))).grow(Context(1, (single("x"),)))
    assert body.sensors[FIRST : FIRST + 2] == ("x&a&(y&~c)", "y&(x)")
    assert set(np.flatnonzero(body.looked_at & ~body.position)) == {last, single("x")}
    assert not body.retire(0).looked_at[last]
    assert body.members(body.grown[0]) == [single("x"), single("x&a")]

    state = np.zeros(2 * len(body.sensors), np.bool_)
    state[[single("x"), single("x&a")]] = True
    assert body.reading(body.grown[0], state) is None  # of the step before it says less
    assert body.reading(Context(0, (0, 3)), state) is None
    state[single("x&~b") + 1] = True
    assert body.reading(Context(0, (0, 3)), state) is False
    state[[single("x&~b"), single("x&~b") + 1]] = True, False
    assert body.reading(Context(0, (0, 3)), state) is True


def test_contexts_nest_and_what_is_looked_back_at_is_read() -> None:
    body = GROWING.grow(Context(0, (single("y&~c"),)))
    with pytest.raises(InvalidValueError, match="earlier sensors"):
        body.grow(Context(1, (2 * FIRST + 2,)))  # its own number
    body = body.grow(Context(1, (2 * FIRST,)))
    assert body.sensors[FIRST : FIRST + 2] == ("x&(y&~c)", "y&(x&(y&~c))")
    assert body.looked_at[2 * FIRST]
    with pytest.raises(
        InvalidValueError, match=r"^retired: must not be looked back at"
    ):
        body.retire(0)
    assert body.retire(1).retire(0).in_use == ()


def test_one_that_is_grown_again_is_another_sensor() -> None:
    body = GROWING.grow(Context(0, (0, 3))).retire(0).grow(Context(0, (0, 3)))
    assert body.sensors[FIRST : FIRST + 2] == ("x&a&~b", "x&a&~b#2")
    assert body.in_use == (Context(0, (0, 3)),)
    assert body.retired == (0,)


@pytest.mark.parametrize(
    ("context", "rule"),
    [
        *(
            ((0, literals), "must be of literals of two or more sensors, ascending")
            for literals in ((0,), (2, 0), (0, 1))
        ),
        *(
            ((0, (0, a)), "must say of the step before what was on, of earlier sen")
            for a in (7, 2 * FIRST)
        ),
        ((2, (6,)), "must be of one of 2 actions"),
        ((2, (0, 2)), "must be of literals that are sensed in the action's context"),
    ],
)
def test_what_cannot_be_grown_is_refused(
    context: tuple[int, tuple[int, ...]], rule: str
) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(f"grown: {rule}")):
        GROWING.grow(Context(*context))


def test_no_more_grow_than_there_is_room_for_and_only_those_retire() -> None:
    body = Body.full(["a", "b"], ["x"], room=1)
    with pytest.raises(InvalidValueError, match=r"^retired: must be places in 0 grown"):
        body.retire(0)
    full = body.grow(Context(0, (0, 2)))
    with pytest.raises(InvalidValueError, match=r"^grown: must be at most 1, for whic"):
        full.grow(Context(0, (0, 3)))


@st.composite
def grown_bodies(draw: st.DrawFn) -> Body:
    body = GROWING
    for place in range(draw(st.integers(0, 4))):
        before = st.integers(len(GROWING.own), FIRST + place - 1)
        last = draw(st.sets(before, max_size=2))
        least = 1 if last else 2
        of_own = st.integers(0, len(GROWING.own) - 1)
        chosen = sorted(draw(st.sets(of_own, min_size=least, max_size=3)))
        literals = (
            *(2 * s + draw(st.integers(0, 1)) for s in chosen),
            *(2 * s for s in sorted(last)),
        )
        body = body.grow(Context(draw(st.integers(0, 1)), literals))
    for place in range(len(body.grown)):
        needed = any(2 * (FIRST + place) in each.literals for each in body.in_use)
        body = body.retire(place) if not needed and draw(st.booleans()) else body
    return body


THREE = st.lists(st.booleans(), min_size=3, max_size=3)


@given(
    grown_bodies(), THREE, THREE, THREE, st.integers(-1, 1), st.integers(0, 2**32 - 1)
)
def test_it_reads_what_the_single_ones_read_together(
    body: Body,
    bits: list[bool],
    now: list[bool],
    known: list[bool],
    action: int,
    seed: int,
) -> None:
    # What is not known of the state before is in it as nothing at all.
    state = np.zeros(2 * len(body.sensors), np.bool_)
    for sensor, on in enumerate(now):
        state[2 * sensor + (not on)] = known[sensor]
    rng = np.random.default_rng(seed)
    for sensor in range(len(GROWING.own), FIRST + 4):  # of the step before
        state[2 * sensor : 2 * sensor + 2] = rng.permutation(2) * rng.integers(2)
    senses = Senses(body, np.array(known))
    observed, told = senses.observe(np.array(bits), None, action, state)
    told = np.ones(len(body.sensors), np.bool_) if told is None else told
    assert not told[FIRST + len(body.grown) :].any()
    sensors = {pair: len(body.own) + 2 + k for k, pair in enumerate(body.context)}
    for place, (which, literals, *_) in enumerate(body.grown):
        own, last = body.split(literals)
        members = [sensors[which, literal] for literal in own]
        held = all(state[literal] for literal in last)
        unheld = any(state[literal + 1] for literal in last)
        on = held and all(observed[member] for member in members)
        off = any(told[member] and not observed[member] for member in members)
        off |= unheld or action != which
        sure = all(told[member] for member in members)
        sure &= all(state[literal] for literal in last)
        sensor = FIRST + place
        if place in body.retired:
            assert not observed[sensor]
            assert not told[sensor]
        else:
            assert observed[sensor] == on
            assert told[sensor] == (off or sure)


@given(grown_bodies(), THREE)
def test_an_action_switches_on_those_that_hold(body: Body, now: list[bool]) -> None:
    state = np.zeros(2 * len(body.sensors), np.bool_)
    for sensor, on in enumerate((*now, *(k % 2 for k in range(FIRST - len(now))))):
        state[2 * sensor + (not on)] = True
    for action, signal in enumerate(Actions(body).signals(state)):
        expected = {
            2 * (FIRST + place)
            for place, (which, literals, *_) in enumerate(body.grown)
            if which == action
            and place not in body.retired
            and all(state[literal] for literal in literals)
        }
        assert {a for a in signal if a >= 2 * FIRST} == expected
