"""An excited agent goes where it gets better."""

from collections.abc import Callable

import numpy as np
import pytest

from neurosnap.agent.binary_sensors import BinarySensors
from neurosnap.agent.policy import AgentKind
from neurosnap.agent.sensor import decreased, increased
from tests.support.taught_agents import THRESHOLDS, attempt, distances, taught
from tests.support.toy_text_beds import Situation, situations
from tests.support.transition_tables import Table
from world.toy_text import cliff_walking, frozen_lake


def drawn_to(bed: Callable[..., BinarySensors], goal: Situation) -> BinarySensors:
    """A bed with `better` and `worse`, by the fewest actions to a place."""
    bare = bed()
    table = Table.of(bare)
    at = np.array([place == goal for place in situations(table)])
    far = {
        bare.state_of(state, {}): distance
        for state, distance in zip(
            table.states.tolist(), distances(table, at), strict=True
        )
    }
    scent = (decreased("better", far.__getitem__), increased("worse", far.__getitem__))
    return BinarySensors(
        bare.env,
        (*bare.definitions, *scent),
        lambda _, observation, info: bare.state_of(observation, info),
        bare.actions,
    )


@pytest.mark.parametrize(
    ("bed", "goal", "kind", "steps", "reached", "starts"),
    [
        (frozen_lake, (15, True), "walker", 8000, 3, 11),
        (frozen_lake, (15, True), "excited", 8000, 9, 11),
        (cliff_walking, (47, True), "walker", 40_000, 37, 37),
        (cliff_walking, (47, True), "excited", 10_000, 37, 37),
    ],
)
def test_an_excited_agent_goes_where_it_gets_better(
    bed: Callable[..., BinarySensors],
    goal: Situation,
    kind: AgentKind,
    steps: int,
    reached: int,
    starts: int,
) -> None:
    who = taught(drawn_to(bed, goal), THRESHOLDS[bed], steps, kind=kind)
    # Only who went everywhere knows all, and nothing that is false.
    learned = np.array_equal(who.snapshot.poc_graph().edges, who.truth)
    assert learned == (kind == "walker")
    at = np.array([place == goal for place in situations(who.table)])
    alive = (~who.table.over).nonzero()[0].tolist()
    ways = [attempt(who, start, at, "excited", explore=0.2) for start in alive]
    assert len(alive) == starts
    assert sum(way[-1] == goal for way in ways) == reached
