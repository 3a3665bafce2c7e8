"""`neurosnap view` as a browser, a stranger and a person at a terminal meet it."""

import asyncio
import json
import os
import shutil
import signal
import socket
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import aclosing, asynccontextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from typer.testing import CliRunner

from neurosnap import wire
from neurosnap.apps.cli import app
from neurosnap.apps.cli.page import look, viewed
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import Address, serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.run import describe
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, in_chunks, path_run, recorded, told
from tests.support.view_commands import address_of, verb

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder of notes of this test's own."""
    folder = tmp_path / "runtime"
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))


# Whoever asks -------------------------------------------------------------------------


@asynccontextmanager
async def served(log: Path) -> AsyncIterator[Address]:
    async with asyncio.timeout(PATIENCE), serving(ViewSession(log)) as address:
        yield address


async def say(address: Address, request: bytes) -> bytes:
    """Send bytes and return all that comes back until the server closes."""
    reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
    try:
        writer.write(request)
        return await reader.read()
    except ConnectionResetError:  # it did not even read what was too much
        return b""
    finally:
        writer.close()


def status_of(answer: bytes) -> int:
    return int(answer.split(b" ", 2)[1])


async def get(
    address: Address, target: str, *headers: str, host: str = "", token: bool = True
) -> tuple[int, bytes]:
    """Return status and body of what a client with the token gets."""
    lines = [
        f"GET {target} HTTP/1.1",
        f"Host: {host or f'127.0.0.1:{address.port}'}",
        *([f"Cookie: neurosnap-{address.port}={address.token}"] if token else []),
        "Connection: close",
        *headers,
    ]
    answer = await say(address, "\r\n".join([*lines, "", ""]).encode())
    head, _, body = answer.partition(b"\r\n\r\n")
    return status_of(head), body


async def test_it_answers_what_the_page_asks(log: Path) -> None:
    derived = told(log)
    async with served(log) as address:
        status, body = await get(address, "/api/run")
        run = msgspec.json.decode(body, type=api.Run)
        assert (status, run.first, run.ticks, run.live) == (200, 1, TICKS, False)
        assert (run.cut, run.source) == (None, "neurosnap/Path-v0")
        assert run.world is not None
        assert (run.world.kind, run.world.places) == ("path", 8)
        _, body = await get(address, f"/api/frames?from=1&to={TICKS}")
        frames = msgspec.json.decode(body, type=api.Frames).frames
        assert [frame.tick for frame in frames] == list(range(1, TICKS + 1))
        assert all(frame.state == derived[frame.tick].state for frame in frames)
        _, body = await get(address, "/api/graph?tick=20")
        graph = msgspec.json.decode(body, type=api.Graph)
        assert (graph.id, graph.height) == (frames[19].graph, derived[20].height)
        _, body = await get(address, "/api/edge?source=0&target=2&tick=20")
        assert msgspec.json.decode(body, type=api.Edge).tick == 20
        _, body = await get(address, "/api/cells")
        cells = msgspec.json.decode(body, type=api.Cells)
        assert cells.read_to == TICKS
        expected = Recording.open(log).noted().expected
        assert {c.who: c.messages for c in cells.cells}.items() <= expected.items()
        assert [c.sensors for c in cells.cells if c.sensors] == [[k] for k in range(7)]
        series = api.Series(column="edges", ticks=[], values=[], done=False)
        while not series.done:
            _, body = await get(address, "/api/series?column=edges&points=2000")
            series = msgspec.json.decode(body, type=api.Series)
        assert series.values == [frame.edges for frame in frames]


@pytest.mark.parametrize(
    ("target", "status", "error"),
    [
        ("/api/frames", 400, "from: must be a whole number from 0 up, got None"),
        ("/api/frames?from=-1", 400, "from: must be a whole number"),
        ("/api/frames?from=1e3", 400, "from: must be a whole number"),
        ("/api/frames?from=%D9%A3", 400, "from: must be a whole number"),
        ("/api/frames?from=1&to=241", 400, "to: must be at most 239 after from"),
        (f"/api/frames?from={'9' * 400}", 400, "from: must have at most 10 digits"),
        ("/api/graph?tick=41", 400, "tick: must be in [0, 40], got 41"),
        ("/api/edge?source=0&target=1&tick=3", 400, "pair: must be of two sensors"),
        ("/api/edge?source=0&target=99&tick=3", 400, "b: must be a literal"),
        ("/api/series?column=size", 400, "column: must be one of edges"),
        ("/api/series?column=edges&points=3", 400, "points: must be in [4, 2000]"),
        ("/api/nothing", 404, "not here"),
        ("/nothing.js", 404, "not here"),
    ],
)
async def test_a_wrong_question_is_told_what_is_wrong(
    log: Path, target: str, status: int, error: str
) -> None:
    async with served(log) as address:
        answered, body = await get(address, target)
    assert answered == status
    assert msgspec.json.decode(body, type=api.Wrong).error.startswith(error)


@pytest.mark.parametrize(
    "target",
    [
        "/../server.py",
        "/static/../server.py",
        "/..%2fserver.py",
        "/%2e%2e/server.py",
        "/%2e%2e%2f%2e%2e%2f%2e%2e%2fetc/passwd",
        "//etc/passwd",
        "/etc/passwd",
        "/..\\server.py",
        "/vendor/../../api.py",
        "/index.html%00.js",
        "/file:///etc/passwd",
        "/.",
        "/..",
        "http://evil.example/etc/passwd",
    ],
)
async def test_a_path_that_climbs_out_leads_nowhere(log: Path, target: str) -> None:
    async with served(log) as address:
        status, body = await get(address, target)
    assert status == 404
    assert body == b'{"error":"not here"}'


async def test_another_origin_host_or_no_token_gets_nothing(log: Path) -> None:
    async with served(log) as address:
        for headers, host, token, status in [
            (["Origin: http://evil.example"], "", True, 403),
            (["Origin: null"], "", True, 403),
            (["Sec-Fetch-Site: cross-site"], "", True, 403),
            ([], f"evil.example:{address.port}", True, 421),  # DNS rebinding
            ([], "127.0.0.1", True, 421),
            ([], "", False, 401),
        ]:
            for target in ("/", "/api/run", "/api/events"):
                got, body = await get(address, target, *headers, host=host, token=token)
                assert got == status
                assert b"below_1" not in body
                assert address.token.encode() not in body


@pytest.mark.parametrize(
    ("request_", "statuses"),
    [
        (b"GET /" + b"a" * 1_000_000 + b" HTTP/1.1\r\n\r\n", {400}),
        (b"GET / HTTP/1.1\r\nHost: x\r\nX: " + b"a" * 1_000_000, {400}),
        (b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 100_000 + b"\r\n", {400}),
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", {400}),
        (b"\x00" * 4096 + b"\r\n\r\n", {400}),
        (b"GET\r\n\r\n", {400}),
        (b"GET / HTTP/9.9\r\nConnection: close\r\n\r\n", {400, 421}),
        (b"GET / HTTP/1.1\r\n\r\n", {400}),  # without a host
        (b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", {400, 421}),
        (b"GET / HTTP/1.0\r\n\r\n", {421}),
        (b"GET / HTTP/1.1\r\nHost: a\r\nContent-Length: x\r\n\r\n", {400}),
    ],
)
async def test_a_huge_or_malformed_request_is_refused_and_nobody_else_suffers(
    log: Path, request_: bytes, statuses: set[int]
) -> None:
    async with served(log) as address:
        answer = await say(address, request_)
        # Where the server closes before it has read all, the answer may be lost.
        if answer or len(request_) <= 65536:
            assert status_of(answer) in statuses
        status, _ = await get(address, "/api/run")
    assert status == 200


async def test_a_head_has_no_body_and_a_post_is_refused(log: Path) -> None:
    async with served(log) as address:
        cookie = f"Cookie: neurosnap-{address.port}={address.token}"
        rest = (
            f"Host: localhost:{address.port}\r\n{cookie}\r\nConnection: close\r\n\r\n"
        )
        head = await say(address, f"HEAD /api/run HTTP/1.1\r\n{rest}".encode())
        post = await say(address, f"POST /api/run HTTP/1.1\r\n{rest}".encode())
    assert (status_of(head), head.partition(b"\r\n\r\n")[2]) == (200, b"")
    assert status_of(post) == 405


async def test_it_listens_on_loopback_alone(log: Path) -> None:
    async with served(log) as address:
        with socket.socket() as other:
            # Nobody listens there on any other address of this machine.
            other.bind(("127.0.0.2", address.port))


async def test_a_broken_recording_says_where_it_ends(log: Path, tmp_path: Path) -> None:
    small = in_chunks(log, tmp_path / "small.mcap", 2000)
    data = small.read_bytes()
    small.write_bytes(data[: len(data) // 2])
    async with served(small) as address:
        _, body = await get(address, "/api/run")
    run = msgspec.json.decode(body, type=api.Run)
    assert 0 < run.ticks < TICKS
    assert run.cut is not None
    assert "cut short after" in run.cut


# While it grows -----------------------------------------------------------------------


async def events(address: Address) -> AsyncGenerator[api.Event]:
    reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
    target = f"/api/events?token={address.token}"
    head = f"GET {target} HTTP/1.1\r\nHost: localhost:{address.port}\r\nConnection: close\r\n\r\n"
    writer.write(head.encode())
    try:
        while line := await reader.readline():
            if line.startswith(b"data: "):
                yield msgspec.json.decode(line[6:], type=api.Event)
    finally:
        writer.close()


def applied(frame: dict[str, Any] | None, change: api.Change) -> dict[str, Any]:
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
                event.ticks < TICKS or not session.run_view.files.finished
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
            await asyncio.sleep(0)
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


# At a terminal ------------------------------------------------------------------------


def refused(*arguments: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, ["view", "--no-browser", *arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, " ".join(result.stderr.split())


def test_wrong_usage_is_one_line(tmp_path: Path, log: Path) -> None:
    assert refused() == (2, "error: log: must be given, or --live, got 'nothing'")
    code, text = refused(str(tmp_path / "none.mcap"))
    assert (code, text[:22]) == (2, "error: log: must exist")
    (tmp_path / "text.mcap").write_text("tick,a\n", encoding="utf-8")
    code, text = refused(str(tmp_path / "text.mcap"))
    assert (code, text[:36]) == (1, "error: log: must be an MCAP recordin")
    code, text = refused("--live")
    assert code == 2
    assert "must be named where there is not just one" in text
    code, text = refused("--live", "00000000")
    assert code == 2
    assert "no swarm runs here" in text
    code, text = refused(str(log), "--port", "70000")
    assert (code, text) == (2, "error: port: must be in [0, 65535], got 70000")


def test_a_port_in_use_is_named(log: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, text = refused(str(log), "--port", str(port))
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
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    late, stop, asked = tmp_path / "late.mcap", asyncio.Event(), []
    said: list[str] = []

    def recorded_in(path: Path) -> bool:
        asked.append(path)
        if len(asked) == 2:  # it was not there when it was first looked for
            shutil.copy(log, late)
        return True

    def say(text: str) -> None:
        said.append(text)
        stop.set()

    monkeypatch.setattr("neurosnap.runtime.registry.recorded_in", recorded_in)
    monkeypatch.setattr("neurosnap.apps.cli.page.typer.echo", say)
    async with asyncio.timeout(PATIENCE):
        await look(late, stop, browser=False)
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
    tmp_path: Path, log: Path
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
            await viewed(log, asyncio.Event(), work, lambda _: None, **options)


async def test_ctrl_c_ends_it_in_order(tmp_path: Path, log: Path) -> None:
    notes = tmp_path / "runtime"
    async with (
        asyncio.timeout(PATIENCE),
        verb(notes, "view", str(log), "--no-browser") as viewing,
    ):
        base, _, token = (await address_of(viewing)).partition("/?token=")
        address = Address(int(base.rpartition(":")[2]), token)
        async with aclosing(events(address)) as told:
            assert (await anext(told)).ticks == TICKS
            viewing.send_signal(signal.SIGINT)
            _, said = await viewing.communicate()
    assert (viewing.returncode, said) == (0, b"")
