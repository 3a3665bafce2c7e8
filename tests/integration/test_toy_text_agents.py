"""Agents in Gymnasium's toy texts learn true relations and reach their targets."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tests.support.taught_agents import (
    Taught,
    attempt,
    distances,
    tile,
    walker,
)
from tests.support.transition_tables import recordable
from world.toy_text import cliff_walking, frozen_lake

# What is learned ----------------------------------------------------------------------


@st.composite
def all_fields(draw: st.DrawFn) -> NDArray[np.bool_]:
    places = draw(st.integers(1, 4))
    rows = st.lists(st.booleans(), min_size=places, max_size=places)
    return np.array(draw(st.lists(rows, min_size=1, max_size=6)), np.bool_)


@given(all_fields())
def test_what_can_be_recorded_is_what_is_recorded_after_seeing_everything(
    fields: NDArray[np.bool_],
) -> None:
    places = fields.shape[1]
    snapshot = EmpiricalSnapshot(len(fields), 1 / (4 * places))
    for bits in fields.T:
        snapshot.learn(bits)
    np.testing.assert_array_equal(recordable(fields), snapshot.poc_graph().edges)


# A planner on the lake and at the cliff -----------------------------------------------

HOLES = (5, 7, 11, 12)


def outcomes(who: Taught) -> tuple[Counter[str], list[float]]:
    """How a planner fares from everywhere to everywhere, and the steps too many."""
    table, found, extra = who.table, Counter[str](), []
    holes = {(state, True) for state in HOLES}
    for goal, place in enumerate(table.situations):
        if place in holes:
            continue
        kind = "goal" if place[1] else "tile"
        literals = ("tile=goal",) if place[1] else tile(who.env, *divmod(place[0], 4))
        at = who.at(literals)
        assert at.nonzero()[0].tolist() == [goal]
        far = distances(table, at)
        for start in (~table.over & ~at).nonzero()[0].tolist():
            way = attempt(who, start, at, "planner", literals)
            if way[-1] == place:
                found[f"{kind} reached"] += 1
                extra.append(len(way) - 1 - far[start])
            else:
                found[f"{kind} {'drowned' if way[-1] in holes else 'missed'}"] += 1
    return found, extra


def test_on_the_lake_the_planner_gets_there_or_falls_into_a_hole() -> None:
    found, extra = outcomes(walker(frozen_lake))
    # It never goes round and round; of 110 pairs of tiles it does 77.
    assert found == {
        "tile reached": 77,
        "tile drowned": 33,
        "goal reached": 4,
        "goal drowned": 7,
    }
    assert min(extra) == 0
    assert np.mean(np.array(extra) == 0) > 0.7


@pytest.mark.slow
def test_walking_by_the_cliff_the_planner_reaches_the_goal_from_everywhere() -> None:
    cliff = walker(cliff_walking)
    at = cliff.at(["tile=goal"])
    far = distances(cliff.table, at)
    for start in (~cliff.table.over).nonzero()[0].tolist():
        way = attempt(cliff, start, at, "planner", ["tile=goal"])
        assert way[-1] == (47, True)
        assert len(way) - 1 <= far[start] + 12
        # And does not fall: none of its steps leads from the edge to the start.
        edge = {(state, False) for state in range(25, 35)}
        assert not any(a in edge and b == (36, False) for a, b in pairwise(way))
