"""The compiled loop is the agent, step by step; tasks are what they say."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.excited import EXPLORES, KEEPS, LOST, SEEKS
from neurosnap.agent.random_numbers import RandomNumbers
from neurosnap.apps.figures.experiments.compiled_agent import drive
from neurosnap.apps.figures.experiments.target_distance import (
    TargetEntry,
    Task,
    guaranteed,
    task,
)
from neurosnap.apps.figures.experiments.walks import SETTINGS
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.sources.gymnasium_source import import_worlds

STEPS = 260
THRESHOLD = 1 / 100
REASONS = {
    "guarantees better": SEEKS,
    "guarantees worse*; nothing guarantees better": KEEPS,
    "at random, to explore; nothing guarantees better": EXPLORES,
    "at random: nothing guarantees better or worse*": LOST,
}


def driven(todo: Task, decay: float | None, explore: float) -> Any:
    return drive(
        todo.moves,
        todo.fields.view(np.uint8),
        todo.distances,
        todo.start,
        THRESHOLD,
        -1.0 if decay is None else decay,
        explore,
        RandomNumbers(todo.seed).table(STEPS + 1),
    )


@pytest.mark.parametrize("decay", [None, 0.9])
@pytest.mark.parametrize("setting", SETTINGS, ids=lambda setting: setting.name)
def test_the_loop_decides_what_the_agent_decides(
    setting: Any, decay: float | None
) -> None:
    todo = task(setting.name, seed=3, run=1)
    import_worlds()
    env: gymnasium.Env[Any, Any] = gymnasium.make(setting.world, target="drawn")
    bits, info = env.reset(seed=todo.reset)
    sensors = 20 + 2 + len(env.get_wrapper_attr("actions")) * 41
    snapshot = (
        EmpiricalSnapshot(sensors, THRESHOLD)
        if decay is None
        else DiscountedSnapshot(sensors, THRESHOLD, decay)
    )
    agent = Agent.of(env, "excited", seed=todo.seed, explore=0.3, snapshot=snapshot)
    distance, action, reason = driven(todo, decay, 0.3)
    for step in range(STEPS):
        assert distance[step] == info["distance"]
        decision = agent.act(bits)
        assert (action[step], reason[step]) == (decision.action, REASONS[decision.why])
        bits, _, _, _, info = env.step(decision.action)
    assert len(set(reason.tolist())) >= 3  # or little of the loop was looked at


def test_a_row_is_a_function_of_cell_and_run() -> None:
    cell = TargetEntry(
        setting="cycle",
        threshold=THRESHOLD,
        decay=None,
        explore=0.2,
        target=None,
        runs=3,
        steps=50,
        seed=1,
    )
    rows = [cell.row(run).tolist() for run in (2, 0, 1)]
    assert [cell.row(run).tolist() for run in (2, 0, 1)] == rows
    assert rows[0] != rows[1] != rows[2]
    assert cell.key != TargetEntry(**{**_fields(cell), "target": 3}).key


def _fields(cell: TargetEntry) -> dict[str, Any]:
    return {name: getattr(cell, name) for name in cell.__struct_fields__}


def test_what_is_guaranteed_is_what_one_sensation_tells_everywhere() -> None:
    for name in ("path", "random"):
        todo = task(name, seed=0, run=0, target=7)
        assert todo.distances[7] == 0
        sure = [_helped(todo, place) for place in range(21) if place != 7]
        assert guaranteed(todo) == pytest.approx(np.mean(sure))


def _helped(todo: Task, place: int) -> bool:
    """Whether a sensation of the place and an action lead nearer wherever it holds."""
    for field in [*todo.fields, *~todo.fields]:
        if not field[place]:
            continue
        there = np.flatnonzero(field)
        for leads in todo.moves:
            if all(todo.distances[leads[p]] < todo.distances[p] for p in there):
                return True
    return False
