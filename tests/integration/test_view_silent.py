"""Whoever connects to the page's server and asks nothing keeps nobody out."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path

import pytest

from neurosnap.apps.viewer import connection
from neurosnap.apps.viewer.address import Address
from neurosnap.apps.viewer.server import serving
from neurosnap.apps.viewer.session import ViewSession
from tests.support.page_requests import get, status_of
from tests.support.patience import PATIENCE
from tests.support.recorded_runs import path_run, recorded

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(path_run(), tmp_path_factory.mktemp("path") / "run.mcap")


@asynccontextmanager
async def held(
    address: Address, count: int
) -> AsyncIterator[list[asyncio.StreamReader]]:
    """Hold so many connections."""
    async with AsyncExitStack() as stack:
        readers: list[asyncio.StreamReader] = []
        for _ in range(count):
            reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
            stack.callback(writer.close)
            readers.append(reader)
        yield readers


async def test_silent_connections_keep_nobody_out(log: Path) -> None:
    """More than there are places for, all of them from somebody without the token."""
    async with (
        asyncio.timeout(PATIENCE),
        serving(ViewSession(log)) as address,
        held(address, 2 * connection.MOST),
    ):
        for _ in range(3):
            status, body = await get(address, "/")
            assert (status, body[:9].lower()) == (200, b"<!doctype"), body


@pytest.mark.parametrize(
    "said",
    [
        [],
        [b"GET / HTTP/1.1\r\n"],
        # A whole request, which is refused, and then the half of another.
        [b"GET / HTTP/1.1\r\nHost: no\r\n\r\n", b"GET / HTTP/1.1\r\nX: "],
    ],
    ids=["nothing", "half a request", "half a second one"],
)
async def test_what_does_not_become_a_request_is_closed(
    log: Path, monkeypatch: pytest.MonkeyPatch, said: Sequence[bytes]
) -> None:
    monkeypatch.setattr(connection, "SILENCE", 0.05)
    async with asyncio.timeout(PATIENCE), serving(ViewSession(log)) as address:
        reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
        try:
            for part in said:
                writer.write(part)
            answer = await reader.read()
        finally:
            writer.close()
    if len(said) > 1:
        assert status_of(answer) == 421
        assert answer.count(b"HTTP/1.1") == 1
    else:
        assert answer == b""


async def test_an_answer_that_takes_longer_is_not_cut_off(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connection, "SILENCE", 0.05)
    async with asyncio.timeout(PATIENCE), serving(ViewSession(log)) as address:
        reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
        target = f"/api/events?token={address.token}"
        head = f"GET {target} HTTP/1.1\r\nHost: localhost:{address.port}\r\n\r\n"
        writer.write(head.encode())
        try:
            assert b"200" in await reader.readline()
            # Others come and go silent meanwhile.
            _, silent = await asyncio.open_connection("127.0.0.1", address.port)
            other, late = await asyncio.open_connection("127.0.0.1", address.port)
            assert await other.read() == b""
            silent.close()
            late.close()
            assert not reader.at_eof()
        finally:
            writer.close()
