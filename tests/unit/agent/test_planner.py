"""The greedy planner on small relations, and its memory of failed actions."""

import re
from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.experience import Experience
from neurosnap.agent.planner import Planner
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium, complete
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


def test_it_takes_one_of_those_that_are_as_good_and_says_why() -> None:
    found = decided(["b"], [("x", "b"), ("z", "b")], "a", "b*")
    why = "guarantees 1 of 2 subgoals (b); one of 2 as good"
    assert set(found) == {("x", why), ("z", why)}


def test_it_counts_what_of_the_present_is_kept() -> None:
    known = [("x&a", "b"), ("y&a", "b"), ("y&a", "a")]
    (taken,) = decided(["b"], known, "a", "b*")
    assert taken == ("y", "guarantees 2 of 2 subgoals (a, b)")


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
    signals = asked(Planner(BODY, ["b*", "a", 0, 3], seed=0), 1, state("a"))
    names = [sorted(NAMES.name(literal) for literal in one) for one in signals]
    assert names == [["x", "x&a"], ["y", "y&a"], ["z", "z&a"], ["a", "b*"]]


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


# Where greed led nowhere --------------------------------------------------------------

# A corridor of six places, of which each is sensed. The goal looks alike its far end in
# two of three sensors, so that greedily one goes there, and stays.
SENSORS = ("p0", "p1", "p2", "p3", "p4", "p5", "u", "v")
CORRIDOR = Body.full(SENSORS, ["back", "forward"])
TARGET = ["p5", "u", "v"]


def reading(place: int) -> NDArray[np.bool_]:
    both = place in (0, 5)
    return np.array([*(place == k for k in range(6)), both, both])


def moved(place: int, action: int) -> int:
    return min(5, max(0, place + (-1, 1)[action]))


def steps(graph: PocGraph, policy: Planner, place: int, most: int = 40) -> int:
    """Return the steps it takes to the far end, or `most` if it does not arrive."""
    for tick in range(most):
        if place == 5:
            return tick
        here = np.zeros(2 * len(CORRIDOR.sensors), np.bool_)
        here[: 2 * len(SENSORS)] = complete(reading(place))
        place = moved(place, decided_by(graph, policy, tick, here)[0])
    return most


def test_where_greed_stays_for_ever_it_leaves_and_learns_the_shortest_way() -> None:
    names = Sensorium(CORRIDOR.sensors)
    follows = [  # from each action at each place
        (names.literal(f"{name}&p{place}"), literal)
        for action, name in enumerate(CORRIDOR.actions)
        for place in range(6)
        for literal in complete(reading(moved(place, action))).nonzero()[0].tolist()
    ]
    corridor = PocGraph.from_implications(len(names), follows)
    assert steps(corridor, Planner(CORRIDOR, TARGET, 0, explore=0.0), 1) == 40
    experience = Experience(CORRIDOR)
    planner = Planner(CORRIDOR, TARGET, 0, 0.0, experience)
    assert steps(corridor, planner, 4) == 1
    taken = [steps(corridor, planner, 1) for _ in range(30)]
    assert taken[0] < 40
    # What it has raised by then it need not raise again.
    assert taken[-1] == 4
    again = Experience(CORRIDOR)
    again.restore(experience.arrays())
    assert list(again.raised.items()) == list(experience.raised.items()) != []
    again.aim()
    assert again.raised == {}
