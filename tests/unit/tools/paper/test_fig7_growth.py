"""Tables of the growth experiment match their worlds, and learners run on them."""

from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest

from tools.paper import fig7_growth
from tools.paper.explorers import CHECKS
from tools.paper.growing import (
    FALLS,
    NEED,
    STEPS,
    UNFORESEEN,
    USED,
    WAVES,
    WHOLE,
    GrowthEntry,
    Method,
)
from tools.paper.tabular import PlaceTable, follow, q_learning
from tools.paper.worlds_as_tables import Setting, StageEnv, settings, stage_of

pytestmark = [pytest.mark.slow, pytest.mark.exhaustive]
LAKE = Setting(name="lake", world="neurosnap/FrozenLake-v0", steps=400, journeys=20)
(CLIFF,) = (one for one in settings() if one.name == "cliff")
METHODS = fig7_growth.METHODS


def entry(method: Method, setting: Setting = LAKE, **fields: Any) -> GrowthEntry:
    return GrowthEntry(setting=setting, method=method, runs=1, seed=0, **fields)


@pytest.mark.parametrize("name", ["lake 4x4", "cliff", "punctured grid", "rail"])
def test_a_stage_does_what_the_world_does(name: str) -> None:
    (setting,) = (one for one in settings() if one.name == name)
    stage = stage_of(setting)
    assert stage.certain
    env: Any = gymnasium.make(setting.world, **dict(setting.arguments))
    ours = StageEnv(stage)
    reading, info = env.reset(seed=1)
    ours.reset(seed=1)
    ours.put(int(info.get("place", ours.place)))
    for action in np.random.default_rng(0).integers(len(stage.actions), size=300):
        assert (ours.reading() == reading).all()
        reading, _, over, _, _ = env.step(int(action))
        assert ours.step(action)[2] == over
        if over:
            reading, _ = env.reset()
            ours.reset()
    env.close()


def test_falls_are_told_from_what_leads_to_the_same_place() -> None:
    cliff, lake = stage_of(CLIFF), stage_of(LAKE)
    # Down from the row above the cliff, and right from the start.
    assert len(cliff.falls) == 11
    (start,) = np.flatnonzero(cliff.start).tolist()
    assert {after for _, _, after in cliff.falls} == {start}
    stays = [a for a, ways in enumerate(cliff.outcomes[start]) if ways[0][1] == start]
    assert len(stays) == 3
    assert [a for a in stays if (start, a, start) in cliff.falls] == [1]
    hole = lake.fields[lake.sensors.index("tile=hole")]
    assert {after for *_, after in lake.falls} == set(np.flatnonzero(hole).tolist())


@pytest.mark.parametrize(
    ("method", "steps"), [("growth and imagining", 1000), ("imagining only", 150)]
)
def test_who_knows_the_cliff_goes_over_it_by_intent_only(
    method: Method, steps: int
) -> None:
    setting = msgspec.structs.replace(CLIFF, steps=steps, journeys=20)
    row = entry(method, setting).row(0)[CHECKS:]
    falls, unforeseen = row[:, FALLS].sum(), row[:, UNFORESEEN].sum()
    assert falls > 0
    assert unforeseen == 0 if method == "growth and imagining" else unforeseen > 0


def test_coins_are_thrown_and_the_rest_is_sensed() -> None:
    stage = stage_of(msgspec.structs.replace(LAKE, coins=3))
    env = StageEnv(stage)
    env.reset(seed=0)
    read = np.array([env.reading() for _ in range(50)])
    assert (read[:, :-3] == read[0, :-3]).all()
    assert set(read[:, -3:].mean(axis=0).round()) <= {0.0, 1.0}
    assert 0 < read[:, -3:].mean() < 1


def test_the_slippery_have_several_outcomes_that_add_up() -> None:
    slip = msgspec.structs.replace(LAKE, arguments=(("is_slippery", True),))
    stage = stage_of(slip)
    assert not stage.certain
    for row, over in zip(stage.outcomes, stage.over, strict=True):
        for ways in row:
            assert over or sum(chance for chance, _ in ways) == pytest.approx(1)


@pytest.mark.parametrize("updates", [0, 10])
def test_learners_of_values_find_the_goal(updates: int) -> None:
    stage = stage_of(LAKE)
    choice = q_learning(stage, stage.goals, 4000, 0, updates)
    start = int(stage.start.argmax())
    assert follow(stage, choice, start, stage.goals, 20, 0) == 6


def test_a_table_tries_everything_and_goes_the_shortest_way() -> None:
    stage = stage_of(LAKE)
    table = PlaceTable(stage, 400, 0)
    assert len(table.led) == int((~stage.over).sum()) * 4 == table.tried[-1]
    far, choice = stage.distances(stage.goals), table.policy(stage.goals)
    for start in np.flatnonzero(~stage.over & np.isfinite(far)).tolist():
        assert follow(stage, choice, start, stage.goals, 20, 0) == far[start]


def test_with_growth_all_is_whole_and_every_journey_the_shortest() -> None:
    cell = entry("growth and imagining", msgspec.structs.replace(LAKE, steps=800))
    row = cell.row(0)
    assert row[CHECKS - 1, WHOLE] == 44
    assert 0 < row[CHECKS - 1, USED] <= 25
    journeys = row[CHECKS:]
    assert (journeys[:, STEPS] == journeys[:, NEED]).all()
    assert (journeys[:, WAVES] > 0).all()


@pytest.mark.parametrize("method", fig7_growth.METHODS)
def test_every_method_runs_where_walks_are_random(method: Method) -> None:
    (rail,) = (one for one in settings() if one.name == "rail")
    row = entry(method, msgspec.structs.replace(rail, steps=80, journeys=2)).row(0)
    assert ((row[CHECKS:, STEPS] >= -1) & (row[CHECKS:, NEED] > 0)).all()
