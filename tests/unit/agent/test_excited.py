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


BETTER = "guarantees better"
CALM = "guarantees worse*; nothing guarantees better"
EXPLORING = "at random, to explore; nothing guarantees better"
AT_RANDOM = "at random: nothing guarantees better or worse*"


@pytest.mark.parametrize(
    ("known", "now", "explore", "expected"),
    [
        pytest.param(
            [("x&a", "better"), ("y", "worse*"), ("z", "worse*")],
            ["a"],
            1.0,
            {("x", BETTER)},
            id="it takes what guarantees better",
        ),
        pytest.param(
            [("x&a", "better"), ("y", "worse*")],
            ["a*"],
            0.0,
            {("y", CALM)},
            id="only the present context counts",
        ),
        pytest.param(
            [("z", "worse*")],
            ["a"],
            0.5,
            {("z", CALM), *((action, EXPLORING) for action in "xyz")},
            id="failing that it explores now and then",
        ),
        pytest.param(
            [],
            ["a", "better", "worse*", "x", "y*", "z*"],
            0.0,
            {(action, AT_RANDOM) for action in "xyz"},
            id="that it has just got better guarantees nothing",
        ),
        pytest.param(
            [("y&a", "better"), ("y&~b", "better*"), ("z", "worse*")],
            ["a", "b*"],
            0.0,
            {("z", CALM)},
            id="better that is contradicted is not guaranteed",
        ),
        # Or the belief would never be tried, and so never given up.
        pytest.param(
            [("x&a", "x*"), ("x", "better"), ("y", "worse*")],
            ["a"],
            0.0,
            {("x", BETTER)},
            id="a pure action believed impossible is taken all the same",
        ),
    ],
)
def test_what_it_takes_and_why(
    known: list[tuple[str, str]],
    now: list[str],
    explore: float,
    expected: set[tuple[str, str]],
) -> None:
    assert decided(known, state(*now), explore) == expected


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
