"""Requests to `neurosnap view`, its answers, and what it has read in the end."""

import asyncio
from collections.abc import AsyncGenerator
from pathlib import Path

import msgspec

from neurosnap.apps.viewer.api import Event
from neurosnap.apps.viewer.auth import Address
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView


def read(log: Path) -> RunHistory:
    """Return what a view has read of a recording in the end."""
    history = RunHistory(RunView(log))
    while history.read_on():
        pass
    return history


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


async def events(address: Address) -> AsyncGenerator[Event]:
    reader, writer = await asyncio.open_connection("127.0.0.1", address.port)
    target = f"/api/events?token={address.token}"
    head = f"GET {target} HTTP/1.1\r\nHost: localhost:{address.port}\r\nConnection: close\r\n\r\n"
    writer.write(head.encode())
    try:
        while line := await reader.readline():
            if line.startswith(b"data: "):
                yield msgspec.json.decode(line[6:], type=Event)
    finally:
        writer.close()
