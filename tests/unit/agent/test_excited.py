"""The excitation-driven agent against the paper's one paragraph about it."""

from collections import Counter
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.body import Body
from neurosnap.agent.policies import (
    EXPLORES,
    KEEPS,
    LOST,
    SEEKS,
    Excited,
    choose,
    drives,
)
from neurosnap.agent.random_numbers import WIDTH
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium
from tests.support.deliberations import decided_by

BODY = Body.full(["a", "b", "better", "worse"], ["x", "y", "z"], [0, 0, 1, 1])
NAMES = Sensorium(BODY.sensors)

# Midpoints: twelve to pick by, so that 1, 2, 3, 4 or 6 options come up equally often,
# and ten to explore by, so that a share in tenths is met exactly.
PICKS = [(k + 0.5) / 12 for k in range(12)]
EXPLORE = [(k + 0.5) / 10 for k in range(10)]
GRID = [np.array([p, e, 0.9, 0.1]) for p, e in product(PICKS, EXPLORE)]


def flags(count: int) -> list[NDArray[np.bool_]]:
    return [np.array(one) for one in product([False, True], repeat=count)]


def shares(options: set[int], cases: int) -> dict[int, int]:
    return dict.fromkeys(options, cases // len(options))


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("explore", [0.0, 0.3, 1.0])
def test_each_choice_comes_up_exactly_as_often_as_it_should(
    count: int, explore: float
) -> None:
    for possible, better, calm in product(flags(count), repeat=3):
        able = set(possible.nonzero()[0].tolist())
        if not able:
            continue  # of the choices, one can always be made
        seeking = able & set(better.nonzero()[0].tolist())
        keeping = able & set(calm.nonzero()[0].tolist())
        random = round(explore * len(GRID))
        expected: Counter[tuple[int, int]] = Counter()
        parts = (
            [(SEEKS, seeking, len(GRID))]
            if seeking
            else [(EXPLORES, able, random), (KEEPS, keeping, len(GRID) - random)]
            if keeping
            else [(LOST, able, len(GRID))]
        )
        for why, options, cases in parts:
            for action, times in shares(options, cases).items():
                expected[action, why] += times
        found = Counter(
            choose(possible, better, calm, explore, draws) for draws in GRID
        )
        assert found == +expected, (possible, better, calm)


@pytest.mark.parametrize("last", [0.0, 1 - 2.0**-53])
def test_the_ends_of_the_range_stay_among_the_options(last: float) -> None:
    none = np.zeros(7, np.bool_)
    possible = np.array([0, 1, 1, 0, 1, 1, 0], np.bool_)
    draws = np.full(WIDTH, last)
    action, why = choose(possible, none, none, 0.0, draws)
    assert (action, why) == (5 if last else 1, LOST)


def state(*names: str) -> NDArray[np.bool_]:
    on = np.zeros(2 * len(NAMES), np.bool_)
    on[[NAMES.literal(name) for name in names]] = True
    return on


def decided(
    implications: list[tuple[str, str]], now: NDArray[np.bool_], explore: float = 0.0
) -> set[tuple[str, str]]:
    relation = PocGraph.from_implications(
        len(NAMES), [(NAMES.literal(a), NAMES.literal(b)) for a, b in implications]
    )
    policy = Excited(BODY, seed=4, explore=explore)
    found = set()
    for tick in range(200):
        action, why = decided_by(relation, policy, tick, now)
        found.add((BODY.actions[action], why))
    return found


def test_it_takes_what_guarantees_better() -> None:
    known = [("x&a", "better"), ("y", "worse*"), ("z", "worse*")]
    assert decided(known, state("a"), explore=1.0) == {("x", "guarantees better")}


def test_only_the_present_context_counts() -> None:
    known = [("x&a", "better"), ("y", "worse*")]
    why = "guarantees worse*; nothing guarantees better"
    assert decided(known, state("a*")) == {("y", why)}


def test_failing_that_it_explores_now_and_then() -> None:
    calm = "guarantees worse*; nothing guarantees better"
    explores = "at random, to explore; nothing guarantees better"
    assert decided([("z", "worse*")], state("a"), explore=0.5) == {
        ("z", calm),
        *((action, explores) for action in "xyz"),
    }


def test_failing_that_it_walks_at_random() -> None:
    lost = "at random: nothing guarantees better or worse*"
    assert decided([("x", "a")], state("a")) == {(action, lost) for action in "xyz"}


def test_that_it_has_just_got_better_guarantees_nothing() -> None:
    lost = "at random: nothing guarantees better or worse*"
    now = state("a", "better", "worse*", "x", "y*", "z*")
    assert decided([], now) == {(action, lost) for action in "xyz"}


def test_better_that_is_contradicted_is_not_guaranteed() -> None:
    known = [("y&a", "better"), ("y&~b", "better*"), ("z", "worse*")]
    why = "guarantees worse*; nothing guarantees better"
    assert decided(known, state("a", "b*")) == {("z", why)}


def test_a_pure_action_believed_impossible_is_taken_all_the_same() -> None:
    # Or the belief would never be tried, and so never given up.
    known = [("x&a", "x*"), ("x", "better"), ("y", "worse*")]
    assert decided(known, state("a")) == {("x", "guarantees better")}


def test_the_drives_are_found_wherever_they_stand() -> None:
    assert drives(Body(own=("worse", "a", "better"))) == (4, 1)


@pytest.mark.parametrize("own", [("a",), ("better", "a"), ("worse",)])
def test_a_world_without_drives_is_refused(own: tuple[str, ...]) -> None:
    rule = r"^agent excited: must have a world with the sensors better and worse, got "
    with pytest.raises(InvalidValueError, match=rule):
        Excited(Body.full(own, ["x"]), seed=0)


@pytest.mark.parametrize("explore", [-0.1, 1.1, float("nan")])
def test_a_share_is_a_share(explore: float) -> None:
    with pytest.raises(InvalidValueError, match=r"^explore: must be in \[0, 1\], got "):
        Excited(BODY, seed=0, explore=explore)
