"""The policies by name, and their valid combinations."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.planner import Planner
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.policy_kinds import Excited, Walker, new_policy, preferences
from neurosnap.agent.random_draws import WIDTH, RandomNumbers, pick
from neurosnap.errors import InvalidValueError
from tests.support.deliberations import asked, decided
from tests.support.hypothesis_settings import examples

Bits = NDArray[np.bool_]
LARGEST = 2**63 - 1
BODY = Body.full(["a", "better", "worse"], ["x", "y"], [0, 1, 1])
GROWING = Body.full(["a", "b"], ["x", "y"], room=3)
KINDS: dict[AgentKind, type] = {
    "walker": Walker,
    "excited": Excited,
    "planner": Planner,
}


def target_of(kind: AgentKind) -> dict[str, Any]:
    return {"target": ["a"]} if kind == "planner" else {}


@pytest.mark.parametrize("kind", KINDS)
def test_each_is_had_by_its_name_and_acts_at_random_as_often_as_it_is_told(
    kind: AgentKind,
) -> None:
    nothing = np.zeros(2 * len(BODY.sensors), np.bool_)
    # x guarantees a and worse*, y nothing; a planner asks for its target, too.
    x, wanted = nothing.copy(), nothing.copy()
    x[[0, 5]], wanted[0] = True, True
    answers = [x, nothing, wanted] if kind == "planner" else [x, nothing]
    for explore, taken in ((0.0, {0}), (1.0, {0, 1})):
        policy = new_policy(kind, BODY, 0, explore=explore, **target_of(kind))
        assert type(policy) is KINDS[kind]
        found = {decided(policy, tick, nothing, answers)[0] for tick in range(40)}
        assert found == ({0, 1} if kind == "walker" else taken)


@pytest.mark.parametrize(
    ("kind", "body", "given", "rule"),
    [
        ("walker", BODY, {"target": ["a"]}, "target: must go with a planner"),
        ("excited", BODY, {"target": ["a"]}, "target: must go with a planner"),
        ("planner", BODY, {}, "target: must name a sensation to achieve, got"),
        ("planer", BODY, {}, "kind: must be walker, excited or planner (did you mean"),
        *(
            ("planner", body, {"target": ["a"]}, "agent: must have actions that are s")
            for body in (
                Body(own=("a",), senses_actions=True),
                Body(own=("a",), actions=("go",), context=((0, 0),)),
            )
        ),
        *(
            (kind, BODY, {"explore": "planned", **target_of(kind)}, rule)
            for kind in KINDS
            for rule in ["explore: must go with a planner that imagines "]
        ),
        *(
            (kind, BODY, {"explore": share, **target_of(kind)}, rule)
            for kind in KINDS
            for share in (-0.1, 1.1, np.nan)
            for rule in ["explore: must be in [0, 1], got "]
            if kind != "walker"
        ),
        *(
            (kind, BODY, {"prefer": {"a": 1}}, rule)
            for kind in KINDS
            for rule in ["prefer: must go with a planner that imagines (such as imagi"]
        ),
        *(
            (
                "planner",
                body,
                {"imagine": 9, "experience": Experience(body), **given},
                rule,
            )
            for body, given, rule in (
                (
                    BODY,
                    {"prefer": {"a": 1}},
                    "prefer: must go with an agent that grows",
                ),
                (
                    GROWING,
                    {"prefer": {"a": 1}, "target": ["b"]},
                    "prefer: must come without a target, got ('b',)",
                ),
                (
                    GROWING,
                    {"prefer": {"a": np.inf}},
                    "prefer: must have finite weights, got 'a=inf'",
                ),
                (GROWING, {"prefer": {"c": 1}}, "literal: must name a sensor that ex"),
            )
        ),
        *(
            ("excited", Body.full(own, ["x"]), {}, rule)
            for own in [("a",), ("better", "a"), ("worse",)]
            for rule in ["agent excited: must have a world with the sensors better and"]
        ),
    ],
)
def test_what_does_not_go_together_is_refused(
    kind: AgentKind, body: Body, given: dict[str, Any], rule: str
) -> None:
    with pytest.raises(InvalidValueError) as caught:
        new_policy(kind, body, 0, **given)
    assert str(caught.value).startswith(rule)


@pytest.mark.parametrize(
    "text", ["won", "won=", "=1", "won=much", "won=nan", "won=1,", "won=1, won=2", ","]
)
def test_a_preference_that_is_no_name_and_number_is_refused(text: str) -> None:
    with pytest.raises(InvalidValueError, match=r"^prefer: must be names"):
        preferences(text)
    assert preferences(" ") == {}


# The walker ---------------------------------------------------------------------------


def state(*literals: int, sensors: int = 4) -> Bits:
    bits = np.zeros(2 * sensors, dtype=np.bool_)
    bits[list(literals)] = True
    return bits


def walked(walker: Walker, tick: int) -> tuple[int, list[Any]]:
    """Return what it does at a tick, and what it asks."""
    here = state(0, 3, 5, 6)
    return decided(walker, tick, here, [])[0], asked(walker, tick, here)


def test_the_same_seed_walks_the_same_way_in_any_order_whatever_is_answered() -> None:
    one, other = Walker(3, 7), Walker(3, 7)
    forwards = [walked(one, tick) for tick in range(1, 200)]
    backwards = [walked(other, tick) for tick in range(199, 0, -1)]
    assert backwards[::-1] == forwards
    for tick, (action, _) in enumerate(forwards, 1):
        assert decided(one, tick, state(1, 2), [state(1, 2, 4)])[0] == action
    no_action = (-1, "the source takes no actions")
    assert decided(Walker(0, LARGEST), 1, state(0), []) == no_action


def test_it_asks_for_one_literal_of_the_state_whatever_it_does() -> None:
    walker, on = Walker(4, 11), [0, 3, 5, 6]
    actions, questions = zip(
        *(walked(walker, tick) for tick in range(400)), strict=True
    )
    places = [on.index(literal) for ((literal,),) in questions]
    for drawn in (actions, places):
        found = Counter(drawn)
        assert set(found) == {0, 1, 2, 3}
        assert min(found.values()) > 50
    # From one stream, the question's place in the state would be the action.
    assert places != list(actions)
    assert asked(walker, 5, state()) == []


# What is drawn -----------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6, 1000, 1023, 1024])
def test_equal_shares_of_the_range_pick_each(count: int) -> None:
    options = np.arange(count) * 3
    picked = [pick(options, (k + 0.5) / (2 * count)) for k in range(2 * count)]
    assert picked == np.repeat(options, 2).tolist()
    ends = pick(options, 0.0), pick(options, 1 - 2.0**-53)
    assert ends == (0, options[-1])


@examples(30)
@given(st.integers(0, LARGEST), st.lists(st.integers(0, 5000), min_size=1, max_size=8))
def test_they_are_the_doubles_that_numpy_makes_of_the_same_counter_in_any_order(
    seed: int, ticks: list[int]
) -> None:
    draws = RandomNumbers(seed)
    numpys = np.random.Generator(np.random.Philox(key=seed)).random((5001, WIDTH))
    for tick in (*ticks, *reversed(ticks)):
        np.testing.assert_array_equal(draws.at(tick), numpys[tick])


def test_a_late_tick_is_as_good_as_an_early_one() -> None:
    late = RandomNumbers(3).at(2**40)
    assert ((late >= 0) & (late < 1)).all()
    assert (late == RandomNumbers(3).at(2**40)).all()
