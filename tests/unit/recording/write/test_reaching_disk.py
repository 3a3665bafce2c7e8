"""When a recording reaches the disk, and what happens if the disk fails."""

import asyncio
import contextlib
import errno
import logging
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.errors import RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.write.fsync_thread import FsyncThread
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts import recorder_process as recorder
from neurosnap.runtime.parts.recorder_process import run_recorder
from tests.support.memory_hubs import run_out
from tests.support.recorded_messages import assert_true_run
from tests.support.recordings import EACH, NOW
from tests.support.split_runs import EVERY, SMALL, SplitRun


async def until(holds: Callable[[], bool]) -> None:
    """Let the loop run until something holds."""
    while not holds():  # noqa: ASYNC110 - a file does not say that it has grown
        await asyncio.sleep(0.001)


def states(log: Path) -> int:
    return len(list(Recording.open(log).messages(("state",))))


def add(writer: SplitWriter, number: int) -> None:
    leave = wire.Leave("world")
    writer.add(wire.Delivery(leave.key, number, NOW, wire.encode(leave)), NOW)


class Disk:
    """A disk that takes nothing before it is told to."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.asked = threading.Event()
        self.takes = threading.Event()
        self.error: OSError | None = None
        self.threads: list[int] = []
        patch.setattr("os.fsync", self._sync)

    def _sync(self, _: int) -> None:
        self.threads.append(threading.get_ident())
        self.asked.set()
        assert self.takes.wait(10)
        if self.error is not None:
            raise self.error


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    made = Disk(monkeypatch)
    yield made
    made.takes.set()


async def test_the_first_whole_tick_is_flushed_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "_FLUSH", 3600.0)
    log, hub, stop = tmp_path / "log.mcap", MemoryHub(), asyncio.Event()
    with SplitWriter(log, {}) as writer:
        async with (
            hub.fabric("coordinator") as coordinator,
            asyncio.TaskGroup() as all_,
            hub.fabric("recorder") as fabric,
        ):
            running = all_.create_task(
                run_recorder(writer, fabric, stop, parts=("coordinator",), grace=0)
            )
            await asyncio.sleep(0)
            coordinator.publish(EACH["observation"], EACH["state"])
            run_out(hub)
            await until(lambda: states(log) == 1)
            stop.set()
            await running


@pytest.fixture
def synced(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was synced, by name."""
    found: list[str] = []
    fsync = os.fsync

    def note(descriptor: int) -> None:
        found.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", note)
    return found


async def test_a_recording_is_synced_as_often_as_its_run_wants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, synced: list[str]
) -> None:
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    fabric = MemoryHub().fabric("recorder")
    for sync, most in ((0.0001, 10**6), (0.0, 0), (3600.0, 0)):
        folder = tmp_path / str(sync)
        folder.mkdir()
        with SplitWriter(folder / "log.mcap", {}, sync_every=sync) as writer:
            del synced[:]
            flushing = asyncio.create_task(recorder._flush(writer, fabric))
            if most:
                # The file each time, and its name in the folder once.
                await until(lambda: synced.count("log.mcap") > 3)
                assert synced.count(str(sync)) == 1
            else:
                for _ in range(100):
                    await asyncio.sleep(0)
            flushing.cancel()
            await asyncio.wait((flushing,))
            assert len(synced) <= most


def full(_: int) -> None:
    raise OSError(errno.EIO, "Input/output error")


def test_a_sync_that_failed_is_told_and_not_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, fsync = tmp_path / "log.mcap", os.fsync
    rule = r"^log: must reach the disk, got Input/output error for '.*log\.mcap'"
    saving = FsyncThread()
    with Writer(log) as writer:
        monkeypatch.setattr(os, "fsync", full)
        saving.sync([writer])
        monkeypatch.setattr(os, "fsync", fsync)
        with pytest.raises(RecordingError, match=rule):
            saving.close()


async def test_a_run_whose_recording_does_not_reach_the_disk_fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    monkeypatch.setattr(os, "fsync", full)
    log = tmp_path / "log.mcap"
    with SplitWriter(log, {}, sync_every=0.0001) as writer:
        async with MemoryHub().fabric("recorder") as fabric:
            with pytest.raises(RecordingError, match="must reach the disk"):
                await run_recorder(writer, fabric, asyncio.Event(), parts=("world",))
    assert Recording.open(log).cut is not None


@pytest.mark.parametrize(
    ("source", "said", "sync"),
    [
        ("stdin", "", 1.0),
        ("stdin", "sync = 0", 0.0),
        ("stdin", "sync = 2.5", 2.5),
        ("world", "", 0.0),
        ("world", "sync = 0.5", 0.5),
    ],
)
def test_readings_from_outside_are_synced_every_second(
    tmp_path: Path, source: str, said: str, sync: float
) -> None:
    path = tmp_path / "swarm.toml"
    more = {"stdin": 'sensors = ["door"]', "world": 'id = "neurosnap/Path-v0"'}[source]
    text = f'[source]\nkind = "{source}"\n{more}\n[recording]\n{said}\n'
    path.write_text(text, encoding="utf-8")
    assert prepare(load(path)).options.sync == sync


# A file that is over, while the next one is being written -----------------------------


def add_all(writer: SplitWriter, several: Iterable[Recorded], first: int = 0) -> None:
    for count, one in enumerate(several, first):
        writer.add(one.delivery, 10**18 + count)


def test_a_slow_disk_holds_nobody_up(log: Path, disk: Disk) -> None:
    with SplitWriter(log, {}, sync_every=1.0) as writer:
        for number in range(10):
            add(writer, number)
            writer.flush(NOW)
            writer.sync()
        assert len(list(Recording.open(log).messages())) == 10
        disk.takes.set()
    assert len(disk.threads) in (1, 2)  # one sync, of the file and its folder


def test_recording_goes_on_while_the_disk_takes_a_file(
    run: SplitRun, disk: Disk
) -> None:
    old, shares = Recording.open_file(run.whole), run.upto(2 * EVERY)
    with SplitWriter(run.log, old.metadata, split=SMALL) as writer:
        add_all(writer, shares)
        assert disk.asked.wait(10)
        writer.flush(10**18 + len(shares))
        # Whoever is killed now has lost nothing: the file that is over has its end, and
        # so the run goes on from the next one.
        over = Recording.open_file(run.log)
        assert over.cut is None
        assert over.balance(over.sequences()).whole
        assert find_resume_point(run.log)[1].part == 1
        assert threading.get_ident() not in disk.threads
        disk.takes.set()
        add_all(writer, run.messages[len(shares) :], len(shares))
        writer.finish({}, old.noted().expected)
    assert_true_run(run.log)


@pytest.mark.parametrize("takes", [True, False])
def test_a_file_is_deleted_once_the_disk_took_a_newer_one_or_the_recording_ends(
    run: SplitRun, disk: Disk, takes: bool
) -> None:
    metadata = Recording.open_file(run.whole).metadata
    with SplitWriter(run.log, metadata, split=Split(1, keep=1)) as writer:
        add_all(writer, run.upto(2 * EVERY))
        assert disk.asked.wait(10)
        assert list(part_paths(run.log)) == [0, 1]
        disk.error = None if takes else OSError(errno.EIO, "no disk")
        disk.takes.set()
        rule = r"^log: must take .* got no disk"
        with (
            contextlib.nullcontext()
            if takes
            else pytest.raises(RecordingError, match=rule)
        ):
            writer.finish({}, {})
    assert list(part_paths(run.log)) == ([1] if takes else [0, 1])


# A file that is taken away while it is written ----------------------------------------


def replace(log: Path) -> None:
    log.unlink()
    log.write_bytes(b"another")


@pytest.mark.parametrize(
    ("take", "left"),
    [
        (Path.unlink, "runs/log.mcap"),
        (replace, "runs/log.recovered-1.mcap"),
        (lambda log: log.rename(log.with_name("b.mcap")), "runs/b.mcap"),
        (lambda log: log.parent.rename(log.parents[1] / "moved"), "moved/log.mcap"),
    ],
    ids=["deleted", "replaced", "moved", "folder moved"],
)
@pytest.mark.parametrize(
    ("flushes", "ends"), [(True, True), (True, False), (False, True)]
)
def test_it_is_said_at_the_next_flush_or_the_end_and_nothing_is_lost(
    take: Callable[[Path], None],
    left: str,
    flushes: bool,
    ends: bool,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.ERROR, "neurosnap")
    log = tmp_path / "runs" / "log.mcap"
    log.parent.mkdir()
    with SplitWriter(log, {}) as writer:
        add(writer, 0)
        writer.flush(NOW)
        assert not caplog.records
        take(log)
        add(writer, 1)
        for _ in range(3 * flushes):
            writer.flush(NOW)
        assert len(caplog.records) == flushes
        if ends:
            balance = writer.finish({}, {"world": 2})
            assert balance.missing == {}
            assert balance.vanished == (str(log),)
            assert not balance.whole
        rule = "log: must stay where it is while it is written"
        assert caplog.records[0].getMessage().startswith(rule)
    assert len(list(Recording.open(tmp_path / left).messages())) == 2
    if left == "runs/log.recovered-1.mcap":
        assert log.read_bytes() == b"another"
