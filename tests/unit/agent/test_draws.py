"""Draws: numbers that are a function of seed and tick, and look random."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.agent.policy import WIDTH, RandomNumbers, pick
from tests.support.hypothesis_settings import examples

LARGEST = 2**63 - 1


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7, 1000, 1023, 1024])
def test_the_ends_of_the_range_pick_the_first_and_the_last(count: int) -> None:
    options = np.arange(10, 10 + count)
    assert pick(options, 0.0) == 10
    assert pick(options, 1 - 2.0**-53) == 9 + count


@pytest.mark.parametrize("count", [1, 2, 3, 4, 6])
def test_equal_shares_of_the_range_pick_each(count: int) -> None:
    options = np.arange(count) * 3
    picked = [pick(options, (k + 0.5) / 12) for k in range(12)]
    assert picked == np.repeat(options, 12 // count).tolist()


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
