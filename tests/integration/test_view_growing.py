"""`neurosnap view` of a recording that grows."""

import asyncio
import json
import os
import signal
from pathlib import Path
from typing import Any

import msgspec
import pytest

from neurosnap import wire
from neurosnap.apps.viewer.address import Address
from neurosnap.apps.viewer.frame_changes import Change
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.recording.read.recording import Recording
from tests.support.page_requests import events, get
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, in_chunks, path_run, recorded, told
from tests.support.view_commands import address_of, verb

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("own_notes")]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


def applied(frame: dict[str, Any] | None, change: Change) -> dict[str, Any]:
    """Return a frame by the frame before and what has changed, as the page does."""
    fields: dict[str, Any] = msgspec.to_builtins(change)
    before = None if frame is None else frame["tick"]
    assert fields.pop("after") == (before or 0)
    now = {} if frame is None else dict(frame)
    for name in ("bits", "state"):
        pairs = dict(fields.pop(name, ()))
        known = range(len(pairs)) if frame is None else range(len(now[name]))
        now[name] = [pairs.get(k, now[name][k] if name in now else None) for k in known]
    return {**now, **fields}


async def test_a_growing_recording_is_told_as_differences(
    log: Path, tmp_path: Path
) -> None:
    small = in_chunks(log, tmp_path / "small.mcap", 2000)
    data, growing = small.read_bytes(), tmp_path / "growing.mcap"
    growing.write_bytes(data[: len(data) // 3])
    frame, last, shares = None, {}, iter([45, 55, 65, 100])
    loop = asyncio.get_running_loop()
    times = []
    session = ViewSession(growing, lambda: True)
    async with asyncio.timeout(PATIENCE), serving(session) as address:
        async for event in events(address):
            times.append(loop.time())
            for change in event.frames:
                frame = applied(frame, change)
                (whole,) = RunView(small).frames(frame["tick"], frame["tick"])
                last[frame["tick"]] = frame
                assert frame["state"] == whole.state
                assert frame["bits"] == whole.bits
            assert event.live == (
                event.ticks < TICKS or not session.run_view.recording.finished
            )
            share = next(shares, None)
            if share is not None:
                growing.write_bytes(data[: len(data) * share // 100])
    assert event.ticks == TICKS
    assert event.cut is None
    assert len(last) > 5
    for each in RunView(small).frames(min(last), TICKS):
        if each.tick in last:
            assert last[each.tick] == msgspec.to_builtins(each)
    assert times[-1] - times[0] > 0.09 * (len(times) - 1)


async def test_a_run_that_begins_its_file_anew_is_begun_anew(
    log: Path, tmp_path: Path
) -> None:
    growing = in_chunks(log, tmp_path / "growing.mcap", 2000)
    os.truncate(growing, growing.stat().st_size // 2)
    other = in_chunks(log, tmp_path / "other.mcap", 2000)
    session = ViewSession(growing, lambda: True)
    async with asyncio.timeout(PATIENCE), serving(session) as address:
        seen = []
        async for event in events(address):
            seen.append(event)
            if len(seen) == 1:
                other.replace(growing)
    assert [event.reset for event in seen] == [False, True]
    assert seen[-1].frames[0].after == 0
    assert seen[-1].ticks == TICKS


async def fetched(address: str, path: str) -> Any:
    base, _, token = address.partition("/?token=")
    status, body = await get(Address(int(base.rpartition(":")[2]), token), path)
    assert status == 200
    return json.loads(body)


@pytest.mark.zenoh
@pytest.mark.parametrize("cells", ["process", "worker"])
async def test_a_swarm_is_looked_at_while_it_runs(tmp_path: Path, cells: str) -> None:
    log, notes = tmp_path / "run.mcap", tmp_path / "runtime"
    options = ("--ticks", "100000", "--set", "places=6", "--cells", cells)
    running = ("run", "neurosnap/Path-v0", *options, "--out", str(log))
    async with asyncio.timeout(PATIENCE), verb(notes, *running) as run:
        while not log.exists() or log.stat().st_size < 20_000:
            assert run.returncode is None
            await asyncio.sleep(0.02)  # looking costs what the swarm needs
        async with verb(notes, "view", "--live", "--no-browser") as viewing:
            address = await address_of(viewing)
            ticks = [(await fetched(address, "/api/run"))["ticks"]]
            assert (await fetched(address, "/api/run"))["live"]
            while len(set(ticks)) < 3:
                ticks.append((await fetched(address, "/api/run"))["ticks"])
            some = f"/api/frames?from={ticks[0]}&to={ticks[0] + 50}"
            shown = await fetched(address, some)
            parts = (await fetched(address, "/api/cells"))["cells"]
            hosts = {part["who"]: part["host"] for part in parts}
            kind, count = {"process": ("cell", 5), "worker": ("worker", 2)}[cells]
            own = [f"{kind}/{number}" for number in range(count)]
            assert sorted(hosts) == sorted([*own, "coordinator", "world"])
            assert all("process" in str(host) for host in hosts.values())
            run.send_signal(signal.SIGINT)
            await run.communicate()
            while (await fetched(address, "/api/run"))["live"]:
                assert viewing.returncode is None
            viewing.send_signal(signal.SIGINT)
            _, said = await viewing.communicate()
            assert (viewing.returncode, said) == (0, b"")
    assert ticks == sorted(ticks)
    derived = told(log)
    assert shown["frames"]
    for frame in shown["frames"]:
        assert frame["state"] == derived[frame["tick"]].state
    states = {
        each.message.tick: each.message
        for each in Recording.open(log).messages(("state",))
        if isinstance(each.message, wire.State)
    }
    run_view = RunView(log)
    assert run_view.last == max(states)
    for frame_ in run_view.frames(1, 200):
        assert frame_.state == derived[frame_.tick].state
        assert all(wave.settled for wave in frame_.waves)
        assert frame_.waves[0].depth == states[frame_.tick].depth
