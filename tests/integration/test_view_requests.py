"""The page's server, with a browser and with unauthorised clients."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path

import msgspec
import pytest
from uvicorn.protocols.http.h11_impl import H11Protocol

from neurosnap.apps import viewer
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.auth import Address
from neurosnap.apps.viewer.opened_recording import ViewSession
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.server import STRANGERS, serving
from tests.support.page_requests import events, get, say, status_of
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, in_chunks

pytestmark = pytest.mark.slow


@asynccontextmanager
async def served(path_log: Path) -> AsyncIterator[Address]:
    async with asyncio.timeout(PATIENCE), serving(ViewSession(path_log)) as address:
        yield address


async def test_an_answer_does_not_wait_for_its_head_to_be_acknowledged(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    made = H11Protocol.connection_made

    def watched(self: H11Protocol, transport: asyncio.Transport) -> None:
        made(self, transport)
        own = transport.get_extra_info("socket")
        seen.append(own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

    monkeypatch.setattr(H11Protocol, "connection_made", watched)
    async with served(path_log) as address:
        await get(address, "/api/run")
    assert seen
    assert all(seen)


async def test_strangers_connections_leave_room_for_the_owners(path_log: Path) -> None:
    async with served(path_log) as address, AsyncExitStack() as stack:
        strangers = []
        for _ in range(STRANGERS + 5):
            ends = await asyncio.open_connection("127.0.0.1", address.port)
            stack.callback(ends[1].close)
            strangers.append(ends)
            ends[1].write(b"GET / HTTP/1.1\r\n")  # and no more of it
            owner = await get(address, "/api/run")
            assert owner[0] == 200
        for reader, _ in strangers[:4]:
            with suppress(ConnectionResetError):
                assert await reader.read() == b""  # it was closed
        assert not strangers[-1][0].at_eof()


async def test_to_be_asked_for_the_head_it_gives_no_body(path_log: Path) -> None:
    async with served(path_log) as address:
        query = f"HEAD /api/run?token={address.token} HTTP/1.1"
        rest = f"Host: localhost:{address.port}\r\nConnection: close\r\n\r\n"
        head = await say(address, f"{query}\r\n{rest}".encode())
    assert status_of(head) == 200
    assert head.endswith(b"\r\n\r\n")


async def test_what_can_wait_is_read_one_at_a_time_and_after_what_is_asked(
    path_log: Path,
) -> None:
    session, order, here = ViewSession(path_log), list[str](), asyncio.Event()

    async def ask(name: str) -> None:
        here.set()
        async with session.held():
            order.append(name)

    async def read_block(name: str) -> None:
        async with session.later:
            for turn in "12":
                async with session.held(later=True):
                    order.append(name + turn)
                    if (name, turn) == ("block ", "1"):
                        here.clear()
                        group.create_task(ask("meanwhile"))
                        await here.wait()

    async with (
        asyncio.timeout(PATIENCE),
        asyncio.TaskGroup() as group,
        session.held(),
    ):
        group.create_task(read_block("block "))
        group.create_task(read_block("other "))
        group.create_task(ask("asked last"))
        await here.wait()
    blocks = ["block 1", "meanwhile", "block 2", "other 1", "other 2"]
    assert order == ["asked last", *blocks]


async def test_a_block_of_ticks_whose_client_is_gone_is_not_read(
    path_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read, gone, frames = [], asyncio.Event(), RunView.frames
    lost = H11Protocol.connection_lost

    def watched(self: RunView, first: int, last: int) -> list[api.Frame]:
        read.append(first)
        return frames(self, first, last)

    def on_lost(self: H11Protocol, error: Exception | None) -> None:
        lost(self, error)
        gone.set()

    monkeypatch.setattr(RunView, "frames", watched)
    monkeypatch.setattr(H11Protocol, "connection_lost", on_lost)
    session = ViewSession(path_log)
    async with asyncio.timeout(PATIENCE), serving(session) as address:
        async with session.later:
            leaving = asyncio.create_task(get(address, "/api/frames?from=1&to=9"))
            await session.wanted.wait()
            leaving.cancel()
            await gone.wait()
        status, _ = await get(address, "/api/frames?from=11&to=12")
        assert (status, read) == (200, [11, 12])


STATIC = Path(viewer.__file__).parent / "static"
WRONG = [
    ("/api/frames", 400, "from: must be a whole number from 0 up, got None"),
    ("/api/frames?from=-1", 400, "from: must be a whole number"),
    ("/api/frames?from=1e3", 400, "from: must be a whole number"),
    ("/api/frames?from=%D9%A3", 400, "from: must be a whole number"),
    ("/api/frames?from=1&to=241", 400, "to: must be at most 239 after from"),
    (f"/api/frames?from={'9' * 400}", 400, "from: must have at most 10 digits"),
    ("/api/graph?tick=41", 400, "tick: must be in [0, 40], got 41"),
    ("/api/edge?source=0&target=1&tick=3", 400, "pair: must be of two sensors"),
    ("/api/edge?source=0&target=99&tick=3", 400, "b: must be a literal"),
    ("/api/series?points=3", 400, "points: must be in [4, 2000]"),
    ("/api/run?run=1", 400, "run: must be in [0, 0], got 1"),
    ("/api/run?run=x", 400, "run: must be a whole number from 0 up"),
    ("/api/difference?tick=3&then=3&other=7", 400, "other: must be in [0, 0]"),
    ("/api/image?tick=1", 404, "no image of tick 1"),
    ("/api/nothing", 404, "not here"),
    ("/nothing.js", 404, "not here"),
    ("/vendor/", 404, "not here"),
]
"""Questions, and how each is answered."""
CLIMBING = [
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
]
"""Paths that would lead out of the folder of the page."""


async def test_every_file_of_the_page_is_given_as_it_is(path_log: Path) -> None:
    names = [each.relative_to(STATIC) for each in STATIC.rglob("*") if each.is_file()]
    names.remove(Path("main.js"))
    async with served(path_log) as address:
        for name in names:
            assert await get(address, f"/{name}") == (200, (STATIC / name).read_bytes())
        assert await get(address, "/") == await get(address, "/index.html")
        _, script = await get(address, "/main.js")
        query = f"GET /main.js?token={address.token} HTTP/1.1\r\nAccept-Encoding: gzip"
        rest = f"Host: localhost:{address.port}\r\nConnection: close\r\n\r\n"
        packed = await say(address, f"{query}\r\n{rest}".encode())
    own = [name.as_posix() for name in names if name.suffix == ".js"]
    own = [name for name in own if name != "file.js" and "vendor" not in name]
    assert all(f"modules['{name}'] = ".encode() in script for name in own)
    assert b"\nimport " not in script
    assert len(packed) < len(script) / 2


async def test_a_wrong_question_is_told_what_is_wrong(path_log: Path) -> None:
    async with served(path_log) as address:
        for target, status, error in WRONG:
            answered, body = await get(address, target)
            assert answered == status, target
            said = msgspec.json.decode(body, type=api.Wrong).error
            assert said.startswith(error), target
        for target in CLIMBING:
            found = await get(address, target)
            assert found == (404, b'{"error":"not here"}'), target


BAD = [
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
]
"""Requests that are none, with the statuses that may answer each."""


async def test_a_huge_or_malformed_request_is_refused_and_no_other_suffers(
    path_log: Path,
) -> None:
    async with served(path_log) as address:
        for request, statuses in BAD:
            answer = await say(address, request)
            # Where the server closes before it has read all, the answer may be lost.
            if answer or len(request) <= 65536:
                assert status_of(answer) in statuses, request[:80]
            status, _ = await get(address, "/api/run")
            assert status == 200, request[:80]


async def test_it_listens_on_loopback_alone(path_log: Path) -> None:
    async with served(path_log) as address:
        with socket.socket() as other:
            # Nobody listens there on any other address of this machine.
            other.bind(("127.0.0.2", address.port))


async def test_who_fails_while_serving_leaves_nothing_listening(path_log: Path) -> None:
    # The second listens on the descriptor that the first has let go.
    for _ in range(2):
        with pytest.raises(ExceptionGroup) as failed:
            async with served(path_log) as address:
                status, _ = await get(address, "/api/run")
                assert status == 200
                raise RuntimeError("failed on purpose")
        assert failed.group_contains(RuntimeError, match="on purpose")


async def test_a_growing_recording_is_told_frame_by_frame(
    path_log: Path, tmp_path: Path
) -> None:
    small = in_chunks(path_log, tmp_path / "small.mcap", 2000)
    data, growing = small.read_bytes(), tmp_path / "growing.mcap"
    growing.write_bytes(data[: len(data) // 3])
    last: dict[int, api.Frame] = {}
    shares = iter([40, 45, 50, 100])
    loop = asyncio.get_running_loop()
    times = []
    session = ViewSession(growing, lambda: growing.stat().st_size < len(data))
    async with asyncio.timeout(PATIENCE), serving(session) as address:
        async for event in events(address):
            times.append(loop.time())
            last |= {frame.tick: frame for frame in event.frames}
            assert len(event.frames) <= 11  # the last one again, and the newest
            assert event.live or event.ticks == TICKS
            share = next(shares, None)
            if share is not None:
                growing.write_bytes(data[: len(data) * share // 100])
    assert event.ticks == TICKS
    assert event.cut is None
    assert len(last) > 5
    for each in RunView(small).frames(min(last), TICKS):
        if each.tick in last:
            assert last[each.tick] == each
    assert times[-1] - times[0] > 0.09 * (len(times) - 1)
