"""Swarms that grow sensors while running give the same result despite failures."""

import asyncio
import re
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.errors import RecordingError
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.protocol.run_options import SMALLEST, CellKind
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.grown_sensors import births_of
from neurosnap.recording.replay.learn_again import Learning, learned_at
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import anomaly_feed
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import run
from tests.support.course import course
from tests.support.lamp import BIRTH, LIMITED, lamp_options
from tests.support.recorded_messages import of_type
from tests.support.recorded_runs import recorded
from tests.support.rewritten_recordings import changing, flipped, rewritten
from tests.support.run_options import options_for

pytestmark = pytest.mark.slow

TICKS = 40
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
