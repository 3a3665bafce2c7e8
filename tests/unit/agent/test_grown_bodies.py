"""Bodies that grow: names, numbers, and what a grown sensor reads."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.actions import Actions
from neurosnap.agent.body import Body, Context
from neurosnap.agent.senses import Senses
from neurosnap.errors import InvalidValueError

BODY = Body.full(["a", "b", "c"], ["x", "y"], room=4)
FIRST = BODY.first_grown


def test_a_grown_sensor_stands_behind_all_others_and_says_what_it_is() -> None:
    assert BODY.sensors[FIRST:] == ("grown 1", "grown 2", "grown 3", "grown 4")
    body = BODY.grow((0, (0, 3))).grow((1, (1, 2, 5)))
    assert body.sensors[:FIRST] == BODY.sensors[:FIRST]
    assert body.sensors[FIRST:] == ("x&a&~b", "y&~a&b&~c", "grown 3", "grown 4")
    assert body.first_grown == FIRST
    assert body.in_use == body.grown == ((0, (0, 3)), (1, (1, 2, 5)))
    assert not body.position[2 * FIRST :].any()
    assert (body.looked_at == body.position).all()


def single(name: str) -> int:
    """Return the literal that a sensor is on."""
    return 2 * BODY.sensors.index(name)


def test_one_may_tell_of_the_step_before_what_was_done_and_where() -> None:
    last = single("y&~c")
    body = BODY.grow((0, (0, last))).grow((1, (single("x"),)))
    assert body.sensors[FIRST : FIRST + 2] == ("x&a&(y&~c)", "y&(x)")
    assert set(np.flatnonzero(body.looked_at & ~body.position)) == {last, single("x")}
    assert not body.retire(0).looked_at[last]
    assert body.members(body.grown[0]) == [single("x"), single("x&a")]

    state = np.zeros(2 * len(body.sensors), np.bool_)
    state[[single("x"), single("x&a")]] = True
    assert body.reading(body.grown[0], state) is None  # of the step before it says less
    assert body.reading((0, (0, 3)), state) is None
    state[single("x&~b") + 1] = True
    assert body.reading((0, (0, 3)), state) is False
    state[[single("x&~b"), single("x&~b") + 1]] = True, False
    assert body.reading((0, (0, 3)), state) is True


def test_one_that_is_grown_again_is_another_sensor() -> None:
    body = BODY.grow((0, (0, 3))).retire(0).grow((0, (0, 3)))
    assert body.sensors[FIRST : FIRST + 2] == ("x&a&~b", "x&a&~b#2")
    assert body.in_use == ((0, (0, 3)),)
    assert body.retired == (0,)


@pytest.mark.parametrize(
    ("context", "rule"),
    [
        ((0, (0,)), "must be of literals of two or more sensors, ascending"),
        ((0, (2, 0)), "must be of literals of two or more sensors, ascending"),
        ((0, (0, 1)), "must be of literals of two or more sensors, ascending"),
        ((0, (0, 7)), "must say of the step before what was on, of what is not grown"),
        (
            (0, (0, 2 * FIRST)),
            "must say of the step before what was on, of what is not grown",
        ),
        ((2, (6,)), "must be of one of 2 actions"),
        ((2, (0, 2)), "must be of literals that are sensed in the action's context"),
    ],
)
def test_what_cannot_be_grown_is_refused(context: Context, rule: str) -> None:
    with pytest.raises(InvalidValueError, match=re.escape(f"grown: {rule}, got")):
        BODY.grow(context)


def test_there_is_room_for_so_many() -> None:
    body = Body.full(["a", "b"], ["x"], room=1).grow((0, (0, 2)))
    with pytest.raises(
        InvalidValueError, match=r"^grown: must be at most 1, for which"
    ):
        body.grow((0, (0, 3)))


def test_only_what_was_grown_can_retire() -> None:
    with pytest.raises(InvalidValueError, match=r"^retired: must be places in 0 grown"):
        BODY.retire(0)


@st.composite
def grown(draw: st.DrawFn) -> Body:
    body = BODY
    for _ in range(draw(st.integers(0, 4))):
        last = draw(st.sets(st.integers(len(BODY.own), FIRST - 1), max_size=2))
        least = 1 if last else 2
        chosen = sorted(
            draw(st.sets(st.integers(0, len(BODY.own) - 1), min_size=least, max_size=3))
        )
        literals = (
            *(2 * s + draw(st.integers(0, 1)) for s in chosen),
            *(2 * s for s in sorted(last)),
        )
        body = body.grow((draw(st.integers(0, 1)), literals))
    for place in range(len(body.grown)):
        body = body.retire(place) if draw(st.booleans()) else body
    return body


@given(
    grown(),
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.lists(st.booleans(), min_size=3, max_size=3),
    st.integers(-1, 1),
    st.integers(0, 2**32 - 1),
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
    for sensor in range(len(BODY.own), FIRST):  # of the step before
        state[2 * sensor : 2 * sensor + 2] = rng.permutation(2) * rng.integers(2)
    senses, read = Senses(body), np.array(bits)
    before = np.array(known)
    observed = senses.observe(read, action, state)
    told = senses.known(None, action, state, before)
    told = np.ones(len(body.sensors), np.bool_) if told is None else told
    assert not told[FIRST + len(body.grown) :].any()
    sensors = {pair: len(body.own) + 2 + k for k, pair in enumerate(body.context)}
    for place, (which, literals) in enumerate(body.grown):
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


@given(grown(), st.lists(st.booleans(), min_size=3, max_size=3))
def test_an_action_switches_on_those_that_hold(body: Body, now: list[bool]) -> None:
    state = np.zeros(2 * len(body.sensors), np.bool_)
    for sensor, on in enumerate((*now, *(k % 2 for k in range(FIRST - len(now))))):
        state[2 * sensor + (not on)] = True
    for action, signal in enumerate(Actions(body).signals(state)):
        expected = {
            2 * (FIRST + place)
            for place, (which, literals) in enumerate(body.grown)
            if which == action
            and place not in body.retired
            and all(state[literal] for literal in literals)
        }
        assert {a for a in signal if a >= 2 * FIRST} == expected
