"""Distances in actions equal those of a search from every place."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tests.support.distances import fewest_actions
from world.target import distances_to


@st.composite
def any_moves(draw: st.DrawFn) -> NDArray[np.intp]:
    places = draw(st.integers(1, 8))
    row = st.lists(st.integers(0, places - 1), min_size=places, max_size=places)
    return np.array(draw(st.lists(row, min_size=1, max_size=3)))


@given(any_moves(), st.data())
def test_distances_are_the_fewest_actions_whatever_the_moves(
    moves: NDArray[np.intp], data: st.DataObject
) -> None:
    places = moves.shape[1]
    wanted = data.draw(st.sets(st.integers(0, places - 1)))
    aims = np.isin(np.arange(places), sorted(wanted))
    apart = [fewest_actions(moves, target) for target in sorted(wanted)]
    nearest = [min(each) for each in zip(*apart, strict=True)]
    expected = nearest if wanted else [float("inf")] * places
    assert distances_to(moves, aims).tolist() == expected
