"""The web server of the page: its connections, its static files, its answers.

It listens on loopback alone. What may ask it anything is for
`neurosnap.apps.viewer.auth` to say. The questions are listed in
`neurosnap.apps.viewer.api`; each method of `Questions` answers the one of its name. No
path is ever made of what a request says.
"""

import asyncio
import contextlib
import secrets
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import QueryParams
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import FileResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.auth import LOOPBACK, Address, Guard, Strangers, refusal
from neurosnap.apps.viewer.opened_recording import ViewSession, news
from neurosnap.apps.viewer.page_file import bundled
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_difference import difference
from neurosnap.apps.viewer.time_series import MOST_COLUMNS, MOST_SENSORS
from neurosnap.errors import InvalidValueError, NeurosnapError

STRANGERS = 64
"""Connections without the token that may be open."""
_GRACE = 3
"""Seconds an answer may take to end once the server is to."""
_STATIC = Path(__file__).parent / "static"
_TURN = 0.1
"""Seconds, about, after which another question has its turn: a page asks for many
frames in advance, and those of a run that imagines take long."""
_DIGITS = 10
"""The most digits a number may have: none of ours has more."""
Endpoint = Callable[[Request], Awaitable[Response]]
_encoder = msgspec.json.Encoder()


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the handlers of the caller."""
        yield


class _Connection(H11Protocol):
    """A connection, which counts as a stranger's until it has shown the token.

    Any user of this machine can open some and leave them: of strangers' connections the
    oldest ends when there are too many, so that files are left for the owner's.
    """

    def __init__(self, strangers: Strangers, **given: Any) -> None:  # noqa: ANN401
        super().__init__(**given)
        self._strangers = strangers

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take it in."""
        super().connection_made(transport)
        self._strangers[self.client] = transport
        if len(self._strangers) > STRANGERS:
            self._strangers.pop(next(iter(self._strangers))).abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Take it out."""
        self._strangers.pop(self.client, None)
        super().connection_lost(exc)


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
        strangers: Strangers = {}
        server = _Server(
            uvicorn.Config(
                Guard(_application(sessions, stop), address, strangers),
                http=partial(_Connection, strangers),  # type: ignore[arg-type]
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


def _application(sessions: Sequence[ViewSession], stop: asyncio.Event) -> ASGIApp:
    """Return what answers requests; `stop` ends what would go on for ever."""

    async def page(_: Request) -> Response:
        return FileResponse(_STATIC / "index.html")

    async def script(_: Request) -> Response:
        text = bundled("main.js", {}) + "export const { page } = modules['main.js'];\n"
        return Response(text, media_type="text/javascript")

    async def nowhere(_: Request, __: Exception) -> Response:
        return refusal(404, "not here")

    async def wrong(_: Request, error: Exception) -> Response:
        status = 400 if isinstance(error, InvalidValueError) else 500
        return refusal(status, str(error))

    endpoints = Questions(sessions, stop).endpoints()
    found = Starlette(
        routes=[
            *(Route(f"/api/{name}", each) for name, each in endpoints.items()),
            Route("/", page),
            Route("/main.js", script),
            Mount("/", StaticFiles(directory=_STATIC)),
        ],
        exception_handlers={404: nowhere, NeurosnapError: wrong},
    )
    return GZipMiddleware(found, minimum_size=2000, compresslevel=3)


def _listener(port: int) -> socket.socket:
    """Return a socket that listens on loopback."""
    if not 0 <= port < 1 << 16:
        raise InvalidValueError("port", "must be in [0, 65535]", port)
    try:
        return socket.create_server((LOOPBACK, port))
    except OSError as error:
        rule = f"must be free on this machine ({error})"
        raise InvalidValueError("port", rule, port) from error


class Questions:
    """Answers requests about recordings.

    Args:
        sessions: The recordings, one or more.
        stop: Ends what would go on for ever.
    """

    def __init__(self, sessions: Sequence[ViewSession], stop: asyncio.Event) -> None:
        self._sessions = sessions
        self._stop = stop
        self._pairs = asyncio.Lock()
        """Held by the question that holds two views: two might wait for each other."""

    def endpoints(self) -> dict[str, Endpoint]:
        """Return the function that answers each request, by name."""
        every: tuple[Endpoint, ...] = (
            *(self.runs, self.run, self.presence, self.events),
            *(self.frames, self.wave, self.graph, self.edge, self.image),
            *(self.series, self.raster, self.marks, self.beside, self.tested),
            *(self.births, self.findings, self.depths, self.difference),
        )
        return {each.__name__: each for each in every}

    def _asked(self, request: Request, name: str = "run") -> ViewSession:
        """Return the recording that is asked about: the first, but for what is said."""
        number = whole(request.query_params, name, 0)
        if number >= len(self._sessions):
            rule = f"must be in [0, {len(self._sessions) - 1}]"
            raise InvalidValueError(name, rule, number)
        self._sessions[number].wanted.set()
        return self._sessions[number]

    def _ticks(self, request: Request) -> tuple[int, int]:
        """Return the ticks that are asked for: all there are, but for what is said."""
        query, last = request.query_params, self._asked(request).run_view.last
        first = max(1, whole(query, "from", 1))
        return first, whole(query, "to", max(first, last))

    # The recordings -------------------------------------------------------------------

    async def runs(self, _: Request) -> Response:
        """Answer which recordings there are, by number."""
        for session in self._sessions:
            await session.look()
        paths = [session.run_view.path for session in self._sessions]
        names = [path.name for path in paths]
        if len(set(names)) < len(names):  # only their folders tell them apart
            names = list(map(str, paths))
        return _answer(
            api.Runs(
                [
                    api.Listed(name=name, live=session.live)
                    for name, session in zip(names, self._sessions, strict=True)
                ]
            )
        )

    async def run(self, request: Request) -> Response:
        """Answer what is being looked at."""
        return _answer(await self._asked(request).run())

    async def presence(self, request: Request) -> Response:
        """Answer whether the recording is still there, and whom its run waits for."""
        session, waiting = self._asked(request), None
        trouble = await asyncio.to_thread(session.trouble)
        if trouble is None and session.live:
            await session.look()
            waiting = await session.ask(RunView.waiting)
        return _answer(api.Presence(trouble, waiting))

    async def events(self, request: Request) -> Response:
        """Answer with what is new, again and again."""
        told = news(self._asked(request), self._stop)
        return StreamingResponse(told, media_type="text/event-stream")

    # A tick ---------------------------------------------------------------------------

    async def frames(self, request: Request) -> Response:
        """Answer what happened at some ticks."""
        first = max(1, whole(request.query_params, "from"))
        last = whole(request.query_params, "to", first)
        if last - first >= api.MOST_FRAMES:
            rule = f"must be at most {api.MOST_FRAMES - 1} after from"
            raise InvalidValueError("to", rule, last)
        session, at_once, later = self._asked(request), 1, last > first
        found: list[api.Frame] = []
        async with session.later if later else nullcontext():
            while first <= last and not await request.is_disconnected():
                end = min(first + at_once - 1, last)
                async with session.held(later=later) as view:
                    began = time.perf_counter()
                    found += await asyncio.to_thread(view.frames, first, end)
                took, first = time.perf_counter() - began, end + 1
                at_once = max(1, int(min(2, _TURN / took) * at_once))
        return _answer(api.Frames(found))

    async def graph(self, request: Request) -> Response:
        """Answer what the learned order is after a tick."""
        tick = whole(request.query_params, "tick")
        return _answer(await self._asked(request).ask(RunView.graph, tick))

    async def wave(self, request: Request) -> Response:
        """Answer what a wave reached, and after how many hops."""
        named = [whole(request.query_params, name) for name in ("tick", "wave")]
        return _answer(await self._asked(request).ask(RunView.wave, *named))

    async def edge(self, request: Request) -> Response:
        """Answer what speaks for and against an implication."""
        query = request.query_params
        named = [whole(query, name) for name in ("source", "target", "tick")]
        return _answer(await self._asked(request).ask(RunView.edge, *named))

    async def image(self, request: Request) -> Response:
        """Answer with the image of a tick."""
        tick = whole(request.query_params, "tick")
        found = await self._asked(request).ask(RunView.image, tick)
        if found is None or found.tick != tick:
            return refusal(404, f"no image of tick {tick} was recorded")
        return Response(found.data, media_type=f"image/{found.format}")

    # Over time ------------------------------------------------------------------------

    async def series(self, request: Request) -> Response:
        """Answer with the columns over time."""
        first, last = self._ticks(request)
        points = within(request.query_params, "points", 600, 4, api.MOST_POINTS)
        return _answer(self._asked(request).history.series(first, last, points))

    async def raster(self, request: Request) -> Response:
        """Answer what some sensors were over time."""
        query = request.query_params
        first, last = self._ticks(request)
        columns = within(query, "columns", 600, 1, MOST_COLUMNS)
        sensors = within(query, "sensors", 100, 1, MOST_SENSORS)
        sensor = whole(query, "sensor", 0)
        history = self._asked(request).history
        return _answer(history.raster(first, last, columns, sensor, sensors))

    async def marks(self, request: Request) -> Response:
        """Answer what happened over time."""
        first, last = self._ticks(request)
        bins = within(request.query_params, "bins", 600, 1, api.MOST_BINS)
        return _answer(self._asked(request).history.marks(first, last, bins))

    async def beside(self, request: Request) -> Response:
        """Answer which ticks to go to from one."""
        tick = whole(request.query_params, "tick")
        return _answer(self._asked(request).history.beside(tick))

    async def tested(self, request: Request) -> Response:
        """Answer how often the relations of an order were tested."""
        tick, session = whole(request.query_params, "tick"), self._asked(request)
        graph = await session.ask(RunView.graph, tick)
        return _answer(await asyncio.to_thread(session.history.tested, tick, graph))

    async def births(self, request: Request) -> Response:
        """Answer which sensors were grown."""
        return _answer(self._asked(request).history.grown())

    async def findings(self, request: Request) -> Response:
        """Answer which sensors were at fault, and when."""
        return _answer(self._asked(request).history.findings())

    async def depths(self, request: Request) -> Response:
        """Answer how many waves had which height and depth."""
        return _answer(self._asked(request).history.depths())

    # Two ticks ------------------------------------------------------------------------

    async def difference(self, request: Request) -> Response:
        """Answer what differs between two ticks."""
        query = request.query_params
        tick, then = (whole(query, name) for name in ("tick", "then"))
        pair = dict.fromkeys((self._asked(request), self._asked(request, "other")))
        async with self._pairs, AsyncExitStack() as stack:
            views = [await stack.enter_async_context(each.held()) for each in pair]
            found = await asyncio.to_thread(difference, views[0], tick, views[-1], then)
        return _answer(found)


def _answer(found: msgspec.Struct) -> Response:
    """Return a struct as JSON."""
    return Response(_encoder.encode(found), media_type="application/json")


def whole(query: QueryParams, name: str, default: int | None = None) -> int:
    """Return a whole number from 0 up that was asked with; else the default, if any.

    Raises:
        InvalidValueError: It is not there, or something else.
    """
    text = query.get(name)
    if text is None and default is not None:
        return default
    if text is None or not text.isascii() or not text.isdecimal():
        raise InvalidValueError(name, "must be a whole number from 0 up", text)
    if len(text) > _DIGITS:
        rule = f"must have at most {_DIGITS} digits"
        raise InvalidValueError(name, rule, f"{len(text)} of them")
    return int(text)


def within(query: QueryParams, name: str, default: int, least: int, most: int) -> int:
    """Return a whole number that was asked with, between two others.

    Raises:
        InvalidValueError: It is outside of these, or something else.
    """
    number = whole(query, name, default)
    if not least <= number <= most:
        raise InvalidValueError(name, f"must be in [{least}, {most}]", number)
    return number
