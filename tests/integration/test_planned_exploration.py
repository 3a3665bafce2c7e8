"""Runs that explore by plan decide as an agent does that learns in one process."""

import asyncio
from pathlib import Path

import msgspec
import pytest

from neurosnap.agent.agent import Agent
from neurosnap.agent.policy import EXACT
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.integration.test_growing_swarm import by_one_agent, decisions
from tests.support.command_line import call
from tests.support.run_options import options_for
from world.toy_text import frozen_lake

LAKE = "neurosnap/FrozenLake-v0"
SEED = 5
STEPS = 40


def planned(**more: object) -> RunOptions:
    given = {"grow": 4, "imagine": 300, "target": (), "threshold": EXACT, **more}
    return options_for(LAKE, SEED, agent="planner", explore="planned", **given)  # type: ignore[arg-type]


def learner() -> Agent:
    return Agent.of(
        frozen_lake(),
        "planner",
        target=["row<1"],  # not what `learn` is for
        seed=SEED,
        grow=4,
        imagine=300,
    )


@pytest.mark.parametrize(
    "cells", ["inline", pytest.param("worker", marks=pytest.mark.zenoh)]
)
def test_a_run_decides_as_an_agent_that_learns(
    cells: CellKind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken = []
    agent = learner()
    act = agent.act

    def noted(*given: object, **more: object) -> object:
        taken.append(act(*given, **more))  # type: ignore[arg-type]
        return taken[-1]

    monkeypatch.setattr(agent, "act", noted)
    agent.learn(frozen_lake(), STEPS, seed=SEED)

    log = tmp_path / "log"
    options = planned(cells=cells, ticks=STEPS + 1)
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    assert verify(log).same
    swarm = decisions(log)
    assert [swarm[tick] for tick in range(1, STEPS + 1)] == taken[:-1]
    assert any(one.why.startswith("to learn what") for one in taken)
    assert any(one.why == "at random, to explore" for one in taken)


def test_with_a_target_it_explores_until_it_knows_a_way() -> None:
    options = planned(ticks=600, target=("tile=goal",), grow=30)
    reasons = [one.why for one in by_one_agent(options)]
    first = next(tick for tick, why in enumerate(reasons) if why.startswith("in "))
    assert all(why.startswith("to learn what") for why in reasons[:first])
    # Six steps, and one at the goal, where the episode is over.
    steps = [why.partition(":")[0] for why in reasons[first : first + 6]]
    assert steps == ["in 6", "in 5", "in 4", "in 3", "in 2", "in 1"]
    assert sum(why.startswith("in 6: ") for why in reasons[first : first + 70]) == 10


def test_an_agent_that_runs_by_plan_does_what_it_does_when_it_learns() -> None:
    env = frozen_lake()
    one = learner()
    one.learn(env, 200, seed=1)
    given = {"grow": 4, "imagine": 300, "seed": SEED}
    two = Agent.of(env, "planner", explore="planned", **given)  # type: ignore[arg-type]
    two.run(env, 200, seed=1)
    assert one.body == two.body
    assert one.snapshot.to_bytes() == two.snapshot.to_bytes()


def test_the_command_line_takes_the_word(tmp_path: Path) -> None:
    log = tmp_path / "a.mcap"
    given = [
        "--agent",
        "planner",
        "--set",
        "agent.imagine=50",
        "--set",
        "agent.explore=planned",
    ]
    result = call(
        "run", LAKE, *given, "--cells", "inline", "--ticks", "5", "--out", log
    )
    assert result.exit_code == 0, result.output
    assert decisions(log)[1].why.startswith("to learn what")
    refused = call("run", LAKE, *given[:2], *given[4:], "--out", tmp_path / "b.mcap")
    assert refused.exit_code == 2
    assert "explore: must go with a planner that imagines" in refused.output


def test_recordings_keep_a_share_as_a_number() -> None:
    options = msgspec.structs.replace(planned(), explore=0.25)
    for one in (options, planned()):
        again = msgspec.json.decode(msgspec.json.encode(one), type=RunOptions)
        assert again == one
