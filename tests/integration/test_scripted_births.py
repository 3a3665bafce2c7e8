"""Runs in which sensors are grown by a script: the same wherever the cells are."""

import asyncio
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.agent.growth.birth import Birth
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learning import learned_at
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.integration.test_growing_swarm import by_one_agent, decisions
from tests.support.course import course
from tests.support.lamp import lamp_options

TICKS = 30
BIRTHS = (
    Birth("turn_a", ("a", "b*")),
    Birth("press", ("b", "a"), 12),
    Birth("press", ("a*", "lit"), 12),
)


def scripted(**more: object) -> RunOptions:
    return lamp_options(**{"ticks": TICKS, "births": BIRTHS, "grow": 0, **more})


def record(options: RunOptions, log: Path) -> Path:
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    return log


@pytest.fixture(scope="module")
def inline(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(scripted(cells="inline"), tmp_path_factory.mktemp("inline") / "log")


@pytest.mark.parametrize("grow", [0, 2])
@pytest.mark.parametrize(
    "cells",
    [
        "inline",
        pytest.param("worker", marks=pytest.mark.zenoh),
        pytest.param("process", marks=[pytest.mark.zenoh, pytest.mark.slow]),
    ],
)
def test_a_swarm_grows_them_as_one_agent_does(
    cells: CellKind, grow: int, tmp_path: Path
) -> None:
    options = scripted(cells=cells, grow=grow)
    log = record(options, tmp_path / "log")
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, TICKS)
    swarm, alone = decisions(log), by_one_agent(options)
    assert [swarm[tick] for tick in range(1, TICKS)] == alone[:-1]
    born = {one.tick: (one.context, one.literals) for one in alone if one.born >= 0}
    assert (born[12], born[13]) == ((2, (0, 2)), (2, (1, 4)))


def test_they_have_weights_cells_and_names(inline: Path) -> None:
    birth = decisions(inline)[12]
    first = scripted().body.first_grown
    assert birth.born == first + 1  # behind the one that is there from the start
    assert birth.history == 12
    assert len(birth.weights) == 4 * 4 * birth.born
    names = learned_at(Recording.open(inline), TICKS).sensorium.names
    assert names[first:] == ("turn_a&a&~b", "press&a&b", "press&~a&lit")
    on = {
        recorded.message.tick
        for recorded in Recording.open(inline).messages(("observation",))
        if isinstance(recorded.message, wire.Observation)
        and recorded.message.bits[birth.born >> 3] >> (birth.born & 7) & 1
    }
    assert on
    assert min(on) > 12


@pytest.mark.parametrize("stop", [11, 12, 13, 20])
def test_it_goes_on_as_if_nothing_had_been(
    stop: int, inline: Path, tmp_path: Path
) -> None:
    first = record(scripted(ticks=stop, cells="inline"), tmp_path / "first")
    _, past = find_resume_point(first)
    log = tmp_path / "log"
    asyncio.run(run(RunRequest(scripted(cells="inline"), log, past), asyncio.Event()))
    assert course(log) == course(inline)
    assert verify(log).same
