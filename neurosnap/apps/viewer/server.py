"""The web server of the page: its connections, its static files, its questions.

It listens on loopback alone. What may ask it anything is for
`neurosnap.apps.viewer.auth` to say; the answers are in
`neurosnap.apps.viewer.questions`.

Any user of the machine can connect, and a connection costs a place of the few there
are. One that asks nothing is closed after some seconds; and when all places are taken,
the one that has been silent longest makes room. So a client that only holds connections
does not keep out one that has the token.
"""

import asyncio
import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

from neurosnap.apps.viewer.auth import LARGEST_HEAD, LOOPBACK, Address, Guard, refusal
from neurosnap.apps.viewer.questions import Questions
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.errors import InvalidValueError

MOST = 64
"""Connections, at most."""
SILENCE = 5.0
"""Seconds until a whole request has come: the first, and each after an answer."""
PAGE = "index.html"
_GRACE = 3
"""Seconds an answer may take to end once the server is to."""
_TYPES = {
    "css": "text/css",
    "html": "text/html",
    "js": "text/javascript",
    "svg": "image/svg+xml",
}
_STATIC = files("neurosnap.apps.viewer") / "static"


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the caller, who has handlers for them."""
        yield


@asynccontextmanager
async def serving(
    *sessions: ViewSession, port: int = 0, last: Address | None = None
) -> AsyncIterator[Address]:
    """Serve while the context is entered; yields where, once it listens.

    Args:
        sessions: The recordings, one or more.
        port: 0: that of `last`, or any that is free.
        last: Where it was served before: who was let in there is let in again.

    Raises:
        InvalidValueError: The port is in use, may not be used, or is none.
    """
    stop = asyncio.Event()
    listener = _listener(port, last)
    with listener:
        # Connections inherit it. An answer goes out in two parts, its head first: the
        # second would wait until the first is acknowledged, which takes 40 ms.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        token = secrets.token_urlsafe(24) if last is None else last.token
        address = Address(listener.getsockname()[1], token)
        server = _Server(
            uvicorn.Config(
                _application(sessions, address, stop),
                http=Connection,
                ws="none",
                lifespan="off",
                log_config=None,
                access_log=False,  # it would hold the token
                server_header=False,
                proxy_headers=False,
                limit_concurrency=MOST,
                timeout_graceful_shutdown=_GRACE,
                h11_max_incomplete_event_size=2 * LARGEST_HEAD,
            )
        )
        async with asyncio.TaskGroup() as group:
            serve = server.serve(sockets=[listener])
            served = group.create_task(serve, name="view/server")
            for session in sessions:
                group.create_task(session.read_on(stop), name="view/series")
            try:
                yield address
            finally:
                stop.set()
                server.should_exit = True
                # If the caller fails, the group cancels its tasks. A cancelled
                # server leaves its socket with the loop, and the next server that
                # gets the same descriptor would get no connection.
                await asyncio.wait([served])


def _application(
    sessions: Sequence[ViewSession], address: Address, stop: asyncio.Event
) -> ASGIApp:
    """Return what answers requests.

    Args:
        sessions: The recordings, one or more.
        address: Where it is asked.
        stop: Ends what would go on for ever.
    """

    async def static(request: Request) -> Response:
        return asset(request.path_params["name"]) or await nowhere(request)

    async def nowhere(_: Request, __: Exception | None = None) -> Response:
        return refusal(404, "not here")

    endpoints = Questions(sessions, stop).endpoints()
    app = Starlette(
        routes=[
            *(Route(f"/api/{name}", each) for name, each in endpoints.items()),
            Route("/{name:path}", static),
        ],
        exception_handlers={404: nowhere},
    )
    return Guard(app, address.port, address.token)


def _listener(port: int, last: Address | None) -> socket.socket:
    """Return a socket that listens on loopback."""
    if port == 0 and last is not None:
        with contextlib.suppress(OSError):  # another page is there
            return socket.create_server((LOOPBACK, last.port))
    if not 0 <= port < 1 << 16:
        raise InvalidValueError("port", "must be in [0, 65535]", port)
    try:
        return socket.create_server((LOOPBACK, port))
    except OSError as error:
        rule = f"must be free on this machine ({error})"
        raise InvalidValueError("port", rule, port) from error


class Connection(H11Protocol):
    """One connection, which must send its request soon."""

    def __init__(self, *given: Any, **named: Any) -> None:  # noqa: ANN401
        super().__init__(*given, **named)
        self._silent_since = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a place, another's where there is none left."""
        super().connection_made(transport)
        self._await_request()
        if len(self.connections) >= MOST:
            silent = [
                other
                for other in self.connections
                if isinstance(other, Connection) and other.is_silent
            ]
            silent.sort(key=lambda other: other._silent_since)  # noqa: SLF001
            if silent[0] is not self:
                silent[0].drop()

    @property
    def is_silent(self) -> bool:
        """It has asked nothing that is not answered."""
        return self._timer is not None

    def drop(self) -> None:
        """Close, and give the place up at once."""
        self._ask_no_more()
        self.connections.discard(self)
        self.transport.close()

    def data_received(self, data: bytes) -> None:
        """Take in a part of a request; the wait ends with the whole of it."""
        super().data_received(data)
        if self._is_answering():
            self._ask_no_more()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        if not self.transport.is_closing():
            self._await_request()
        super().on_response_complete()
        if self._is_answering():  # the next had come already
            self._ask_no_more()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the wait."""
        self._ask_no_more()
        super().connection_lost(exc)

    def _is_answering(self) -> bool:
        cycle: RequestResponseCycle | None = self.cycle  # none before the first request
        return cycle is not None and not cycle.response_complete

    def _await_request(self) -> None:
        self._ask_no_more()
        self._silent_since = self.loop.time()
        self._timer = self.loop.call_later(SILENCE, self.drop)

    def _ask_no_more(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


def _found(folder: Traversable, prefix: str = "") -> Iterator[tuple[str, Traversable]]:
    """Yield the files of the page in a folder, with their names below ``static/``."""
    for entry in folder.iterdir():
        name = prefix + entry.name
        if entry.is_dir():
            yield from _found(entry, f"{name}/")
        elif name.rpartition(".")[2] in _TYPES:
            yield name, entry


_FILES = dict(sorted(_found(_STATIC)))
NAMES = tuple(_FILES)
"""All files that are served; no other is."""


def asset(name: str) -> Response | None:
    """Return the file of a name, ``""`` for the page itself; None if there is none."""
    known = name or PAGE
    if known not in _FILES:
        return None
    return Response(_content(known), media_type=_TYPES[known.rpartition(".")[2]])


@cache
def _content(name: str) -> bytes:
    """Return what is in one of `NAMES`."""
    return _FILES[name].read_bytes()
