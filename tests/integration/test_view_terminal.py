"""``neurosnap view`` from the command line, with and without a running swarm."""

import asyncio
import os
import shutil
import signal
import socket
import threading
from functools import partial
from pathlib import Path
from typing import NoReturn

import msgspec
import pytest
from typer.testing import CliRunner

from neurosnap.apps.cli import app, serve_page
from neurosnap.apps.cli.serve_page import look, viewed
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.auth import Address
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import describe
from tests.support.page_requests import get
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import path_run

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def _no_browser(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("webbrowser.open", lambda _: True)


def refused(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["view", "--no-browser", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, " ".join(result.stderr.split())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ((), "swarm: must run here, or a recording be given, got ''"),
        (("00000000",), "must run on this machine"),
    ],
)
def test_a_swarm_that_does_not_run_cannot_be_looked_at(
    given: tuple[str, ...], said: str
) -> None:
    code, text = refused(*given)
    assert code == 2
    assert said in text


async def test_a_run_is_looked_at_while_it_goes_on_and_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, stop = tmp_path / "run.mcap", asyncio.Event()
    said: asyncio.Future[str] = asyncio.get_running_loop().create_future()
    monkeypatch.setattr("neurosnap.apps.cli.serve_page.typer.echo", said.set_result)
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
        got = await viewed(log, stop, work, on_end)
    assert (got, looked.is_set()) == ("outcome", True)
    assert (shown[0].live, shown[0].ticks, shown[0].cut) == (True, 0, None)


async def test_a_recording_that_is_about_to_begin_is_waited_for(
    tmp_path: Path, path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late, stop, asked = tmp_path / "late.mcap", asyncio.Event(), []
    said: list[str] = []

    def is_held(path: Path) -> bool:
        asked.append(path)
        if len(asked) == 2:  # it was not there when it was first looked for
            shutil.copy(path_log, late)
        return True

    def say(text: str) -> None:
        said.append(text)
        stop.set()

    monkeypatch.setattr("neurosnap.runtime.registry.is_held", is_held)
    monkeypatch.setattr("neurosnap.apps.cli.serve_page.typer.echo", say)
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
            await viewed(log, asyncio.Event(), work, on_end)


async def test_a_page_that_cannot_be_served_ends_the_run(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work(stop: asyncio.Event) -> None:
        await stop.wait()

    async with asyncio.timeout(PATIENCE):
        with (
            socket.create_server(("127.0.0.1", 0)) as taken,
            pytest.raises(InvalidValueError, match=r"^port: must be free"),
        ):
            port = taken.getsockname()[1]
            monkeypatch.setattr(serve_page, "look", partial(look, port=port))
            await viewed(path_log, asyncio.Event(), work, lambda _: None)


def test_ctrl_c_ends_it_while_a_recording_is_being_read(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    left, free = [], threading.Event()

    def read(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        free.wait(5.0)  # as long as the test takes where this is waited for

    def leave(code: int) -> NoReturn:
        left.append((code, free.is_set()))
        free.set()
        raise SystemExit(code)

    monkeypatch.setattr("neurosnap.apps.viewer.opened_recording.ViewSession", read)
    monkeypatch.setattr("neurosnap.apps.cli.watch.os._exit", leave)
    CliRunner().invoke(app, ["view", "--no-browser", str(path_log)])
    assert left == [(0, False)]
