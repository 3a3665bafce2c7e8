"""Agents in Gymnasium's toy texts: what they learn is true, and where they get to."""

from collections import Counter
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.sensor import decreased, increased
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from tests.support.exhaustive import rows
from tests.support.taught_agents import (
    THRESHOLDS,
    Bed,
    Taught,
    attempt,
    distances,
    taught,
    tile,
    walker,
)
from tests.support.transition_tables import Situation, Table, recordable, state_fields
from world.toy_text import cliff_walking, frozen_lake, taxi

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


def learn(
    fields: NDArray[np.bool_], places: NDArray[np.intp], threshold: float
) -> NDArray[np.int64]:
    """Return the number of wrong edges after each step ([GK] eqn:true dir matrix)."""
    truth = recordable(fields)
    snapshot = EmpiricalSnapshot(len(fields), threshold)
    wrong = int(truth.sum())
    errors = np.empty(len(places), np.int64)
    for t, place in enumerate(places.tolist()):
        if snapshot.learn(fields[:, place]):
            wrong = int((snapshot.poc_graph().edges != truth).sum())
        errors[t] = wrong
    return errors


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bed", "steps", "seed"),
    rows(
        [(frozen_lake, 10_000, 0), (cliff_walking, 100_000, 0)],
        [(taxi, 200_000, seed) for seed in range(3)],
    ),
)
def test_a_random_walk_learns_exactly_what_is_true(
    bed: Bed, steps: int, seed: int
) -> None:
    env = bed()
    table = Table.of(env)
    walk = table.walk(steps, np.random.default_rng(seed))
    errors = learn(state_fields(env, table), walk, THRESHOLDS[bed])
    assert errors[0] > 0
    assert not errors[-steps // 5 :].any()


# An excited agent ---------------------------------------------------------------------


def drawn_to(bed: Bed, goal: Situation) -> BinarySensors:
    """A bed with `better` and `worse`, by the fewest actions to a place."""
    bare = bed()
    table = Table.of(bare)
    at = np.array([place == goal for place in table.situations])
    ways = zip(table.states.tolist(), distances(table, at), strict=True)
    far = {bare.state_of(state, {}): distance for state, distance in ways}
    scent = (decreased("better", far.__getitem__), increased("worse", far.__getitem__))
    return BinarySensors(
        bare.env,
        (*bare.definitions, *scent),
        lambda _, observation, info: bare.state_of(observation, info),
        bare.actions,
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("bed", "goal", "kind", "steps", "reached", "starts"),
    rows(
        [
            (frozen_lake, (15, True), "walker", 8000, 3, 11),
            (frozen_lake, (15, True), "excited", 8000, 9, 11),
        ],
        [
            (cliff_walking, (47, True), "walker", 40_000, 37, 37),
            (cliff_walking, (47, True), "excited", 10_000, 37, 37),
        ],
    ),
)
def test_an_excited_agent_goes_where_it_gets_better(
    bed: Bed, goal: Situation, kind: AgentKind, steps: int, reached: int, starts: int
) -> None:
    who = taught(drawn_to(bed, goal), THRESHOLDS[bed], steps, kind=kind)
    # Only an agent that went everywhere knows all, and nothing that is false.
    learned = np.array_equal(who.snapshot.poc_graph().edges, who.truth)
    assert learned == (kind == "walker")
    at = np.array([place == goal for place in who.table.situations])
    alive = (~who.table.over).nonzero()[0].tolist()
    ways = [attempt(who, start, at, "excited", explore=0.2) for start in alive]
    assert len(alive) == starts
    assert sum(way[-1] == goal for way in ways) == reached


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
