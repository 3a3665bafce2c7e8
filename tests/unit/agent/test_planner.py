"""The planner on relations small enough to see through, and the targets it refuses."""

import re
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner, target_literals
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support.deliberations import asked, decided_by

BODY = Body.full(["a", "b", "better"], ["x", "y", "z"], [0, 0, 1])
NAMES = Sensorium(BODY.sensors)


def state(*names: str) -> NDArray[np.bool_]:
    on = np.zeros(2 * len(NAMES), np.bool_)
    on[[NAMES.literal(name) for name in names]] = True
    return on


def decided(
    target: list[str],
    implications: list[tuple[str, str]],
    *now: str,
    explore: float = 0.0,
    ticks: int = 200,
) -> Counter[tuple[str, str]]:
    relation = PocGraph.from_implications(
        len(NAMES), [(NAMES.literal(a), NAMES.literal(b)) for a, b in implications]
    )
    policy = Planner(BODY, target, seed=6, explore=explore)
    found: Counter[tuple[str, str]] = Counter()
    for tick in range(ticks):
        action, why = decided_by(relation, policy, tick, state(*now))
        found[BODY.actions[action], why] += 1
    return found


@pytest.mark.parametrize(
    ("target", "known", "now", "expected"),
    [
        pytest.param(
            ["b"],
            [("x&a", "b"), ("y&a", "b*")],
            ["a", "b*"],
            ("x", "guarantees 1 of 2 subgoals (b)"),
            id="it takes what guarantees the target",
        ),
        pytest.param(
            ["b"],
            [("x&a", "b"), ("y&a", "b"), ("y&a", "a")],
            ["a", "b*"],
            ("y", "guarantees 2 of 2 subgoals (a, b)"),
            id="it counts what of the present is kept",
        ),
        pytest.param(
            ["b"],
            [("b", "a"), ("x&~a", "a")],  # a comes before b, and x leads to a
            ["a*", "b*"],
            ("x", "guarantees 1 of 2 subgoals (a)"),
            id="what the target implies is wanted too",
        ),
        pytest.param(
            ["b"],
            [("x", "better"), ("y", "b")],
            ["a", "b*", "better"],
            ("y", "guarantees 1 of 2 subgoals (b)"),
            id="a sensation of the last step is no subgoal",
        ),
        pytest.param(
            ["better"],
            [("x", "better"), ("y", "b")],
            ["a", "b*"],
            ("x", "guarantees 1 of 3 subgoals (better)"),
            id="unless it is wanted",
        ),
        pytest.param(
            ["b"],
            [("b", "x"), ("y", "a")],  # that x is taken is nothing to be scored
            ["a", "b*"],
            ("y", "guarantees 1 of 2 subgoals (a)"),
            id="its own actions are no subgoals",
        ),
        pytest.param(
            ["a", "b"],
            # They exclude each other: coh({a, b}) has neither, the state is the plan.
            [("a", "b*"), ("x", "a"), ("y&~a", "a*"), ("y&~a", "b*")],
            ["a*", "b*"],
            ("y", "guarantees 2 of 2 subgoals (a*, b*)"),
            id="a target that cannot be is reduced first",
        ),
    ],
)
def test_what_it_takes_and_why(
    target: list[str],
    known: list[tuple[str, str]],
    now: list[str],
    expected: tuple[str, str],
) -> None:
    assert set(decided(target, known, *now, ticks=20)) == {expected}


def test_ties_are_broken_evenly() -> None:
    found = decided(["b"], [("x", "b"), ("z", "b")], "a", "b*", ticks=2000)
    assert set(found) == {
        (action, "guarantees 1 of 2 subgoals (b); one of 2 as good") for action in "xz"
    }
    # Six standard deviations of a fair coin.
    assert all(abs(count - 1000) < 6 * 500**0.5 for count in found.values())


def test_it_explores_as_often_as_it_is_told() -> None:
    found = decided(["b"], [("x", "b")], "a", "b*", explore=0.3, ticks=3000)
    random = sum(n for (_, why), n in found.items() if why == "at random, to explore")
    assert abs(random - 900) < 6 * (3000 * 0.3 * 0.7) ** 0.5
    assert {action for action, why in found if why.startswith("at random")} == set(
        "xyz"
    )
    assert set(decided(["b"], [("x", "b")], "a", explore=1.0)) == {
        (action, "at random, to explore") for action in "xyz"
    }


def test_a_pure_action_believed_impossible_is_taken_all_the_same() -> None:
    known = [("x", "b"), ("x&a", "x*"), ("y", "y*")]
    found = decided(["b"], known, "a", "b*", explore=0.0)
    assert {action for action, _ in found} == {"x"}
    found = decided(["b"], known, "a", "b*", explore=1.0)
    assert {action for action, _ in found} == {"x", "y", "z"}


def test_many_subgoals_are_not_all_named() -> None:
    body = Body.full(list("abcdef"), ["x"])
    pairs = [(2 * 6, 2 * k) for k in range(6)]
    relation = PocGraph.from_implications(len(body.sensors), pairs)
    policy = Planner(body, [0, 2, 4, 6, 8, 10], seed=0, explore=0.0)
    nothing = np.zeros(2 * len(body.sensors), np.bool_)
    assert decided_by(relation, policy, 1, nothing) == (
        0,
        "guarantees 6 of 6 subgoals (a, b, c, d, …)",
    )


def test_it_asks_for_every_choice_and_then_for_the_target() -> None:
    signals = asked(Planner(BODY, ["b*", "a"], seed=0), 1, state("a"))
    names = [sorted(NAMES.name(literal) for literal in one) for one in signals]
    assert names == [["x", "x&a"], ["y", "y&a"], ["z", "z&a"], ["a", "b*"]]


def test_targets_go_by_name_or_number_in_any_order() -> None:
    assert target_literals(BODY, ["b*", "a", 0, 3]) == (0, 3)


@pytest.mark.parametrize(
    ("target", "says"),
    [
        ([], "target: must name a sensation to achieve, got 'nothing'"),
        (["c"], "literal: must name a sensor that exists, got 'c'"),
        (["x"], "literal: must name a sensor that exists, got 'x'"),
        ([6], "literal: must be a whole number in [0, 6), got 6"),
        ([-1], "literal: must be a whole number in [0, 6), got -1"),
        (["a", "a*"], "target: must not hold a literal and its complement, got 'a'"),
        ([3, "b"], "target: must not hold a literal and its complement, got 'b'"),
    ],
)
def test_a_target_must_be_of_the_worlds_own(target: list[str | int], says: str) -> None:
    with pytest.raises(InvalidValueError, match=f"^{re.escape(says)}$"):
        Planner(BODY, target, seed=0)


@pytest.mark.parametrize("explore", [-0.1, 1.1, float("nan")])
def test_a_share_is_a_share(explore: float) -> None:
    with pytest.raises(InvalidValueError, match=r"^explore: must be in \[0, 1\], got "):
        Planner(BODY, ["a"], seed=0, explore=explore)
