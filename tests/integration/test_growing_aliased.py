"""Worlds in which places look alike: what was done a step before tells them apart."""

import asyncio
from pathlib import Path

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.memory import body_in
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sources.open import open_source
from tests.support import run_options
from tests.support.aliased_worlds import NAME, ring, t_maze
from tests.support.exhaustive import rows
from tools.paper.stages import Stage, StageEnv

SEEDS = range(3)


def taught(stage: Stage, steps: int, seed: int) -> Agent:
    agent = Agent.of(StageEnv(stage), "planner", seed=seed, grow=True, imagine=True)
    agent.learn(StageEnv(stage), steps, seed=seed)
    return agent


def sent(agent: Agent, stage: Stage, goal: str, start: int, seed: int) -> int:
    """Return the steps from a place to a goal, of 60 at most."""
    chances = np.arange(len(stage.start)) == start
    env = StageEnv(Stage(**{**vars(stage), "start": chances.astype(np.float64)}))
    outing = agent.send(env, [goal], 60, seed=seed)
    assert outing.reached
    return outing.steps


@pytest.mark.parametrize("seed", rows(SEEDS[:1], SEEDS[1:]))
def test_in_a_t_maze_what_was_seen_at_the_start_tells_where_to_turn(seed: int) -> None:
    maze = t_maze()
    agent = taught(maze, 600, seed)
    assert len(agent.body.in_use) <= 20
    assert any(agent.body.split(literals)[1] for _, literals in agent.body.in_use)
    taken = [
        sent(agent, maze, "food", start, 50 + k) for k in range(5) for start in (0, 1)
    ]
    assert taken == [2] * 10


@pytest.mark.parametrize("seed", rows(SEEDS[:1], SEEDS[1:]))
def test_on_a_ring_dark_places_are_told_apart_by_the_beacon_one_came_from(
    seed: int,
) -> None:
    around = ring(4, (0, 2))
    agent = taught(around, 600, seed)
    assert len(agent.body.in_use) <= 20
    assert agent.chance == {}
    assert sent(agent, around, "beacon_0", start=2, seed=seed) == 2
    # From a dark place, one step, or three if what it takes first leads away.
    for start in (1, 3):
        assert sent(agent, around, "beacon_0", start, seed) in (1, 3)


@pytest.mark.parametrize("seed", rows(SEEDS[:1], SEEDS[1:]))
def test_where_one_step_back_is_not_enough_it_says_so_and_arrives_all_the_same(
    seed: int,
) -> None:
    around = ring(6, (0, 3))
    agent = taught(around, 2000, seed)
    assert len(agent.body.in_use) <= 20
    assert agent.chance == dict.fromkeys(("left", "right"), around.sensors)
    for start in range(1, 6):
        sent(agent, around, "beacon_0", start, seed)


def decisions_alone(options: RunOptions) -> list[wire.Decision]:
    memory = options.new_memory()
    agent = Agent(
        options.body, options.policy_with(memory), options.new_snapshot(), memory
    )
    source = open_source(options.source, options.seed)
    found, seen = list[wire.Decision](), source.first()
    while seen is not None and len(found) < options.ticks:
        found.append(agent.act(seen.bits, seen.begins))
        seen = source.step(found[-1].action)
    source.close()
    return found


def test_a_swarm_looks_a_step_back_as_one_agent_does(tmp_path: Path) -> None:
    options = run_options.options_for(
        NAME,
        5,
        agent="planner",
        cells="inline",
        ticks=200,
        grow=8,
        imagine=20,
        target=(),
        explore=0.1,
        threshold=0.001,
        keyframe_every=50,
    )
    log = tmp_path / "log"
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, 200)
    swarm = [
        one.message
        for one in Recording.open(log).messages(("decision",))
        if isinstance(one.message, wire.Decision)
    ]
    assert swarm[1:] == decisions_alone(options)[:-1]
    *_, frame = (
        one.message
        for one in Recording.open(log).messages(("keyframe",))
        if isinstance(one.message, wire.KeyFrame)
    )
    body = body_in(options.body, frame.agent)
    assert any(body.split(literals)[1] for _, literals in body.grown)
