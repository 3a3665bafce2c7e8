"""When a recording reaches the disk, and what happens if the disk fails."""

import asyncio
import contextlib
import errno
import logging
import os
import shutil
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.errors import RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.copying import salvage
from neurosnap.recording.write.fsync_thread import FsyncThread
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts import recorder_process as recorder
from neurosnap.runtime.parts.recorder_process import run_recorder
from neurosnap.system.durable import OwnFile
from tests.support.memory_hubs import run_out
from tests.support.patience import PATIENCE
from tests.support.recorded_messages import assert_true_run
from tests.support.recordings import EACH, NOW
from tests.support.split_runs import EVERY, SMALL, TICKS, SplitRun


async def until(holds: Callable[[], bool]) -> None:
    """Let the loop run until something holds."""
    while not holds():  # noqa: ASYNC110 - a file does not say that it has grown
        await asyncio.sleep(0.001)


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
            await until(lambda: [*Recording.open(log).messages(("state",))] != [])
            stop.set()
            await running


async def test_a_recording_is_synced_as_often_as_its_run_wants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced, fsync = list[str](), os.fsync

    def note(descriptor: int) -> None:
        synced.append(Path(f"/proc/self/fd/{descriptor}").readlink().name)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", note)
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
    saving, tried = FsyncThread(), threading.Event()

    def fails(descriptor: int) -> None:
        tried.set()
        full(descriptor)

    with Writer(log) as writer:
        monkeypatch.setattr(os, "fsync", fails)
        saving.sync([writer])
        assert tried.wait(30)  # the thread's turn may be late
        monkeypatch.setattr(os, "fsync", fsync)
        with pytest.raises(RecordingError, match=rule):
            saving.close()


async def record_until_it_fails(
    log: Path, sync: float = 0.0
) -> tuple[Completeness, str]:
    """Record two messages of a world that leaves when the recorder does.

    Returns:
        What is said of the recording, and the fault that the recorder publishes.
    """
    hub, ready, faults = MemoryHub(), asyncio.Event(), list[str]()
    with SplitWriter(log, {}, sync_every=sync) as writer:
        async with hub.fabric("world") as world, hub.fabric("recorder") as fabric:

            def hear(deliveries: list[wire.Delivery]) -> None:
                for one in deliveries:
                    message = wire.decode(one.key, one.payload)
                    if isinstance(message, wire.Fault):
                        faults.append(message.what)
                    elif message == wire.Leave("recorder"):
                        world.publish(EACH["observation"], wire.Leave("world"))

            world.listen(("fault/recorder", "leave/recorder"), hear)
            running = asyncio.create_task(
                run_recorder(
                    *(writer, fabric, asyncio.Event()),
                    parts=("world",),
                    on_ready=ready.set,
                )
            )
            await ready.wait()
            world.publish(EACH["observation"])
            async with asyncio.timeout(PATIENCE):
                balance = await running
    (fault,) = faults
    return balance, fault


async def test_a_run_whose_recording_does_not_reach_the_disk_ends_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    monkeypatch.setattr(os, "fsync", full)
    log = tmp_path / "log.mcap"
    balance, fault = await record_until_it_fails(log, 0.0001)
    assert fault.startswith("log: must reach the disk, got Input/output error")
    assert (balance.vanished, balance.whole) == ((str(log),), False)
    assert Recording.open(log).cut is not None


@pytest.mark.parametrize("code", [errno.EIO, errno.EROFS, errno.ENOSPC])
async def test_so_does_one_whose_disk_takes_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: int
) -> None:
    """Said at the next flush."""
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    log, write = tmp_path / "log.mcap", OwnFile.write

    def fail(file: OwnFile, data: bytes) -> int:
        if file.tell() > 0:
            raise OSError(code, os.strerror(code))
        return write(file, data)

    monkeypatch.setattr(OwnFile, "write", fail)
    balance, fault = await record_until_it_fails(log)
    assert fault.startswith(f"log: must take what is recorded, got {os.strerror(code)}")
    assert (balance.vanished, balance.whole) == ((str(log),), False)
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
        assert not writer.read_back()  # the file that is over is not proved yet
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
        (lambda log: shutil.rmtree(log.parent), "runs/log.mcap"),
    ],
    ids=["deleted", "replaced", "moved", "folder moved", "folder deleted"],
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
        rule = "log: must stay where and as it is while it is written"
        assert caplog.records[0].getMessage().startswith(rule)
    assert len(list(Recording.open(tmp_path / left).messages())) == 2
    if left == "runs/log.recovered-1.mcap":
        assert log.read_bytes() == b"another"


# A file that another program writes to ------------------------------------------------


def write_over(log: Path) -> None:
    with log.open("r+b") as file:
        file.seek(log.stat().st_size // 2)
        file.write(bytes(300))
    os.utime(log, ns=(1, 1))  # a moment later: clocks of files are coarse


def append(log: Path) -> None:
    with log.open("ab") as file:
        file.write(bytes(700))


CHANGES = {
    "emptied": lambda log: os.truncate(log, 0),
    "cut short": lambda log: os.truncate(log, log.stat().st_size // 2),
    "begun anew": lambda log: log.write_bytes(b"hello"),
    "written over": write_over,
    "appended to": append,
}


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_a_file_that_is_changed_is_named_and_the_rest_of_the_run_is_saved(
    change: Callable[[Path], object], run: SplitRun, caplog: pytest.LogCaptureFixture
) -> None:
    old, places = Recording.open(run.whole), [run.frame(tick)[0] for tick in (20, 30)]
    flushed = places[0] + 5
    with SplitWriter(run.log, old.metadata) as writer:
        add_all(writer, run.messages[:flushed])
        writer.flush(10**18)
        assert writer.read_back()
        change(run.log)
        writer.flush(10**18)
        assert len(caplog.records) == 1
        for count, one in enumerate(run.messages[flushed:], flushed):
            writer.add(one.delivery, 10**18 + count)
            if count % 50 == 0:
                writer.flush(10**18 + count)
        assert not writer.read_back()
        # Whoever is killed now has lost no more than what was destroyed.
        assert Recording.open(run.log).options == old.options
        balance = writer.finish({}, old.noted().expected)
    rule = "log: must stay where and as it is while it is written, got cut short"
    assert [one.getMessage().startswith(rule) for one in caplog.records] == [True]
    assert (balance.vanished, balance.whole) == ((str(run.log),), False)
    # What was written behind it is read, and goes on from the next key-frame.
    found = salvage(run.log, run.log.with_name("good.mcap"))
    verdict = verify(Path(found.path))
    assert (verdict.same, verdict.ranges[-1][1]) == (True, TICKS)
    # What was appended is written over.
    assert bool(found.lost) is (change is not append) is not verdict.complete


def forget(log: Path) -> None:
    """Lose a block, as a disk does: length and time are those of the last write."""
    noted = log.stat().st_mtime_ns
    write_over(log)
    os.utime(log, ns=(noted, noted))


@pytest.mark.parametrize("reads", [True, False])
def test_a_block_that_the_disk_does_not_give_back_is_found_when_it_is_read(
    run: SplitRun, reads: bool
) -> None:
    """Before a journal is cut, and at the end."""
    old = Recording.open(run.whole)
    with SplitWriter(run.log, old.metadata) as writer:
        add_all(writer, run.messages)
        writer.flush(10**18)
        forget(run.log)
        writer.flush(10**18)
        assert not (reads and writer.read_back())
        assert writer.finish({}, old.noted().expected).vanished == (str(run.log),)


def test_so_it_is_in_a_file_that_another_follows(run: SplitRun) -> None:
    old, begins = Recording.open(run.whole), run.frame(2 * EVERY)[0]
    with SplitWriter(run.log, old.metadata, split=SMALL) as writer:
        add_all(writer, run.messages[:begins])
        writer.flush(10**18)
        forget(part_paths(run.log)[1])
        add_all(writer, run.messages[begins:], begins)
        balance = writer.finish({}, old.noted().expected)
    assert balance.vanished == (str(part_paths(run.log)[1]),)


async def test_no_journal_is_cut_by_a_recording_that_cannot_be_read_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    cuts: list[int] = []
    log, fabric = tmp_path / "log.mcap", MemoryHub().fabric("recorder")
    with SplitWriter(log, {}) as writer:
        for number in range(100):
            add(writer, number)
        writer.flush(NOW)
        forget(log)
        turns, looked = iter(range(3)), asyncio.Event()

        def framed() -> int:
            if next(turns, None) is None:
                looked.set()
            return 7

        flushing = asyncio.create_task(
            recorder._flush(writer, fabric, framed, cuts.append)
        )
        await looked.wait()
        flushing.cancel()
        await asyncio.wait((flushing,))
    assert cuts == []


def test_a_file_whose_time_alone_differs_is_as_it_was(run: SplitRun) -> None:
    """Not all file systems set it when they are written to."""
    old = Recording.open(run.whole)
    with SplitWriter(run.log, old.metadata) as writer:
        for count, one in enumerate(run.messages):
            writer.add(one.delivery, 10**18 + count)
            if count % 100 == 0:
                writer.flush(10**18)
                os.utime(run.log)
        assert writer.read_back()
        assert writer.finish({}, old.noted().expected).whole


def test_a_file_of_several_that_is_changed_is_over_at_the_next_key_frame(
    run: SplitRun,
) -> None:
    old, place = Recording.open(run.whole), run.frame(20)[0]
    with SplitWriter(run.log, old.metadata, split=Split(10**9)) as writer:
        for count, one in enumerate(run.messages):
            if count == place:
                append(run.log)
            writer.add(one.delivery, 10**18 + count)
            writer.flush(10**18 + count)
        balance = writer.finish({}, old.noted().expected)
    assert balance.vanished == (str(run.log),)
    assert len(part_paths(run.log)) == 2
