"""The paper's examples of acting, with relations known and not learned.

The truth is found by looking at every action at every place.
"""

import pytest

from neurosnap.agent.actions import Actions, guaranteed
from neurosnap.agent.body import Body
from neurosnap.agent.planner import Planner, subgoals
from tests.support import agent_oracles as agents
from tests.support.agent_oracles import as_array, known
from tests.support.deliberations import decided_by
from tests.support.strategies import as_set

# [GK] "Example: discrete path with motion": `a_k` is on iff the place is below `k`. Its
# length is that of the paper's figure.
LENGTH = 5
PLACES = range(LENGTH + 1)
PATH = Body.full([f"a{k}" for k in PLACES[1:]], ["forward", "back", "wait"])
MOVES = [
    [min(LENGTH, x + 1) for x in PLACES],
    [max(0, x - 1) for x in PLACES],
    list(PLACES),
]
FIELDS = [[x < k for x in PLACES] for k in PLACES[1:]]
GRAPH = known(PATH, MOVES, FIELDS)


def sensed(place: int) -> set[int]:
    return agents.complete(agents.view(FIELDS, place))


@pytest.mark.parametrize("place", PLACES)
def test_what_is_guaranteed_is_all_of_the_place_that_is_reached(place: int) -> None:
    signals = Actions(PATH).signals(as_array(sensed(place), GRAPH.sensors))
    position = agents.position(PATH)
    for choice, promise in enumerate(guaranteed([GRAPH.up(one) for one in signals])):
        happens = agents.happens(PATH, MOVES, FIELDS, place, choice)
        assert as_set(promise) & position == happens & position


@pytest.mark.parametrize("goal", range(2 * LENGTH))
def test_the_planner_walks_straight_to_any_half_of_the_path(goal: int) -> None:
    half = [x for x in PLACES if goal in sensed(x)]
    policy = Planner(PATH, [goal], seed=1, explore=0.0)
    for start in PLACES:
        walked = [start]
        for tick in range(1, 3 * LENGTH + 1):
            now = as_array(sensed(walked[-1]), GRAPH.sensors)
            walked.append(MOVES[decided_by(GRAPH, policy, tick, now)[0]][walked[-1]])
        distance = min(abs(start - x) for x in half)
        step = 1 if start < half[0] else -1
        straight = [start + step * k for k in range(distance + 1)]
        # Once there it waits: no other action keeps all that it has.
        assert walked == straight + [straight[-1]] * (3 * LENGTH - distance)


def test_the_plan_wants_to_cross_the_circle_where_there_is_no_way() -> None:
    """[GK] "Agent on a Circular Rail": a beacon is on at its place and next to it.

    U_3 and U_9 meet neither U_0 nor U_6 and separate 0 from 6, so the plan wants both
    to stay off; yet one of them is on somewhere on either way.
    """
    rail = range(12)
    body = Body.full([f"near{k}" for k in rail], ["forward", "back"])
    moves = [[(x + step) % 12 for x in rail] for step in (1, -1)]
    fields = [[(x - k) % 12 in (0, 1, 11) for x in rail] for k in rail]
    graph = known(body, moves, fields)
    now = as_array(agents.complete(agents.view(fields, 0)), graph.sensors)
    between = {2 * 3 + 1, 2 * 9 + 1}
    assert between <= as_set(subgoals(now, graph.up([2 * 6])))
    for side in (range(7), [0, *range(11, 5, -1)]):
        views = [agents.complete(agents.view(fields, x)) for x in side]
        assert not all(between <= view for view in views)
