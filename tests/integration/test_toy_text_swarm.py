"""A swarm on the lake senses where an episode begins."""

import asyncio
from pathlib import Path

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sensorium import unpack
from neurosnap.sources.open import open_source


def lake_run(log: Path) -> RunOptions:
    """Record a planner on the lake, with every sensor a cell, over some episodes."""
    source = open_source("neurosnap/FrozenLake-v0", 0)
    source.close()
    options = RunOptions(
        source="neurosnap/FrozenLake-v0",
        body=body_of(source, "planner"),
        agent="planner",
        target=("tile=goal",),
        explore=0.5,
        ticks=40,
        seed=0,
        cells="inline",
    )
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    return options


def observed(log: Path) -> list[wire.Observation]:
    messages = (one.message for one in Recording.open(log).messages(("observe",)))
    return [one for one in messages if isinstance(one, wire.Observation)]


def test_a_swarm_senses_no_action_where_an_episode_begins(tmp_path: Path) -> None:
    options = lake_run(tmp_path / "log")
    source = open_source(options.source, options.seed)
    agent = Agent(options.body, options.new_policy(), options.new_snapshot())
    seen, own = source.first(), len(source.sensors)
    decisions = []
    assert seen is not None
    for one in observed(tmp_path / "log"):
        sensed = unpack(one.bits, len(options.body.sensors))
        np.testing.assert_array_equal(sensed[:own], seen.bits)
        assert one.begins == seen.begins
        assert sensed[own:].any() != one.begins
        decisions.append(agent.act(seen.bits, seen.begins))
        after = source.step(decisions[-1].action)
        assert after is not None
        seen = after
    messages = (one.message for one in Recording.open(tmp_path / "log").messages())
    decided = [one for one in messages if isinstance(one, wire.Decision)]
    assert decided[1:] == decisions[:-1]  # nobody would answer the last one
    begins = [one.tick for one in observed(tmp_path / "log") if one.begins]
    assert begins[0] == 1
    assert len(begins) > 2
    verdict = verify(tmp_path / "log")
    assert (verdict.same, verdict.complete) == (True, True)


def test_a_beginning_that_is_kept_quiet_is_noticed(tmp_path: Path) -> None:
    lake_run(tmp_path / "log")
    recording = Recording.open(tmp_path / "log")
    tick = [one.tick for one in observed(tmp_path / "log") if one.begins][1]
    with Writer(tmp_path / "changed") as writer:
        writer.start(recording.metadata)
        for recorded in recording.messages():
            delivery, message = recorded.delivery, recorded.message
            if isinstance(message, wire.Observation) and message.tick == tick:
                forged = msgspec.structs.replace(message, begins=False)
                delivery = delivery._replace(payload=wire.encode(forged))
            writer.add(delivery, recorded.log_time)
    verdict = verify(tmp_path / "changed")
    assert not verdict.same
    assert f"tick {tick}: /observe: " in str(verdict.difference)
    assert "does not follow from the decision" in str(verdict.difference)
