"""The files of a run that is restarted after a part dies."""

import asyncio
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import pytest

from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import SMALLEST
from neurosnap.recording.read.recording import part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import RunRequest, Supervision, Watcher
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.run import run
from tests.support.disturbed_runs import (
    ENDLESS,
    Disturbed,
    options_for,
    parts,
)

if TYPE_CHECKING:
    from neurosnap.runtime.request import Restart

pytestmark = [
    pytest.mark.zenoh,
    pytest.mark.slow,
    pytest.mark.usefixtures("no_process_is_left"),
]


def test_files_that_cannot_be_gone_on_from_are_kept(tmp_path: Path) -> None:
    log = tmp_path / "log"
    options = msgspec.structs.replace(
        options_for(ENDLESS), keyframe_every=50, split=SMALLEST
    )
    damaged: list[bytes] = []
    restarts: list[Restart] = []
    stop = asyncio.Event()

    def damage(tick: int) -> None:
        if not damaged and (found := part_paths(log)).keys() > {0, 1}:
            # The first has its end by now, and is not what it says it is.
            content = bytearray(found[0].read_bytes())
            content[len(content) // 2] ^= 1
            found[0].write_bytes(content)
            damaged.append(bytes(content))
            for one in parts():
                if one.name() == "world":
                    one.send_signal(signal.SIGKILL)
        elif restarts and tick > restarts[0].tick:
            stop.set()

    outcome = asyncio.run(
        run(
            RunRequest(options, log, supervision=Supervision()),
            stop,
            Watcher(damage, on_restart=restarts.append),
        )
    )
    assert not outcome.complete
    assert damaged[0] in [path.read_bytes() for path in tmp_path.iterdir()]


NO_RECORDING = b"no recording" * 9  # shorter, it could hold no tick


def recorded(path: Path, ticks: int) -> Path:
    options = msgspec.structs.replace(options_for(ticks), cells="inline")
    asyncio.run(run(RunRequest(options, path), asyncio.Event()))
    return path


@pytest.mark.parametrize(
    ("after", "before", "kept"),
    [
        (9, 5, 9),
        (5, 9, 9),
        (6, 6, 6),
        (None, 4, 4),
        (3, None, 3),
        (-1, 4, 4),
        (3, -1, 3),
    ],
)
def test_of_two_recordings_the_further_stays(
    after: int | None, before: int | None, kept: int, tmp_path: Path
) -> None:
    log, broken = tmp_path / "log", tmp_path / "log.broken"
    for path, ticks in ((log, after), (broken, before)):
        if ticks is not None and ticks > 0:
            recorded(path, ticks)
        elif ticks is not None:
            path.write_bytes(NO_RECORDING)
    RestartFiles(log).keep_furthest()
    assert verify(log).ticks == kept
    # What cannot be read is not deleted: what is in it is unknown.
    aside = {path.read_bytes() for path in tmp_path.iterdir() if path != log}
    assert aside == ({NO_RECORDING} if -1 in (after, before) else set())


@pytest.mark.parametrize("ticks", [1, 2, 12])
def test_a_run_that_dies_past_its_last_tick_does_that_again_and_ends(
    ticks: int, tmp_path: Path
) -> None:
    options = msgspec.structs.replace(options_for(ticks), cells="inline")
    log, again = tmp_path / "a.mcap", tmp_path / "b.mcap"
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    past = RestartFiles(log).furthest(options)
    assert (0 if past is None else past.tick) == ticks - 1
    outcome = asyncio.run(run(RunRequest(options, again, past), asyncio.Event()))
    assert outcome.totals.ticks == ticks
    verdict = verify(again)
    assert (verdict.same, verdict.ticks) == (True, ticks)


def test_what_an_earlier_run_left_is_not_overwritten(tmp_path: Path) -> None:
    left = tmp_path / "log.broken"
    left.write_bytes(b"all there is")
    rule = "log: must be taken away first: a run left it that was cut short"
    with pytest.raises(InvalidValueError, match=rule):
        Disturbed(options_for(5), tmp_path / "log").run()
    assert left.read_bytes() == b"all there is"
