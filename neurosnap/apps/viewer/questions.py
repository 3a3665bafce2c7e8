"""The questions that the page's server answers, one method each.

The questions are listed in `neurosnap.apps.viewer.api`. Each method is asked under its
name. No path is ever made of what a request says.
"""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AsyncExitStack

import msgspec
from starlette.datastructures import QueryParams
from starlette.requests import Request
from starlette.responses import Response, StreamingResponse

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.auth import refusal
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession, news
from neurosnap.apps.viewer.tick_difference import difference
from neurosnap.apps.viewer.time_series import MOST_COLUMNS, MOST_SENSORS
from neurosnap.errors import InvalidValueError

_FRAMES_AT_ONCE = 30
"""Frames read before another question has its turn: many are asked for in advance."""
_DIGITS = 10
"""The most digits a number may have: none of ours has more."""

Endpoint = Callable[[Request], Awaitable[Response]]

_encoder = msgspec.json.Encoder()


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
        """Return what answers each question, by its name."""
        every: tuple[Endpoint, ...] = (
            *(self.runs, self.run, self.presence, self.events),
            *(self.frames, self.graph, self.edge, self.image),
            *(self.series, self.raster, self.marks, self.beside),
            *(self.births, self.health, self.difference),
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
        """Answer whether the recording is still there."""
        session = self._asked(request)
        return _answer(api.Presence(await asyncio.to_thread(session.trouble)))

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
        session = self._asked(request)
        at_once = session.run_view.at_once(_FRAMES_AT_ONCE)
        found: list[api.Frame] = []
        for start in range(first, last + 1, at_once):
            end = min(start + at_once - 1, last)
            found += await session.ask(RunView.frames, start, end)
        return _answer(api.Frames(found))

    async def graph(self, request: Request) -> Response:
        """Answer what the learned order is after a tick."""
        tick = whole(request.query_params, "tick")
        return _answer(await self._asked(request).ask(RunView.graph, tick))

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
        """Answer where the nearest anomaly or alarm is."""
        query = request.query_params
        way = query.get("way", "")
        if way not in ("-1", "1"):
            raise InvalidValueError("way", "must be 1 or -1", way)
        tick = whole(query, "tick")
        return _answer(self._asked(request).history.beside(tick, int(way)))

    async def births(self, request: Request) -> Response:
        """Answer which sensors were grown."""
        return _answer(self._asked(request).history.grown())

    async def health(self, request: Request) -> Response:
        """Answer which sensors seem broken."""
        return _answer(self._asked(request).history.health)

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
    """Return a whole number from 0 up that was asked with.

    Args:
        query: What stands behind the question mark.
        name: What it is called there.
        default: What it is where it is not there; None if it has to be.

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
