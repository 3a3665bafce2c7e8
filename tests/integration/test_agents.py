"""A swarm decides the same as an agent in one process."""

import asyncio
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.body import Body
from neurosnap.agent.policy import EXACT, AgentKind
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import CellKind, RunOptions, SnapshotKind
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of, drawn_to
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from neurosnap.sensorium import pack, unpack
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Argument, Observed, Source
from tests.support.aliased_worlds import NAME as MAZE
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.lamp import BIRTH, LIMITED, lamp_options
from tests.support.recorded_messages import of_type
from tests.support.rewritten_recordings import changing, rewritten
from tests.support.run_options import options_for

pytestmark = pytest.mark.slow

SEED = 5
TICKS = 40
PATH, CYCLE = "neurosnap/Path-v0", "neurosnap/Cycle-v0"
WORLDS: dict[str, dict[str, Argument]] = {PATH: {"places": 5}, CYCLE: {"places": 6}}


def acting(
    agent: AgentKind, source: str, *, snapshot: SnapshotKind = "empirical", **more: Any
) -> RunOptions:
    """Return a run of an agent that acts in one of the paper's worlds."""
    arguments = WORLDS[source] | {"wait": True}
    if agent == "excited":
        arguments |= drawn_to(source, SEED, arguments, "1")
    given = {"ticks": TICKS, "threshold": 0.05, "keyframe_every": 25, **more}
    return options_for(
        source, SEED, arguments, agent=agent, explore=0.25, snapshot=snapshot, **given
    )


def planned(**more: object) -> RunOptions:
    """Return a run that explores the lake by plan."""
    given = {"grow": 4, "imagine": 300, "target": (), "threshold": EXACT, "ticks": 41}
    return options_for(
        "neurosnap/FrozenLake-v0",
        5,
        agent="planner",
        explore="planned",
        **{**given, **more},  # type: ignore[arg-type]
    )


RUNS: dict[str, Callable[..., RunOptions]] = {
    "excited": partial(acting, "excited", PATH, snapshot="empirical"),
    "planner": partial(acting, "planner", PATH, snapshot="discounted"),
    "excited on a cycle": partial(acting, "excited", CYCLE, snapshot="discounted"),
    "planner on a cycle": partial(acting, "planner", CYCLE, snapshot="empirical"),
    "grows": partial(lamp_options, ticks=TICKS),
    "cut off": partial(lamp_options, LIMITED, ticks=TICKS),
    "planned": planned,
    "steps back": partial(
        options_for,
        MAZE,
        5,
        agent="planner",
        ticks=200,
        grow=8,
        imagine=20,
        target=(),
        explore=0.1,
        threshold=0.001,
        keyframe_every=50,
    ),
    "rewarded": partial(
        options_for,
        "neurosnap/FrozenLake-v0",
        1,
        {"senses_reward": True},
        agent="planner",
        grow=30,
        imagine=300,
        target=("rewarded",),
        explore="planned",
        threshold=EXACT,
        ticks=40,
    ),
}


def made(options: RunOptions, log: Path) -> Path:
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    return log


def recorded_in(log: Path) -> tuple[list[bytes], list[wire.Decision]]:
    """Return the states and decisions of a recording, except the one that opens it."""
    states = [state.literals for state in of_type(log, wire.State)]
    return states, [one for one in of_type(log, wire.Decision) if one.tick]


def by_one_agent(
    options: RunOptions, source: Source | None = None
) -> tuple[list[bytes], list[wire.Decision]]:
    """Return the states and decisions of an agent that has all in one process."""
    if source is None:
        source = open_source(options.source, options.seed, options.arguments)
    memory = options.new_memory()
    agent = Agent(
        options.body, options.new_policy(memory), options.new_snapshot(), memory
    )
    states, decisions = list[bytes](), list[wire.Decision]()
    seen = source.first()
    while seen is not None and len(decisions) < options.ticks:
        if seen.cut:
            agent.set_down()
        # Whatever an unknown reading is said to be: here it is what it should be.
        bits = seen.bits if seen.known is None else seen.bits ^ ~seen.known
        decisions.append(agent.act(bits, seen.begins, seen.known))
        states.append(pack(agent.state))
        seen = source.step(decisions[-1].action)
    # The last decision of a run is never published: nothing would answer it.
    return states, decisions[:-1]


@pytest.mark.zenoh
@pytest.mark.parametrize(
    ("name", "cells"),
    rows(
        [
            ("excited", "inline"),
            ("planner on a cycle", "inline"),
            ("grows", "inline"),
            ("grows", "process"),
            ("cut off", "inline"),
            ("planned", "inline"),
            ("steps back", "inline"),
            ("rewarded", "inline"),
        ],
        [
            ("planner", "process"),
            ("excited on a cycle", "inline"),
            ("grows", "worker"),
            ("cut off", "worker"),
            ("steps back", "worker"),
        ],
    ),
)
def test_a_swarm_decides_as_one_agent(
    name: str, cells: CellKind, tmp_path: Path
) -> None:
    options, log = RUNS[name](cells=cells), tmp_path / "log"
    made(options, log)
    ticks = options.ticks
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, ticks)
    states, alone = by_one_agent(options)
    recorded = recorded_in(log)
    assert recorded[1] == alone
    born = {one.tick: (one.context, one.literals) for one in alone if one.born >= 0}
    if not born:  # one agent's state has a newborn sensor at once
        assert recorded[0] == states
    if "excited" in name or name.startswith("planner"):
        # Or all of this would say little: it does not only move at random.
        assert any("guarantees" in one.why for one in alone)
    match name:
        case "grows":
            assert list(born) == [BIRTH]
        case "planned":
            assert any(one.why.startswith("to learn what") for one in alone)
            assert any(one.why == "at random, to explore" for one in alone)
        case "steps back":
            split = options.body.split
            assert any(split(literals)[1] for _, literals in born.values())


@pytest.fixture(scope="module")
def wholes(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Recordings of inline runs, each made once."""
    folder = tmp_path_factory.mktemp("wholes")

    def whole(name: str) -> Path:
        log = folder / name
        return log if log.exists() else made(RUNS[name](cells="inline"), log)

    return whole


@pytest.mark.parametrize(
    ("name", "stop"),
    [
        *((name, 20) for name in ("excited", "planner")),
        *(("grows", BIRTH + later) for later in (0, 1, 9)),
    ],
)
def test_it_goes_on_as_if_nothing_had_been(
    name: str, stop: int, wholes: Callable[[str], Path], tmp_path: Path
) -> None:
    begun, log, whole = tmp_path / "begun", tmp_path / "log", wholes(name)
    made(RUNS[name](ticks=stop, cells="inline"), begun)
    _, past = find_resume_point(begun)
    options = RUNS[name](cells="inline")
    asyncio.run(run(RunRequest(options, log, past), asyncio.Event()))
    assert course(log) == course(whole)
    assert verify(log).same
    before = of_type(whole, wire.Decision)
    assert all(one in before for one in of_type(log, wire.Decision) if one.tick)


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
    options = acting(agent, PATH, snapshot=snapshot, cells="inline")
    monkeypatch.setattr(
        "neurosnap.runtime.parts.world_process.open_source",
        lambda *given: Foggy(open_source(*given)),
    )
    made(options, tmp_path / "log")
    alone = Foggy(open_source(PATH, SEED, options.arguments))
    assert recorded_in(tmp_path / "log") == by_one_agent(options, alone)
    verdict = verify(tmp_path / "log")
    assert (verdict.same, verdict.complete) == (True, True), verdict.difference


def test_what_was_sensed_of_an_action_is_checked_against_the_decision(
    tmp_path: Path,
) -> None:
    options = acting("excited", PATH, cells="inline")
    made(options, tmp_path / "log")
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


def test_a_beginning_that_is_not_reported_is_found(
    wholes: Callable[[str], Path], tmp_path: Path
) -> None:
    change = changing(
        wire.Observation, lambda m: m.begins and m.tick > 1, lambda _: {"begins": False}
    )
    verdict = verify(rewritten(wholes("planned"), tmp_path / "changed", change))
    rule = r"tick \d+: /observation: .* does not follow from the decision"
    assert re.match(rule, str(verdict.difference))


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


# Exploring by plan --------------------------------------------------------------------


def test_with_a_target_it_explores_until_it_knows_a_way() -> None:
    options = planned(ticks=600, target=("tile=goal",), grow=30)
    reasons = [one.why for one in by_one_agent(options)[1]]
    first = next(tick for tick, why in enumerate(reasons) if why.startswith("in "))
    assert all(why.startswith("to learn what") for why in reasons[:first])
    # Six steps, and one at the goal, where the episode is over.
    steps = [why.partition(":")[0] for why in reasons[first : first + 6]]
    assert steps == ["in 6", "in 5", "in 4", "in 3", "in 2", "in 1"]
    assert sum(why.startswith("in 6: ") for why in reasons[first : first + 70]) == 10
