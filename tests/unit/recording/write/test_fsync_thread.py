"""When a recording is flushed and synced, and what comes of a disk that fails."""

import asyncio
import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.apps.config.load import load
from neurosnap.apps.config.prepare import prepare
from neurosnap.errors import RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write import recorder
from neurosnap.recording.write.fsync_thread import FsyncThread
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import EACH, NOW


async def until(holds: Callable[[], bool]) -> None:
    """Let the loop run until something holds."""
    while not holds():  # noqa: ASYNC110 - a file does not say that it has grown
        await asyncio.sleep(0.001)


def states(log: Path) -> int:
    return len(list(Recording.open(log).messages(("state",))))


def add(writer: SplitWriter, number: int) -> None:
    leave = wire.Leave("world")
    writer.add(wire.Delivery(leave.key, number, NOW, wire.encode(leave)), NOW)


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
            hub.run()
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


async def test_a_slow_disk_holds_nobody_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, going, called = tmp_path / "log.mcap", threading.Event(), list[int]()
    fsync = os.fsync

    def wait(descriptor: int) -> None:
        called.append(descriptor)
        assert going.wait(60)
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", wait)
    with SplitWriter(log, {}, sync_every=1.0) as writer:
        for number in range(10):
            add(writer, number)
            writer.flush(NOW)
            writer.sync()
        assert len(list(Recording.open(log).messages())) == 10
        going.set()
    assert len(called) in (1, 2)  # one sync, of the file and its folder


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
