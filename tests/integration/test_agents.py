"""A swarm decides as an agent in one process does, and grows the same if parts die."""

import asyncio
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.agent import Agent
from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.agent.policy import EXACT, AgentKind
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.protocol.run_options import SMALLEST, CellKind, RunOptions, SnapshotKind
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.grown_sensors import births_of
from neurosnap.recording.replay.learn_again import Learning, learned_at
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import anomaly_feed
from neurosnap.runtime.fit_agent import drawn_to
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sensorium import pack
from neurosnap.sources.open import open_source
from neurosnap.sources.protocol import Argument
from tests.support.aliased_worlds import NAME as MAZE
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.lamp import BIRTH, LIMITED, lamp_options
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.recorded_runs import recorded
from tests.support.rewritten_recordings import changing, flipped, rewritten
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


def by_one_agent(options: RunOptions) -> tuple[list[bytes], list[wire.Decision]]:
    """Return the states and decisions of an agent that has all in one process."""
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
        decisions.append(agent.act(seen.bits, seen.begins))
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
    assert_true_run(log, ticks=ticks)
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


def test_a_beginning_that_is_not_reported_is_found(tmp_path: Path) -> None:
    log = made(planned(cells="inline"), tmp_path / "log")
    change = changing(
        wire.Observation, lambda m: m.begins and m.tick > 1, lambda _: {"begins": False}
    )
    verdict = verify(rewritten(log, tmp_path / "changed", change))
    rule = r"tick \d+: /observation: .* does not follow from the decision"
    assert re.match(rule, str(verdict.difference))


def test_an_excited_agent_is_given_a_target_where_it_needs_one() -> None:
    assert drawn_to(PATH, SEED, {}, "3") == {"target": 3}
    assert drawn_to(PATH, SEED, {}, None) == {"target": "drawn"}
    assert drawn_to(PATH, SEED, {"target": 2}, None) == {}
    with pytest.raises(InvalidValueError, match=r"^target: must be the number"):
        drawn_to(PATH, SEED, {}, "below_3")


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


GROWN = "press&a&b"


def decisions(log: Path) -> dict[int, wire.Decision]:
    return {one.tick: one for one in of_type(log, wire.Decision)}


@pytest.fixture(scope="module")
def inline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    log = tmp_path_factory.mktemp("inline") / "grows"
    return recorded(lamp_options(ticks=TICKS, cells="inline"), log)


def test_where_a_limit_cut_an_episode_off_no_episode_ends(tmp_path: Path) -> None:
    options, log = lamp_options(LIMITED, ticks=TICKS, cells="inline"), tmp_path / "log"
    recorded(options, log)
    memory = options.new_memory()
    memory.restore(of_type(log, wire.KeyFrame)[-1].agent)
    assert memory.experience is not None
    assert not memory.experience.ends
    # If the recording does not say that a limit cut it off, it is an end.
    untold = changing(wire.Observation, lambda m: m.cut, lambda _: {"cut": False})
    assert not verify(rewritten(log, tmp_path / "untold", untold)).same


def test_what_was_grown_is_called_by_its_formula_and_learned_as_in_the_run(
    inline: Path,
) -> None:
    recording = Recording.open(inline)
    frames = {
        frame.tick: Snapshot.from_bytes(frame.snapshot)
        for frame in of_type(inline, wire.KeyFrame)
    }
    assert GROWN in frames[TICKS].sensorium
    order = learned_at(recording, TICKS).poc_graph()
    literal = frames[TICKS].sensorium.literal
    assert order.leq(literal(GROWN), literal("lit"))
    assert not order.leq(literal("press&a"), literal("lit"))

    # Without any key-frame, from what was observed and decided.
    learning = Learning(inline, lamp_options(ticks=TICKS, cells="inline"))
    in_order = sorted(of_type(inline, wire.Observation), key=lambda one: one.tick)
    for tick in learning.learn_to(TICKS - 1, iter(in_order), decisions(inline)):
        if tick in frames:
            learning.snapshot.adopt(frames[tick].state)
            assert learning.snapshot.to_bytes() == frames[tick].to_bytes()


@pytest.mark.parametrize(
    "cells", ["inline", pytest.param("worker", marks=pytest.mark.zenoh)]
)
def test_a_birth_is_told_when_it_happens(cells: CellKind) -> None:
    heard: list[Changed] = []
    options = lamp_options(ticks=TICKS, cells=cells)
    going = run(RunRequest(options), asyncio.Event(), Watcher(on_change=heard.append))
    outcome = asyncio.run(going)
    assert heard == [Changed(BIRTH, 24, GROWN)]
    assert (outcome.totals.grown, outcome.totals.retired) == (1, 0)


def test_an_anomaly_of_what_was_grown_is_told_by_its_name(tmp_path: Path) -> None:
    options = options_for(
        "neurosnap/FrozenLake-v0",
        0,
        agent="planner",
        ticks=95,
        grow=20,
        imagine=200,
        target=(),
        cells="inline",
        watch=True,
    )
    log = tmp_path / "log.mcap"
    recorded(options, log)
    names = births_of(Recording.open(log)).names
    first = options.body.first_grown
    assert len(names) > first
    said = [
        link.implication
        for told in anomaly_feed.recorded(Recording.open(log), support=0)
        if isinstance(told, NamedAnomaly)
        for link in told.broken
    ]
    assert any(name in each for name in names[first:] for each in said)


@pytest.mark.parametrize(
    ("wrong", "rule"),
    [
        ({"weights": b"\0" * 4}, "tick 1: /decision: born: cannot reshape"),
        ({"born": 25}, "tick 1: /decision: born: must be sensor 24, got 25"),
        ({"literals": (0,)}, "tick 1: /decision: grown: must be of literals of two or"),
        (
            {"born": -1, "retires": 24},
            "tick 1: /decision: retired: must be places in 0",
        ),
    ],
)
def test_a_decision_that_cannot_be_right_is_named(
    inline: Path, wrong: dict[str, object], rule: str
) -> None:
    birth = next(one for one in decisions(inline).values() if one.born >= 0)
    learning = Learning(inline, lamp_options())
    observation = wire.Observation(1, b"\0\0\0\0", known=b"\1\0\0\0")
    with pytest.raises(RecordingError, match=re.escape(rule)):
        learning.learn(observation, msgspec.structs.replace(birth, **wrong))


@pytest.mark.parametrize(
    ("found", "to"),
    [
        (lambda m: m.readings, lambda m: {"readings": flipped(m.readings)}),
        (lambda m: m.counts, lambda m: {"counts": flipped(m.counts)}),
        (
            lambda m: m.counts,
            lambda m: {"counts": b"", "lacks": (int(m.who.rpartition("/")[2]),)},
        ),
    ],
    ids=["readings", "counts", "lacks"],
)
def test_an_answer_that_was_changed_is_found(
    found: Callable[[wire.Recalled], bool],
    to: Callable[[wire.Recalled], dict[str, object]],
    inline: Path,
    tmp_path: Path,
) -> None:
    change = changing(wire.Recalled, lambda m: m.tick == BIRTH and bool(found(m)), to)
    verdict = verify(rewritten(inline, tmp_path / "log", change))
    assert not verdict.same
    assert str(verdict.difference).startswith(f"tick {BIRTH}: /")


def test_in_several_files_each_begins_without_the_searches_that_failed(
    tmp_path: Path,
) -> None:
    log = tmp_path / "log"
    options = acting(
        *("planner", PATH),
        ticks=150,
        target=("below_1", "below_3*"),  # nowhere
        imagine=50,
        threshold=EXACT,
        cells="inline",
        workers=0,  # cells of their own say more
        split=SMALLEST,
    )
    recorded(options, log)
    assert "knows no way" in {one.why[:12] for one in decisions(log).values()}
    files = part_paths(log)
    assert len(files) > 1
    for path in files.values():
        assert verify(path).same


def test_in_several_files_each_begins_with_what_was_grown(
    inline: Path, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    # Cells of their own say more than one worker for all of them.
    apart = {"cells": "inline", "workers": 0}
    recorded(lamp_options(ticks=TICKS, split=SMALLEST, **apart), log)
    files = part_paths(log)
    assert len(files) > 1
    assert course(log) == course(inline)
    assert verify(log).same
    for path in files.values():
        assert verify(path).same
