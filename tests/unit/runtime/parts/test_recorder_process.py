"""The recorder tracks the parts present, and confirms only written data."""

import asyncio
from pathlib import Path
from types import SimpleNamespace

import msgspec
import pytest

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.runtime.parts import recorder_process as recorder
from neurosnap.runtime.parts.job import PartConnection, PartContext, Reporter
from neurosnap.runtime.parts.recorder_process import _Listener
from tests.support.memory_hubs import run_out
from tests.support.recordings import EACH
from tests.support.restart_runs import options_of

PARTS = ("world", "cell/0")


async def settle() -> None:
    """Let the loop run what is due."""
    for _ in range(3):
        await asyncio.sleep(0)


@pytest.mark.parametrize(
    ("parts", "changes", "gone"),
    [
        (("world",), [("world", True), ("world", False), ("world", True)], False),
        (("world",), [("world", True), ("world", False)], True),
        (PARTS, [("world", False)], False),
        (PARTS, [("world", False), None, ("world", True), ("cell/0", False)], False),
        (PARTS, [("cell/0", False), ("cell/0", False)], False),  # said twice
        (PARTS, [("world", False), ("cell/0", False)], True),
    ],
)
async def test_all_have_left_once_each_is_gone_and_did_not_come_back(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    parts: tuple[str, ...],
    changes: list[tuple[str, bool] | None],
    gone: bool,
) -> None:
    monkeypatch.setattr(recorder, "_LAST_WORD", 0.0)
    with SplitWriter(tmp_path / "log.mcap", {}) as writer:
        listener = _Listener(writer, parts, MemoryHub().fabric("recorder"))
        for change in changes:
            await settle() if change is None else listener.change(*change)
        await settle()
        assert listener.all_left.is_set() is gone


async def test_only_what_is_written_counts(tmp_path: Path) -> None:
    log, hub = tmp_path / "log.mcap", MemoryHub()
    faults: list[wire.Delivery] = []
    hub.fabric("ear").listen(("fault/**",), faults.extend)
    state, leave = EACH["state"], wire.Leave("world")
    assert isinstance(state, wire.State)
    with SplitWriter(log, {}) as writer:
        listener = _Listener(writer, ("world", "cell/0"), hub.fabric("recorder"))
        listener.handle(
            [
                wire.Delivery(message.key, 2**32, 0, wire.encode(message))
                for message in (state, leave)
            ]
        )
        run_out(hub)
        assert [wire.decode("fault/recorder", one.payload) for one in faults] == [
            wire.Fault("recorder", f"{key}: must hold a message that can be recorded")
            for key in ("state", "leave/world")
        ]
        assert listener.ticks == 0
        assert listener.expected() == {"world": 1, "cell/0": 1}
        listener.handle(
            [
                wire.Delivery("state", 0, 0, wire.encode(state)),
                wire.Delivery("leave/world", 4, 0, wire.encode(leave)),
            ]
        )
        assert listener.ticks == state.tick
        assert listener.expected() == {"world": 5, "cell/0": 1}
    assert [one.message for one in Recording.open(log).messages()] == [state, leave]


async def test_the_journal_is_cut_at_the_last_key_frame_but_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The last may lack something: then a run goes on from the one before."""
    cuts: list[int] = []
    monkeypatch.setattr(recorder, "_FLUSH", 0.0)
    hub, stop, ready = MemoryHub(), asyncio.Event(), asyncio.Event()
    with SplitWriter(tmp_path / "log.mcap", {}) as writer:
        async with hub.fabric("recorder") as fabric, hub.fabric("x") as other:
            recording = asyncio.create_task(
                recorder.run_recorder(
                    *(writer, fabric, stop),
                    parts=("coordinator",),
                    grace=0.0,
                    on_safe=cuts.append,
                    on_ready=ready.set,
                )
            )
            await ready.wait()
            other.publish(wire.KeyFrame(10, b""), wire.KeyFrame(20, b""))
            while not cuts:  # noqa: ASYNC110 - a thread does it
                await asyncio.sleep(0)
            assert cuts == [10]
            other.publish(wire.KeyFrame(20, b""), wire.KeyFrame(30, b""))
            while len(cuts) < 2:  # noqa: ASYNC110
                await asyncio.sleep(0)
            stop.set()
            await recording
    assert cuts == [10, 20]


@pytest.mark.parametrize("split", [0, 1 << 16])
async def test_what_no_part_of_the_run_said_makes_it_not_incomplete(
    split: int, tmp_path: Path
) -> None:
    """With a cell's certificate a program speaks as any cell, be there none."""
    log, hub = tmp_path / "log.mcap", MemoryHub()
    ready, stop = asyncio.Event(), asyncio.Event()
    line = SimpleNamespace(send_bytes=lambda _: ready.set())
    options = msgspec.structs.replace(options_of(3), split=split)
    job = recorder.RecorderJob(options, str(log), None, "x", ("world",))
    connection = PartConnection("recorder", "x", local=hub)
    part = PartContext(connection, stop, Reporter("recorder", line))
    recording = asyncio.create_task(job.run(part))
    async with hub.fabric("world") as world, hub.fabric("cell/99", first=7) as other:
        await ready.wait()
        other.publish(wire.Leave("cell/99"))
        world.publish(wire.Leave("world"))
        await recording
    assert Recording.open(log).whole
