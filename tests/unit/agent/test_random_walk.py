"""The walker: random, and yet a function of its seed and the tick."""

from collections import Counter

import numpy as np
import pytest
from numpy.typing import NDArray

from neurosnap.agent.policies import Walker
from tests.support.deliberations import asked, decided

Bits = NDArray[np.bool_]


def state(*literals: int, sensors: int = 4) -> Bits:
    bits = np.zeros(2 * sensors, dtype=np.bool_)
    bits[list(literals)] = True
    return bits


def actions(walker: Walker, ticks: int = 200) -> list[int]:
    return [decided(walker, tick, state(0), [])[0] for tick in range(1, ticks)]


def questions(walker: Walker, ticks: int = 200) -> list[tuple[int, ...]]:
    return [asked(walker, tick, state(0, 3, 5, 6))[0] for tick in range(1, ticks)]


def test_the_same_seed_walks_the_same_way_in_any_order() -> None:
    forwards = actions(Walker(3, 7))
    walker = Walker(3, 7)
    backwards = [decided(walker, tick, state(0), [])[0] for tick in range(199, 0, -1)]
    assert backwards[::-1] == forwards
    assert questions(Walker(3, 7)) == questions(walker)


def test_it_asks_for_one_literal_of_the_state() -> None:
    found = Counter(questions(Walker(2, 1), ticks=400))
    assert set(found) == {(0,), (3,), (5,), (6,)}
    assert min(found.values()) > 50


def test_an_empty_state_has_nothing_to_ask() -> None:
    assert asked(Walker(2, 1), 5, state()) == []


def test_what_it_does_depends_on_no_state_and_no_answer() -> None:
    walker = Walker(5, 3)
    for tick in range(50):
        plain = decided(walker, tick, state(0), [])
        assert plain == decided(walker, tick, state(1, 2), [state(1, 2, 4)])


def test_what_it_asks_does_not_say_what_it_does() -> None:
    # From one stream, the question's place in the state would be the action.
    walker = Walker(4, 11)
    on = [0, 3, 5, 6]
    places = [on.index(literal) for (literal,) in questions(walker)]
    assert places != actions(walker)


@pytest.mark.parametrize("seed", [0, 2**63 - 1])
def test_a_source_without_actions_gets_none(seed: int) -> None:
    action, why = decided(Walker(0, seed), 1, state(0), [])
    assert action == -1
    assert why == "the source takes no actions"
