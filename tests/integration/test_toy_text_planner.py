"""What a planner that learned a lake or a cliff is good for."""

from collections import Counter
from itertools import pairwise
from typing import Any

import numpy as np

from neurosnap.agent.agent import Agent
from neurosnap.agent.policies import new_policy
from neurosnap.sensorium import Sensorium
from tests.support.taught_agents import (
    PATIENCE,
    Taught,
    attempt,
    distances,
    state_readings,
    tile,
    walker,
)
from tests.support.toy_text_beds import moves, situations
from world.toy_text import cliff_walking, frozen_lake


def outcomes(
    who: Taught, width: int, explore: float = 0.0
) -> tuple[Counter[str], list[float]]:
    """How the planner fares from everywhere to everywhere, and the steps too many."""
    table, found, extra = who.table, Counter[str](), []
    bad = {(state, True) for state in (5, 7, 11, 12)} if width == 4 else set()
    for goal, place in enumerate(situations(table)):
        if place in bad:
            continue
        kind = "goal" if place[1] else "tile"
        literals = (
            ("tile=goal",) if place[1] else tile(who.env, *divmod(place[0], width))
        )
        at = who.at(literals)
        assert at.nonzero()[0].tolist() == [goal]
        far = distances(table, at)
        for start in (~table.over & ~at).nonzero()[0].tolist():
            way = attempt(who, start, at, "planner", literals, explore)
            if way[-1] == place:
                found[f"{kind} reached"] += 1
                extra.append(len(way) - 1 - far[start])
            elif way[-1] in bad:
                found[f"{kind} drowned"] += 1
            else:
                found[f"{kind} {'passed by' if way[-1][1] else 'never reached'}"] += 1
    return found, extra


def test_on_the_lake_the_planner_gets_there_or_falls_into_a_hole() -> None:
    lake = walker(frozen_lake)
    found, extra = outcomes(lake, 4)
    # It never goes round and round; of 110 pairs of tiles it does 77.
    assert found == {
        "tile reached": 77,
        "tile drowned": 33,
        "goal reached": 4,
        "goal drowned": 7,
    }
    assert min(extra) == 0
    assert np.mean(np.array(extra) == 0) > 0.7


def test_most_holes_are_not_foreseen() -> None:
    lake = walker(frozen_lake)
    inner: Any = lake.env.unwrapped
    sensorium = Sensorium(lake.body.sensors)
    hole, safe = sensorium.literal("tile=hole"), sensorium.literal("tile=hole*")
    foreseen = {}
    for (state, over), action, (after, _) in sorted(moves(lake.table)):
        if over or after not in (5, 7, 11, 12):
            continue
        lake.env.reset(seed=0)
        inner.s = state
        agent = Agent(lake.body, new_policy("walker", lake.body, 0), lake.snapshot)
        agent.act(state_readings(lake.env), begins=True)
        bound = agent.consequences(action)
        foreseen[state, lake.env.actions[action]] = bool(bound[hole])
        assert not bound[safe]
    # What is sensed is a row or a column, in one of which there is ice as well; only
    # the last column has no other tile above a hole that one can stand on.
    assert {move for move, known in foreseen.items() if known} == {(3, "down")}
    assert len(foreseen) == 9


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


def test_what_it_knows_of_the_cliff() -> None:
    cliff = walker(cliff_walking)
    # That the way down from the row above leads to the bottom, not to which end of it;
    # that whoever starts to the right falls back to the start.
    assert cliff.believes("down&~row<2", "row<3*")
    assert not cliff.believes("down&~row<2", "tile=start")
    assert cliff.believes("right&tile=start", "tile=start")
    for column in range(1, 12):
        left, right = f"column<{column}", f"column<{column}*"
        # Going up or down keeps the column, but for those who fall.
        for action in ("up", "down"):
            assert cliff.believes(f"{action}&{left}", left)
        assert cliff.believes(f"up&~{left}", right)
        assert cliff.believes(f"down&~{left}", right) == (column == 11)
    # What cannot be undone: ten ways down, and the one to the goal.
    table = cliff.table
    alive = ~table.over[table.before]
    ways = set(zip(table.before[alive], table.after[alive], strict=True))
    lost = [(b, a) for b, a in ways if (a, b) not in ways]
    assert len(lost) == 11
    # So time is not spent evenly, as prop:convergence has it for reversible moves.
    shares = table.stationary()
    assert shares.max() > 1000 * shares.min()


def test_what_cannot_be_undone_keeps_the_planner_from_going_down() -> None:
    cliff = walker(cliff_walking)
    row, column = 1, 5
    literals = tile(cliff.env, row, column)
    at = cliff.at(literals)
    start = int((cliff.table.states == column).argmax())
    stuck = attempt(cliff, start, at, "planner", literals)
    # One step down would do. But that is believed to lose the column, and up is not.
    assert {state for state, _ in stuck} == {column}
    assert len(stuck) == PATIENCE + 1
    assert attempt(cliff, start, at, "planner", literals, 0.2)[-1] == (17, False)
