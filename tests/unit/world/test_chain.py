"""The walk's chain: against averages over time, and where the answer is known."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from world.chain import stationary, transitions
from world.cycle import CycleWorld
from world.grid import GridWorld
from world.path import PathWorld
from world.punctured_grid import PuncturedGridWorld


def by_power_iteration(moves: NDArray[np.intp], start: int) -> NDArray[np.float64]:
    """Where the lazy chain is after 2^60 steps: it has the same averages, no period."""
    actions, places = moves.shape
    chain = np.eye(places) / 2
    for row in moves:
        for here, there in enumerate(row):
            chain[here, there] += 0.5 / actions
    for _ in range(60):
        chain = chain @ chain
        chain /= chain.sum(axis=1, keepdims=True)
    return np.asarray(chain[start])


@st.composite
def walks(draw: st.DrawFn) -> tuple[NDArray[np.intp], int]:
    places = draw(st.integers(1, 7))
    row = st.lists(st.integers(0, places - 1), min_size=places, max_size=places)
    moves = np.array(draw(st.lists(row, min_size=1, max_size=3)))
    return moves, draw(st.integers(0, places - 1))


@given(walks())
def test_stationary_is_where_the_lazy_chain_ends_up(
    walk: tuple[NDArray[np.intp], int],
) -> None:
    np.testing.assert_allclose(stationary(*walk), by_power_iteration(*walk), atol=1e-9)


@given(walks())
def test_stationary_is_a_distribution_that_a_step_preserves(
    walk: tuple[NDArray[np.intp], int],
) -> None:
    shares = stationary(*walk)
    assert shares.sum() == pytest.approx(1)
    assert (shares >= -1e-12).all()
    np.testing.assert_allclose(shares @ transitions(walk[0]), shares, atol=1e-12)


@pytest.mark.parametrize("wait", [False, True])
@pytest.mark.parametrize("kind", [PathWorld, CycleWorld, GridWorld, PuncturedGridWorld])
def test_in_the_papers_worlds_all_places_are_exactly_alike(
    kind: Any, wait: bool
) -> None:
    moves = kind(wait=wait).moves
    places = moves.shape[1]
    assert set(stationary(moves, start=places - 1)) == {1 / places}


def test_the_average_exists_although_the_chain_is_periodic() -> None:
    around = np.array([[1, 2, 0]])
    np.testing.assert_array_equal(stationary(around, 1), [1 / 3] * 3)
    # Period 2 and not uniform: from the middle of a star, to each of its ends.
    star = np.array([[1, 0, 0, 0], [2, 0, 0, 0], [3, 0, 0, 0]])
    np.testing.assert_allclose(stationary(star, 2), [1 / 2, 1 / 6, 1 / 6, 1 / 6])


def test_moves_with_a_way_back_but_not_as_many_are_not_uniform() -> None:
    # Of two places each leads to the other, by two actions there and by one back.
    moves = np.array([[1, 0], [1, 1]])
    np.testing.assert_allclose(stationary(moves, 0), [1 / 3, 2 / 3])


def test_chance_decides_between_parts_that_are_never_left() -> None:
    # 0 and 1 are passed; 2 stays; 3 and 4 alternate. The chances p, q to end up at 2
    # from 0, 1 have 3p = 2q and 3q = 2 + p.
    moves = np.array([[1, 2, 2, 4, 3], [1, 2, 2, 4, 3], [3, 0, 2, 4, 3]])
    cases: dict[int, list[float]] = {
        0: [0, 0, 4 / 7, 3 / 14, 3 / 14],
        1: [0, 0, 6 / 7, 1 / 14, 1 / 14],
        2: [0, 0, 1, 0, 0],
        4: [0, 0, 0, 1 / 2, 1 / 2],
    }
    for start, expected in cases.items():
        np.testing.assert_allclose(stationary(moves, start), expected, atol=1e-15)


def test_transitions_are_the_shares_of_the_actions() -> None:
    np.testing.assert_array_equal(
        transitions(PathWorld(places=3, wait=True).moves) * 3,
        [[2, 1, 0], [1, 1, 1], [0, 1, 2]],
    )


def test_a_long_walk_is_at_each_place_about_as_often() -> None:
    moves = np.array([[1, 2, 2, 0], [0, 0, 3, 3]])
    place, visits = 0, np.zeros(4)
    for action in np.random.default_rng(1).integers(2, size=20_000):
        place = moves[action, place]
        visits[place] += 1
    np.testing.assert_allclose(visits / visits.sum(), stationary(moves, 0), atol=0.02)


@pytest.mark.parametrize("start", [-1, 3, 0.0, True, None])
def test_a_start_that_is_no_place_is_refused(start: Any) -> None:
    moves = PathWorld(places=3).moves
    rule = r"^start: must be a place in 0\.\.2, got "
    with pytest.raises(InvalidValueError, match=rule):
        stationary(moves, start)
