"""The web server of the page: static files, and one recording or several.

It listens on loopback alone. What may ask it anything is for
`neurosnap.apps.viewer.auth` to say; what it answers is listed here and in
`neurosnap.apps.viewer.assets`, and no path is ever made of what a request says.
"""

import asyncio
import contextlib
import secrets
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Sequence
from contextlib import asynccontextmanager

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route
from starlette.types import ASGIApp

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.address import LOOPBACK, Address
from neurosnap.apps.viewer.assets import asset
from neurosnap.apps.viewer.auth import LARGEST_HEAD, Guard
from neurosnap.apps.viewer.comparisons import Comparisons
from neurosnap.apps.viewer.connection import MOST, Connection
from neurosnap.apps.viewer.event_stream import news
from neurosnap.apps.viewer.evidence import weighed
from neurosnap.apps.viewer.json_answers import answer, refusal, whole
from neurosnap.apps.viewer.listed_runs import listed
from neurosnap.apps.viewer.members import members
from neurosnap.apps.viewer.raster import MOST_COLUMNS, MOST_SENSORS
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.errors import InvalidValueError, NeurosnapError

_FRAMES_AT_ONCE = 30
"""Frames read before another question has its turn: many are asked for in advance."""
_GRACE = 3
"""Seconds an answer may take to end once the server is to."""


def application(
    sessions: Sequence[ViewSession], address: Address, stop: asyncio.Event
) -> ASGIApp:
    """Return what answers requests.

    Args:
        sessions: The recordings, one or more.
        address: Where it is asked.
        stop: Ends what would go on for ever.
    """
    comparisons = Comparisons()

    def asked(request: Request, name: str = "run") -> ViewSession:
        """Return the recording that is asked about: the first, but for what is said."""
        number = whole(request.query_params, name, 0)
        if number >= len(sessions):
            rule = f"must be in [0, {len(sessions) - 1}]"
            raise InvalidValueError(name, rule, number)
        sessions[number].wanted.set()
        return sessions[number]

    async def runs(_: Request) -> Response:
        for session in sessions:
            await session.look()
        return answer(listed(sessions))

    async def run(request: Request) -> Response:
        return answer(await asked(request).run())

    async def frames(request: Request) -> Response:
        first = max(1, whole(request.query_params, "from"))
        last = whole(request.query_params, "to", first)
        if last - first >= api.MOST_FRAMES:
            rule = f"must be at most {api.MOST_FRAMES - 1} after from"
            raise InvalidValueError("to", rule, last)
        session = asked(request)
        at_once = session.run_view.at_once(_FRAMES_AT_ONCE)
        found: list[api.Frame] = []
        for start in range(first, last + 1, at_once):
            end = min(start + at_once - 1, last)
            found += await session.ask(RunView.frames, start, end)
        return answer(api.Frames(found))

    async def graph(request: Request) -> Response:
        tick = whole(request.query_params, "tick")
        return answer(await asked(request).ask(RunView.graph, tick))

    async def edge(request: Request) -> Response:
        query = request.query_params
        named = [whole(query, name) for name in ("source", "target", "tick")]
        return answer(await asked(request).ask(weighed, *named))

    def ticks_of(request: Request) -> tuple[int, int]:
        """Return the ticks that are asked for: all there are, but for what is said."""
        query, last = request.query_params, asked(request).run_view.last
        first = max(1, whole(query, "from", 1))
        return first, whole(query, "to", max(first, last))

    async def series(request: Request) -> Response:
        query = request.query_params
        first, last = ticks_of(request)
        points = whole(query, "points", 600)
        if not 4 <= points <= api.MOST_POINTS:
            rule = f"must be in [4, {api.MOST_POINTS}]"
            raise InvalidValueError("points", rule, points)
        column = query.get("column", "")
        return answer(asked(request).time_series.series(column, first, last, points))

    async def births(request: Request) -> Response:
        return answer(asked(request).time_series.grown())

    async def health(request: Request) -> Response:
        return answer(asked(request).health.health)

    async def marks(request: Request) -> Response:
        query = request.query_params
        first, last = ticks_of(request)
        bins = whole(query, "bins", 600)
        if not 1 <= bins <= api.MOST_BINS:
            rule = f"must be in [1, {api.MOST_BINS}]"
            raise InvalidValueError("bins", rule, bins)
        session = asked(request)
        return answer(session.marks.marks(first, last, bins, session.found()))

    async def raster(request: Request) -> Response:
        query = request.query_params
        first, last = ticks_of(request)
        columns, sensors = whole(query, "columns", 600), whole(query, "sensors", 100)
        most = (("columns", columns, MOST_COLUMNS), ("sensors", sensors, MOST_SENSORS))
        for name, given, limit in most:
            if not 1 <= given <= limit:
                raise InvalidValueError(name, f"must be in [1, {limit}]", given)
        sensor = whole(query, "sensor", 0)
        part = asked(request).raster.part(first, last, columns, sensor, sensors)
        return answer(part)

    async def beside(request: Request) -> Response:
        query = request.query_params
        way = query.get("way", "")
        if way not in ("-1", "1"):
            raise InvalidValueError("way", "must be 1 or -1", way)
        tick = whole(query, "tick")
        session = asked(request)
        return answer(session.marks.beside(tick, int(way), session.found()))

    async def cells(request: Request) -> Response:
        return answer(await asked(request).ask(members))

    async def image(request: Request) -> Response:
        tick = whole(request.query_params, "tick")
        found = await asked(request).ask(lambda view: view.images.latest(tick))
        if found is None or found.tick != tick:
            return refusal(404, f"no image of tick {tick} was recorded")
        return Response(found.data, media_type=f"image/{found.format}")

    async def events(request: Request) -> Response:
        told = news(asked(request), stop)
        return StreamingResponse(told, media_type="text/event-stream")

    async def presence(request: Request) -> Response:
        return answer(api.Presence(await asyncio.to_thread(asked(request).trouble)))

    async def partings(request: Request) -> Response:
        pair = asked(request), asked(request, "other")
        return answer(await comparisons.partings(*pair))

    async def difference(request: Request) -> Response:
        tick, then = (whole(request.query_params, name) for name in ("tick", "then"))
        here, there = asked(request), asked(request, "other")
        return answer(await comparisons.difference(here, tick, there, then))

    async def static(request: Request) -> Response:
        return asset(request.path_params["name"]) or await nowhere(request)

    async def nowhere(request: Request, _: Exception | None = None) -> Response:
        return refusal(404, "not here")

    endpoints: tuple[Endpoint, ...] = (runs, run, frames, graph, edge, series)
    endpoints += (births, health, marks, beside, cells, image, events)
    endpoints += (raster, presence, partings, difference)
    app = Starlette(
        routes=[
            *(
                Route(f"/api/{endpoint.__name__}", _refusing(endpoint))
                for endpoint in endpoints
            ),
            Route("/{name:path}", static),
        ],
        exception_handlers={404: nowhere},
    )
    return Guard(app, address.port, address.token)


Endpoint = Callable[[Request], Awaitable[Response]]


def _refusing(endpoint: Endpoint) -> Endpoint:
    """Return an endpoint that answers errors of ours by saying what is wrong."""

    async def refusing(request: Request) -> Response:
        try:
            return await endpoint(request)
        except InvalidValueError as error:
            return refusal(400, str(error))
        except NeurosnapError as error:
            return refusal(500, str(error))

    return refusing


class _Server(uvicorn.Server):
    @contextlib.contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to whoever serves: they have handlers of their own."""
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
                application(sessions, address, stop),
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
                # If whoever serves fails, the group cancels its tasks. A cancelled
                # server leaves its socket with the loop, and the next server that
                # gets the same descriptor would hear nobody.
                await asyncio.wait([served])


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
