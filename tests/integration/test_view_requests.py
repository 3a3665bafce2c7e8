"""`neurosnap view` as a browser and a stranger meet it."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import pytest

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.address import Address
from neurosnap.apps.viewer.connection import Connection
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.recording.read.recording import Recording
from tests.support.page_requests import get, say, status_of
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import TICKS, in_chunks, path_run, recorded, told

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("own_notes")]


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


@asynccontextmanager
async def served(log: Path) -> AsyncIterator[Address]:
    async with asyncio.timeout(PATIENCE), serving(ViewSession(log)) as address:
        yield address


async def test_an_answer_does_not_wait_for_its_head_to_be_acknowledged(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[int] = []
    made = Connection.connection_made

    def watched(self: Connection, transport: asyncio.Transport) -> None:
        made(self, transport)
        own = transport.get_extra_info("socket")
        seen.append(own.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY))

    monkeypatch.setattr(Connection, "connection_made", watched)
    async with served(log) as address:
        await get(address, "/api/run")
    assert seen
    assert all(seen)


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
        _, body = await get(address, "/api/health")
        assert msgspec.json.decode(body, type=api.Health) == api.Health(
            "", [], [], 0, True
        )
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


async def test_who_fails_while_serving_leaves_nothing_listening(log: Path) -> None:
    # The second listens on the descriptor that the first has let go.
    for _ in range(2):
        with pytest.raises(ExceptionGroup) as failed:
            async with served(log) as address:
                status, _ = await get(address, "/api/run")
                assert status == 200
                raise RuntimeError("failed on purpose")
        assert failed.group_contains(RuntimeError, match="on purpose")
