"""The worlds with obstacles: their missing states, and the agents' journeys."""

from typing import Any

import numpy as np
import pytest

from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from tools.paper import fig4_excitation, fig5_obstructions
from tools.paper.figure import FigureOptions
from tools.paper.obstacles import ARRIVED, BLOCKED, ObstacleEntry, arena

pytestmark = [pytest.mark.slow, pytest.mark.exhaustive]
PUNCTURED = "neurosnap/PuncturedGrid-v0"
ABOVE = ("x_below_6", "x_below_5*", "y_below_10", "y_below_9*")


def cell(world: str, agent: Any, target: int, *goal: str) -> ObstacleEntry:
    return ObstacleEntry(
        world=world, agent=agent, target=target, goal=goal, limit=40, runs=1, seed=0
    )


def test_the_hole_is_what_blocks_and_nothing_else() -> None:
    punctured = arena(PUNCTURED, 103)
    world = punctured.world
    blocked = {
        (world.body.actions[action], *world.coordinates[place].tolist())
        for action, place in np.argwhere(punctured.blocked)
    }
    around = {("up", 5, 4), ("down", 5, 6), ("right", 4, 5), ("left", 6, 5)}
    assert blocked == around
    assert not arena("neurosnap/Grid-v0", 104).blocked.any()
    assert not arena("neurosnap/Rail-v0", 12).blocked.any()


def test_exposure_is_perfect_and_forgives_one_exception() -> None:
    punctured = arena(PUNCTURED, 103)
    snapshot = EmpiricalSnapshot.from_bytes(punctured.snapshot)
    assert snapshot.clock == 20 * punctured.world.moves.size
    literal, graph = snapshot.sensorium, snapshot.poc_graph()
    names = {name: 2 * k for k, name in enumerate(punctured.world.body.sensors)}
    assert len(literal) == len(names)
    # What the hole makes an exception of is believed all the same, as
    # [GK] "A Punctured Grid" has it.
    assert graph.leq(names["up&~y_below_4"], names["y_below_5"] ^ 1)
    assert graph.leq(names["left&x_below_7"], names["x_below_6"])
    # And what has more than one exception is not.
    assert not graph.leq(names["up&~y_below_4"], names["y_below_6"] ^ 1)


def test_greedy_planning_is_perfect_until_a_place_is_missing() -> None:
    whole = cell("neurosnap/Grid-v0", "greedy", 104, *ABOVE)
    found = whole.row(0)
    world = arena(whole.world, whole.target).world
    assert np.array_equal(found[:, ARRIVED], world.distances)
    assert not found[:, BLOCKED].any()
    assert np.array_equal(whole.row(0), found)

    holed = cell(PUNCTURED, "greedy", 103, *ABOVE).row(0)
    stuck = holed[:, ARRIVED] < 0
    assert stuck.any()
    assert (holed[stuck, BLOCKED] > 10).all()  # it tries for as long as it is let
    below = arena(PUNCTURED, 103).world.coordinates.tolist().index([5, 4])
    assert stuck[below]


def test_the_goal_is_where_all_of_it_holds() -> None:
    grid = arena("neurosnap/Grid-v0", 104)
    assert grid.reached(ABOVE).nonzero()[0].tolist() == [104]
    assert grid.world.coordinates[104].tolist() == [5, 9]
    assert grid.world.distances[104] == 0
    rail = arena("neurosnap/Rail-v0", 12)
    assert rail.reached(("near_12",)).nonzero()[0].tolist() == [11, 12, 13]


def test_claims_follow_the_numbers() -> None:
    options = FigureOptions(runs=1)
    made = fig5_obstructions.cells(options)
    rows = [
        np.zeros((len(arena(one.world, one.target).world.fields.T), 2), int)
        for one in made
    ]  # everybody is there at once
    report = fig5_obstructions.report(options, [row[np.newaxis] for row in rows])
    assert [claim.holds for claim in report.claims] == [False, False, True, True]
    for row in rows:
        row[:, ARRIVED] = -1  # nobody ever
    report = fig5_obstructions.report(options, [row[np.newaxis] for row in rows])
    assert [claim.holds for claim in report.claims] == [False, False, True, False]
    assert all("none arrive" in line for line in report.lines)


def test_claims_about_the_excited_follow_the_numbers() -> None:
    options = FigureOptions(runs=2, steps=3)
    made = fig4_excitation.cells(options)
    near = [np.ones((2, 3), np.uint16) for _ in made]
    for last, holds in ((1, [True, True]), (2, [True, False])):
        near[0][1, -1] = last
        report = fig4_excitation.report(options, near)
        assert [claim.holds for claim in report.claims] == holds
    rows = list(fig4_excitation.report(options, near).rows)
    assert len(rows) == len(made) * 3
    assert rows[2] == ("path", "", "drawn", 3, "1.5", "0.5", 1, 2)
