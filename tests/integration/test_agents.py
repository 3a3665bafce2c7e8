"""An agent decides the same in process and in a swarm, and gets where it wants to."""

import asyncio
from pathlib import Path
from typing import Any

import gymnasium
import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policy import AgentKind
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import CellKind, RunOptions, SnapshotKind
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of, drawn_to
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sensorium import pack, unpack
from neurosnap.sources.gymnasium_source import import_worlds
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Argument, Observed, Source
from tests.support import run_options
from tests.support.exhaustive import rows
from tests.support.rewritten_recordings import changing, rewritten

SEED = 5
TICKS = 40
PATH = "neurosnap/Path-v0"
WORLDS: dict[str, dict[str, Argument]] = {
    PATH: {"places": 5},
    "neurosnap/Cycle-v0": {"places": 6},
    "neurosnap/Grid-v0": {"width": 3, "height": 3},
}


def options_for(
    agent: AgentKind,
    source: str = PATH,
    *,
    cells: CellKind = "inline",
    snapshot: SnapshotKind = "empirical",
    ticks: int = TICKS,
) -> RunOptions:
    arguments = WORLDS[source] | {"wait": True}
    if agent == "excited":
        arguments |= drawn_to(source, SEED, arguments, "1")
    return run_options.options_for(
        source,
        SEED,
        arguments,
        agent=agent,
        explore=0.25,
        ticks=ticks,
        snapshot=snapshot,
        threshold=0.05,
        cells=cells,
        keyframe_every=25,
    )


def swarm_run(options: RunOptions, log: Path, past: ResumePoint | None = None) -> None:
    asyncio.run(run(RunRequest(options, log, past), asyncio.Event()))


def of_recording(log: Path) -> tuple[list[bytes], list[wire.Decision]]:
    messages = [r.message for r in Recording.open(log).messages(("state", "decision"))]
    states = [m.literals for m in messages if isinstance(m, wire.State)]
    return states, [m for m in messages if isinstance(m, wire.Decision) and m.tick]


def in_process(options: RunOptions) -> tuple[list[bytes], list[wire.Decision]]:
    """The same agent without a swarm, in the same world."""
    import_worlds()
    given: dict[str, Any] = dict(options.arguments)
    env = gymnasium.make(options.source, disable_env_checker=True, **given)
    agent = Agent(options.body, options.new_policy(), options.new_snapshot())
    bits, _ = env.reset(seed=SEED)
    states, decisions = [], []
    for _ in range(options.ticks):
        decisions.append(agent.act(bits))
        states.append(pack(agent.state))
        bits, *_ = env.step(decisions[-1].action)
    # The last decision of a run is never published: nobody would answer it.
    return states, decisions[:-1]


@pytest.mark.parametrize(
    ("agent", "source", "snapshot"),
    rows(
        [
            ("excited", PATH, "empirical"),
            ("planner", "neurosnap/Cycle-v0", "discounted"),
        ],
        [
            ("planner", PATH, "discounted"),
            ("excited", "neurosnap/Grid-v0", "discounted"),
            ("planner", "neurosnap/Grid-v0", "empirical"),
        ],
    ),
)
def test_the_same_seed_gives_the_same_decisions_in_process_and_in_a_swarm(
    agent: AgentKind, source: str, snapshot: SnapshotKind, tmp_path: Path
) -> None:
    options = options_for(agent, source, snapshot=snapshot)
    swarm_run(options, tmp_path / "log")
    expected = in_process(options)
    assert of_recording(tmp_path / "log") == expected
    # Or all of this would say little: it does not only move at random.
    assert any("guarantees" in decision.why for decision in expected[1])


@pytest.mark.zenoh
@pytest.mark.slow
@pytest.mark.parametrize("agent", rows(["planner"], ["excited"]))
def test_cells_that_are_processes_decide_the_same(
    agent: AgentKind, tmp_path: Path
) -> None:
    options = options_for(agent, cells="process", ticks=30)
    swarm_run(options, tmp_path / "log")
    assert of_recording(tmp_path / "log") == in_process(options)
    verdict = verify(tmp_path / "log")
    assert (verdict.same, verdict.complete) == (True, True)


@pytest.mark.parametrize("agent", ["excited", "planner"])
def test_a_resumed_agent_goes_on_as_if_nothing_had_been(
    agent: AgentKind, tmp_path: Path
) -> None:
    options = options_for(agent)
    first = msgspec.structs.replace(options, ticks=20)
    swarm_run(first, tmp_path / "first")
    again, past = find_resume_point(tmp_path / "first")
    again = msgspec.structs.replace(again, ticks=TICKS)
    swarm_run(again, tmp_path / "second", past=past)
    assert of_recording(tmp_path / "second") == in_process(options)
    assert verify(tmp_path / "second").same


class Foggy:
    """A source of which every reading may be missing, the first excepted.

    What is missing reads the opposite of what it should.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._chance = np.random.default_rng(SEED)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._source, name)

    def first(self) -> Observed | None:
        return self._seen(self._source.first())

    def step(self, action: int) -> Observed | None:
        return self._seen(self._source.step(action))

    def _seen(self, seen: Observed | None) -> Observed | None:
        if seen is None:
            return None
        known = self._chance.random(len(seen.bits)) < 0.7
        known[0] = True
        return Observed(seen.bits ^ ~known, known, seen.begins, seen.cut)


@pytest.mark.parametrize(
    ("agent", "snapshot"),
    [("walker", "discounted"), ("excited", "empirical"), ("planner", "discounted")],
)
def test_what_is_not_read_is_missing_alike_in_process_and_in_a_swarm(
    agent: AgentKind,
    snapshot: SnapshotKind,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options = options_for(agent, snapshot=snapshot)
    monkeypatch.setattr(
        "neurosnap.runtime.parts.world_process.open_source",
        lambda *given: Foggy(open_source(*given)),
    )
    swarm_run(options, tmp_path / "log")
    source = Foggy(open_source(PATH, SEED, options.arguments))
    alone = Agent(options.body, options.new_policy(), options.new_snapshot())
    seen, states, decisions = source.first(), [], []
    for _ in range(options.ticks):
        assert seen is not None
        # Whatever an unknown reading is said to be: here it is what it should be.
        assert seen.known is not None
        right = seen.bits ^ ~seen.known
        decisions.append(alone.act(right, seen.begins, seen.known))
        states.append(pack(alone.state))
        seen = source.step(decisions[-1].action)
    assert of_recording(tmp_path / "log") == (states, decisions[:-1])
    verdict = verify(tmp_path / "log")
    assert (verdict.same, verdict.complete) == (True, True), verdict.difference


def test_what_was_sensed_of_an_action_is_checked_against_the_decision(
    tmp_path: Path,
) -> None:
    options = options_for("excited")
    swarm_run(options, tmp_path / "log")
    # As if the world had made up what was done: every reading of an action inverted.
    felt = slice(len(options.body.own), len(options.body.own) + 3)

    def felt_wrongly(message: wire.Observation) -> dict[str, object]:
        bits = unpack(message.bits, len(options.sensors))
        bits[felt] = ~bits[felt]
        return {"bits": pack(bits)}

    change = changing(wire.Observation, lambda m: m.tick == 7, felt_wrongly)
    verdict = verify(rewritten(tmp_path / "log", tmp_path / "changed", change))
    assert not verdict.same
    assert "tick 7: /observation: forward does not follow" in str(verdict.difference)


def test_an_excited_agent_is_given_a_target_where_it_needs_one() -> None:
    assert drawn_to(PATH, SEED, {}, "3") == {"target": 3}
    assert drawn_to(PATH, SEED, {}, None) == {"target": "drawn"}
    assert drawn_to(PATH, SEED, {"target": 2}, None) == {}
    with pytest.raises(InvalidValueError, match=r"^target: must be the number"):
        drawn_to(PATH, SEED, {}, "below_3")


def test_a_walker_gets_no_more_than_the_worlds_own_sensors() -> None:
    source = open_source(PATH, SEED, {"wait": True})
    assert body_of(source, "walker").sensors == source.sensors
    full = body_of(source, "excited")
    assert full == Body.full(source.sensors, source.actions, source.orders)
    assert len(full.sensors) == len(source.sensors) * 7 + 3
    assert np.all(full.position[: 2 * len(source.sensors)])
