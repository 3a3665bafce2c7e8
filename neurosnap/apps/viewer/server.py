"""The web server of the page: its connections, its static files, its questions.

It listens on loopback alone. What may ask it anything is for
`neurosnap.apps.viewer.auth` to say; the answers are in
`neurosnap.apps.viewer.questions`.
"""

import asyncio
import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp

from neurosnap.apps.viewer.auth import LOOPBACK, Address, Guard, refusal
from neurosnap.apps.viewer.questions import Questions
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.errors import InvalidValueError, NeurosnapError

_GRACE = 3
"""Seconds an answer may take to end once the server is to."""
_STATIC = Path(__file__).parent / "static"


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the caller, who has handlers for them."""
        yield


@asynccontextmanager
async def serving(*sessions: ViewSession, port: int = 0) -> AsyncIterator[Address]:
    """Serve while the context is entered; yields where, once it listens.

    Args:
        sessions: The recordings, one or more.
        port: 0: any that is free.

    Raises:
        InvalidValueError: The port is in use, may not be used, or is none.
    """
    stop = asyncio.Event()
    with _listener(port) as listener:
        # Connections inherit it. An answer goes out in two parts, its head first: the
        # second would wait until the first is acknowledged, which takes 40 ms.
        listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        address = Address(listener.getsockname()[1], secrets.token_urlsafe(24))
        server = _Server(
            uvicorn.Config(
                _application(sessions, address, stop),
                http="h11",
                ws="none",
                lifespan="off",
                log_config=None,
                access_log=False,  # it would hold the token
                server_header=False,
                proxy_headers=False,
                timeout_graceful_shutdown=_GRACE,
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

    async def page(_: Request) -> Response:
        return FileResponse(_STATIC / "index.html")

    async def nowhere(_: Request, __: Exception) -> Response:
        return refusal(404, "not here")

    async def wrong(_: Request, error: Exception) -> Response:
        status = 400 if isinstance(error, InvalidValueError) else 500
        return refusal(status, str(error))

    endpoints = Questions(sessions, stop).endpoints()
    app = Starlette(
        routes=[
            *(Route(f"/api/{name}", each) for name, each in endpoints.items()),
            Route("/", page),
            Mount("/", StaticFiles(directory=_STATIC)),
        ],
        exception_handlers={404: nowhere, NeurosnapError: wrong},
    )
    return Guard(app, address.port, address.token)


def _listener(port: int) -> socket.socket:
    """Return a socket that listens on loopback."""
    if not 0 <= port < 1 << 16:
        raise InvalidValueError("port", "must be in [0, 65535]", port)
    try:
        return socket.create_server((LOOPBACK, port))
    except OSError as error:
        rule = f"must be free on this machine ({error})"
        raise InvalidValueError("port", rule, port) from error
