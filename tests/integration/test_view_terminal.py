"""`neurosnap view` as a person at a terminal meets it, also while a swarm runs."""

import asyncio
import json
import shutil
import signal
import socket
from contextlib import aclosing
from pathlib import Path
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.apps.cli.page import look, viewed
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.auth import Address
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import describe
from tests.support.page_requests import events, get
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, path_run, told
from tests.support.view_commands import address_of, verb

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("own_notes")]


def refused(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["view", "--no-browser", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, " ".join(result.stderr.split())


def test_wrong_usage_is_one_line(tmp_path: Path, path_log: Path) -> None:
    assert refused() == (2, "error: log: must be given, or --live, got 'nothing'")
    code, text = refused(str(tmp_path / "none.mcap"))
    assert (code, text[:22]) == (2, "error: log: must exist")
    (tmp_path / "text.mcap").write_text("tick,a\n", encoding="utf-8")
    code, text = refused(str(tmp_path / "text.mcap"))
    assert (code, text[:36]) == (1, "error: log: must be an MCAP recordin")
    code, text = refused("--live")
    assert code == 2
    assert "swarm: must run on this machine, got 'none'" in text
    code, text = refused(str(path_log), str(path_log))
    assert (code, text) == (2, f"error: log: must be named once, got '{path_log}'")
    code, text = refused("--live", "00000000")
    assert code == 2
    assert "no swarm runs here" in text
    code, text = refused(str(path_log), "--port", "70000")
    assert (code, text) == (2, "error: port: must be in [0, 65535], got 70000")


def test_a_port_in_use_is_named(path_log: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, text = refused(str(path_log), "--port", str(port))
    assert code == 2
    assert text.startswith("error: port: must be free on this machine")
    assert text.endswith(f"got {port}")


async def test_a_run_is_looked_at_while_it_goes_on_and_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, stop = tmp_path / "run.mcap", asyncio.Event()
    said: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    monkeypatch.setattr("neurosnap.apps.cli.page.typer.echo", said.set_result)
    shown: list[api.Run] = []
    looked = asyncio.Event()

    async def ask() -> api.Run:
        port, _, token = (await said).partition("127.0.0.1:")[2].partition("/?token=")
        _, body = await get(Address(int(port), token), "/api/run")
        return msgspec.json.decode(body, type=api.Run)

    async def work(stop: asyncio.Event) -> str:
        with Writer(log) as writer:
            writer.start(describe(path_run()))
            writer.flush()
            shown.append(await ask())
        return "outcome"

    def on_end(outcome: str) -> None:
        assert (outcome, looked.is_set()) == ("outcome", False)
        looked.set()
        stop.set()

    async with asyncio.timeout(PATIENCE):
        got = await viewed(log, stop, work, on_end, browser=False)
    assert (got, looked.is_set()) == ("outcome", True)
    assert (shown[0].live, shown[0].ticks, shown[0].cut) == (True, 0, None)


async def test_a_recording_that_is_about_to_begin_is_waited_for(
    tmp_path: Path, path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late, stop, asked = tmp_path / "late.mcap", asyncio.Event(), []
    said: list[str] = []

    def recorded_in(path: Path) -> bool:
        asked.append(path)
        if len(asked) == 2:  # it was not there when it was first looked for
            shutil.copy(path_log, late)
        return True

    def say(text: str) -> None:
        said.append(text)
        stop.set()

    monkeypatch.setattr("neurosnap.runtime.registry.recorded_in", recorded_in)
    monkeypatch.setattr("neurosnap.apps.cli.page.typer.echo", say)
    async with asyncio.timeout(PATIENCE):
        await look([late], stop, browser=False)
    assert said[0].startswith(f"{late}: http://127.0.0.1:")
    assert set(asked) == {late}


async def test_a_run_that_fails_ends_its_page(tmp_path: Path) -> None:
    async def work(stop: asyncio.Event) -> None:
        raise SwarmError("cell/3: died")

    def on_end(outcome: None) -> None:
        raise AssertionError(outcome)

    log = tmp_path / "run.mcap"
    async with asyncio.timeout(PATIENCE):
        with pytest.raises(SwarmError, match=r"^cell/3: died"):
            await viewed(log, asyncio.Event(), work, on_end, browser=False)


async def test_a_page_that_cannot_be_served_ends_the_run(
    tmp_path: Path, path_log: Path
) -> None:
    async def work(stop: asyncio.Event) -> None:
        await stop.wait()

    async with asyncio.timeout(PATIENCE):
        with (
            socket.create_server(("127.0.0.1", 0)) as taken,
            pytest.raises(InvalidValueError, match=r"^port: must be free"),
        ):
            port = taken.getsockname()[1]
            options = {"port": port, "browser": False}
            await viewed(path_log, asyncio.Event(), work, lambda _: None, **options)


async def test_ctrl_c_ends_it_in_order(tmp_path: Path, path_log: Path) -> None:
    notes = tmp_path / "runtime"
    async with (
        asyncio.timeout(PATIENCE),
        verb(notes, "view", str(path_log), "--no-browser") as viewing,
    ):
        base, _, token = (await address_of(viewing)).partition("/?token=")
        address = Address(int(base.rpartition(":")[2]), token)
        async with aclosing(events(address)) as told:
            assert (await anext(told)).ticks == TICKS
            viewing.send_signal(signal.SIGINT)
            _, said = await viewing.communicate()
    assert (viewing.returncode, said) == (0, b"")


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
