"""A run goes on when parts die, with the same result, or is given up if too often."""

import asyncio
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.errors import (
    InvalidValueError,
    NeurosnapError,
    PartDiedError,
    SwarmError,
)
from neurosnap.protocol.run_options import SMALLEST, CellKind, RunOptions
from neurosnap.recording.read.recording import part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime import remote_parts
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import Outcome, RunRequest, Site
from neurosnap.runtime.run_with_restarts import run
from neurosnap.runtime.service import Served, serve
from tests.support.disturbed_runs import ENDLESS, Disturbed, check_same, options_for
from tests.support.exhaustive import rows
from tests.support.hanging_worlds import SILENT, ending_world
from tests.support.lamp import BIRTH, lamp_options
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.recorded_messages import of_type
from tools.soak.__main__ import SERVICES, soak, soak_outside

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]

WALK = options_for(ENDLESS)
SPLIT = msgspec.structs.replace(WALK, keyframe_every=50, split=SMALLEST)
TOGETHER = (
    ("cell/2",),
    ("world",),
    ("recorder", "coordinator"),
    ("hub", "recorder", "world", "cell/0"),
)
"""The parts that die together, one row for each life of the run."""


@pytest.mark.parametrize(
    ("options", "killings"),
    rows(
        [(WALK, [(20, victims) for victims in TOGETHER])],
        [
            (SPLIT, [(60, ("recorder",)), (60, ("cell/2",))]),
            (
                lamp_options(ticks=ENDLESS),
                [(BIRTH - 6, ("coordinator",)), (9, ("cell/24", "recorder"))],
            ),
        ],
    ),
)
def test_a_run_of_which_parts_die_comes_to_the_same(
    options: RunOptions, killings: list[tuple[int, tuple[str, ...]]], tmp_path: Path
) -> None:
    calm, log = tmp_path / "calm", tmp_path / "log"
    disturbed = Disturbed(options, log, files=bool(options.split))
    outcome = disturbed.run(*killings)
    for restart, (_, victims) in zip(disturbed.restarts, killings, strict=True):
        assert restart.why.startswith(victims)
    check_same(outcome, disturbed, log, options, calm)
    assert outcome.totals.grown == (options.body.room > 0)
    files = part_paths(log)
    assert (len(files) > 2) == bool(options.split)
    assert list(files) == list(range(len(files)))
    for path in list(files.values())[1:]:
        alone = verify(path)
        assert (alone.same, alone.complete) == (True, True)
    assert sorted(tmp_path.iterdir()) == sorted([calm, *files.values()])


def test_what_an_earlier_run_left_is_not_overwritten(tmp_path: Path) -> None:
    left = tmp_path / "log.broken"
    left.write_bytes(b"all there is")
    rule = "log: must be taken away first: a run left it that was cut short"
    with pytest.raises(InvalidValueError, match=rule):
        Disturbed(options_for(5), tmp_path / "log").run()
    assert left.read_bytes() == b"all there is"


def test_a_run_with_cells_elsewhere_comes_to_the_same(tmp_path: Path) -> None:
    options, elsewhere, swarm = options_for(ENDLESS), (1, 3), "demo"
    calm, log = tmp_path / "calm", tmp_path / "log"
    victims = ("cell/1",), ("hub", "cell/2")
    disturbed, served = Disturbed(options, log), list[Served]()
    where = f"tcp/127.0.0.1:{free_port()}"

    async def both() -> Outcome:
        async with asyncio.TaskGroup() as group:
            group.create_task(
                serve(
                    remote_parts.cells(elsewhere),
                    Network(connect=where),
                    swarm,
                    asyncio.Event(),
                    patience=PATIENCE,
                    on_served=served.append,
                )
            )
            site = Site(
                Network(listen=where),
                swarm=swarm,
                elsewhere=frozenset(f"cell/{cell}" for cell in elsewhere),
            )
            lives = ((20, each) for each in victims)
            return await disturbed.running(*lives, site=site)

    outcome = asyncio.run(both())
    check_same(outcome, disturbed, log, options, calm)
    assert [one.swarm for one in served] == ["demo", "demo-1", "demo-2"]
    assert [bool(one.trouble) for one in served] == [True, True, False]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["calm", "log"]


# Short soaks --------------------------------------------------------------------------

EVERY = len(SERVICES) + 1
PAIRS = EVERY * (EVERY - 1) // 2
SHARED = {
    "cells": "worker",
    "workers": 2,
    "keyframe_every": 20,
    "band": 2,
    "split": 1 << 16,
}


@pytest.mark.exhaustive
@pytest.mark.parametrize(
    ("changes", "kills", "seed"),
    [({}, EVERY + PAIRS, 7), (SHARED, EVERY, 11)],
    ids=["each role and pair", "shared learning"],
)
def test_a_short_soak(
    changes: dict[str, object], kills: int, seed: int, tmp_path: Path
) -> None:
    options = msgspec.structs.replace(options_for(1), **changes)
    found = asyncio.run(soak(options, kills, seed, tmp_path))
    assert found.fine, found
    assert found.restarts >= kills == sum(found.killed.values())
    if not changes:
        assert set(found.killed.values()) == {1}
        assert len(found.killed) == kills


@pytest.mark.exhaustive
def test_a_short_soak_of_a_run_that_is_fed_lines(tmp_path: Path) -> None:
    # This seed leaves the intake alone, whose death may cost what it has just read.
    found = asyncio.run(soak_outside("worker", 1, 25, tmp_path, rate=50.0))
    assert found.fine, found
    assert found.killed == {"recorder+world": 1}
    assert found.restarts >= 1
    assert found.lines == found.ticks > 0


def test_a_run_that_dies_too_often_is_given_up(tmp_path: Path) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(options_for(ENDLESS), log, max_restarts=1)
    with pytest.raises(PartDiedError, match=r"^world: must not end before"):
        disturbed.run((20, ("world",)), (20, ("world",)))
    assert len(disturbed.restarts) == 1
    assert verify(log).ticks >= disturbed.flushed[-1] - 1 > disturbed.restarts[0].tick


@pytest.mark.parametrize(("wanted", "times"), [(False, 0), (True, 2)])
def test_who_says_why_it_cannot_go_on_is_started_again_only_if_wanted(
    wanted: bool, times: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fail = 'raise RuntimeError("the sensors are off")'
    options = ending_world(tmp_path, monkeypatch, fail)
    log = tmp_path / "log"
    disturbed = Disturbed(options, log, restart_on_error=wanted, max_restarts=2)
    with pytest.raises(SwarmError, match="the sensors are off") as raised:
        disturbed.run()
    assert not isinstance(raised.value, PartDiedError)
    assert [event.tick for event in disturbed.restarts] == [6] * times
    assert verify(log).ticks == 6


@pytest.mark.parametrize("cells", ["inline", "process"])
@pytest.mark.parametrize(
    ("end", "expected"),
    [
        (
            'raise OSError("the camera is gone")',
            r"^world: [\s\S]*OSError: the camera is gone",
        ),
        (
            "return np.zeros(4, np.int8), 0.0, False, False, {}",
            r"^(world: )?ending:test/Ending-v0: observation: ",
        ),
    ],
    ids=["raises", "reads too much"],
)
def test_a_world_that_fails_on_the_way_is_named(
    end: str,
    expected: str,
    cells: CellKind,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    options, log = ending_world(tmp_path, monkeypatch, end), tmp_path / "log"
    options = msgspec.structs.replace(options, cells=cells)
    with pytest.raises(NeurosnapError, match=expected):
        asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    assert [state.tick for state in of_type(log, wire.State)] == [1, 2, 3, 4, 5, 6]
    assert [fault.who for fault in of_type(log, wire.Fault)] == ["world"]


# A world that hangs -------------------------------------------------------------------


@pytest.fixture
def hanging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RunOptions:
    """A run whose world is there and says no more after tick 6."""
    options = ending_world(tmp_path, monkeypatch, "threading.Event().wait()")
    return msgspec.structs.replace(options, deadline=1.0)


def test_a_world_that_hangs_is_named_and_treated_like_one_that_died(
    hanging: RunOptions, tmp_path: Path
) -> None:
    log = tmp_path / "log"
    disturbed = Disturbed(hanging, log, max_restarts=1)
    with pytest.raises(PartDiedError, match=SILENT):
        disturbed.run()
    assert [event.tick for event in disturbed.restarts] == [6]
    assert verify(log).ticks == 6
