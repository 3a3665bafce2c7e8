"""A recording that is open on the page, shared by requests and possibly still growing.

A view of the run is used by one thread at a time and may take a while to answer: others
wait meanwhile, and the event loop does not. A recording that is being written is looked
at again some times a second; where the run went on after a part had died it is another
file under the same name, and everything begins again.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar

import msgspec

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.api import Event, Frame
from neurosnap.apps.viewer.background_reading import RunHistory
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import RecordingError
from neurosnap.fabric.wait_for_events import wait_any

T = TypeVar("T")
P = ParamSpec("P")

_IDLE = 0.5
"""Seconds until a history that is up to date looks for more."""
_EVERY = 0.1
"""Seconds between two looks at a recording that grows, and two events, at least."""
_NEWEST = 10
"""Frames in one event that were not sent before, at most: a page that falls behind asks
for the others."""
_HEARTBEAT = 15.0
"""Seconds of silence, at most."""


class ViewSession:
    """An open recording: its view, and the reading of it in the background.

    Args:
        log: The recording.
        grows: Says whether it is still being written.

    Raises:
        RecordingError: It cannot be read, or is not a run's.
    """

    def __init__(self, log: Path, grows: Callable[[], bool] = lambda: False) -> None:
        self._log = log
        self._grows = grows
        self._lock = asyncio.Lock()
        self._asking = 0  # those that are in `held`
        self._quiet = asyncio.Event()  # none is
        self.later = asyncio.Lock()
        """Held by who reads much and can wait: one at a time."""
        self._looked = 0.0
        self.wanted = asyncio.Event()
        """Set once it is looked at: of several only these are read through."""
        self._renewed = asyncio.Event()
        """Another recording was opened: there is more to read after all."""
        self._open()

    def _open(self) -> None:
        # Both or none: what is read through has a view of the same file.
        run_view = RunView(self._log)
        self.history = RunHistory(RunView(self._log, run_view))
        self.run_view = run_view
        self.live = self._grows()

    async def ask(
        self,
        question: Callable[Concatenate[RunView, P], T],
        *arguments: P.args,
        **named: P.kwargs,
    ) -> T:
        """Return what `question` finds, given the view; one at a time.

        Raises:
            RecordingError: The recording is not there any more.
        """
        async with self.held() as view:
            return await asyncio.to_thread(question, view, *arguments, **named)

    @asynccontextmanager
    async def held(self, *, later: bool = False) -> AsyncIterator[RunView]:
        """Keep others from the view while the context is entered.

        Args:
            later: All that is asked meanwhile goes first. For who holds `later`.

        Raises:
            RecordingError: The recording is not there any more.
        """
        while later and self._asking:
            await self._quiet.wait()
        self._asking += 1
        self._quiet.clear()
        try:
            async with self._lock:
                # A chunk that cannot be read passes for damage: its ticks for missing.
                trouble = None if self.live else await asyncio.to_thread(self.trouble)
                if trouble is not None:
                    raise RecordingError(trouble)
                yield self.run_view
        finally:
            self._asking -= 1
            if not self._asking:
                self._quiet.set()

    def trouble(self) -> str | None:
        """Return why the recording cannot be read any more; None if it can."""
        name = self._log.name
        try:
            if not self.run_view.recording.replaced():
                return None
        except RecordingError:
            return f"{name} was deleted or moved: only what was read before is shown"
        return f"{name} was replaced by another recording: reload the page to see that"

    async def run(self) -> api.Run:
        """Return the run as it is now, with which a page begins.

        Raises:
            RecordingError: It is not there any more, or cannot be read.
        """
        before = self.run_view
        await self.look(anew=not self.live)
        if self.run_view is not before:
            self._renewed.set()
        return await self.ask(RunView.run, self.live)

    async def look(self, *, anew: bool = False) -> None:
        """Check whether the recording has grown, if it is time to.

        With `anew` in any case: where it had ended there may be another now.

        Raises:
            RecordingError: It cannot be read any more.
        """
        now = asyncio.get_running_loop().time()
        if not anew and (not self.live or now - self._looked < _EVERY):
            return
        self._looked = now
        async with self._lock:
            await asyncio.to_thread(self._look)

    def _look(self) -> None:
        # Asked first: what was written before its end is seen after.
        grows = self._grows()
        try:
            if self.run_view.recording.replaced():
                self._open()
                return
            self.run_view.grow()
        except RecordingError:
            if not grows and self.run_view.path.exists():
                raise
            # Deleted, which who asks is told; or the run that goes on has not begun to
            # write.
        self.live = grows

    async def read_on(self, stop: asyncio.Event) -> None:
        """Read on in the background once that is wanted, until `stop` is set."""
        await wait_any(self.wanted, stop)
        while not stop.is_set():
            live, more, history = self.live, False, self.history
            try:
                async with self.later, self.held(later=True):
                    history = self.history  # it may have become another
                    more = await asyncio.to_thread(history.read_on)
            except RecordingError:
                history.ended = True  # what was read until then is there
            if more:
                continue
            if live:
                await wait_any(stop, seconds=_IDLE)
            else:  # nothing more can come
                await wait_any(self._renewed, stop)
                self._renewed.clear()


async def news(session: ViewSession, stop: asyncio.Event) -> AsyncIterator[bytes]:
    """Yield server-sent events until the recording has its end, or `stop` is set.

    A recording that cannot be read any further has its end, too.
    """
    loop = asyncio.get_running_loop()
    listener = _PageListener()
    said = loop.time()
    while not stop.is_set():
        try:
            await session.look()
            event = await session.ask(listener.event, session.live)
        except RecordingError as error:
            # The answer has begun: what is wrong can only be said in it, as its last.
            event = listener.cut(str(error))
        if event is not None:
            said = loop.time()
            yield b"data: " + msgspec.json.encode(event) + b"\n\n"
            if not event.live:
                return
        elif loop.time() - said > _HEARTBEAT:
            said = loop.time()
            yield b": still here\n\n"
        await wait_any(stop, seconds=_EVERY)


class _PageListener:
    """What one page was sent last."""

    def __init__(self) -> None:
        self._run_view: RunView | None = None
        self._frame: Frame | None = None
        self._told: tuple[int, int, bool] | None = None

    def event(self, run_view: RunView, live: bool) -> Event | None:
        """Return what is new; None if nothing is."""
        reset = self._run_view is not None and run_view is not self._run_view
        if reset:
            self._frame = self._told = None
        now = (run_view.grown, run_view.last, live)
        if now == self._told:
            return None
        changes = self._changes(run_view)
        said = None if self._told is None else self._told[1:]
        self._run_view, self._told = run_view, now
        if not changes and now[1:] == said:
            return None
        cut = run_view.cut(live=live)
        return Event(
            ticks=run_view.last, live=live, cut=cut, reset=reset, frames=changes
        )

    def cut(self, why: str) -> Event:
        """Return that no more can be read."""
        ticks = 0 if self._run_view is None else self._run_view.last
        return Event(ticks=ticks, live=False, cut=why, reset=False, frames=[])

    def _changes(self, run_view: RunView) -> list[Frame]:
        """Return the newest frames that differ from what was sent.

        The last that was sent is looked at again, however far behind it is: its
        decision may have come since.
        """
        told = run_view.last if self._frame is None else self._frame.tick
        newest = max(told + 1, run_view.last - _NEWEST + 1)
        changes = []
        for frame in (
            *run_view.frames(told, told),
            *run_view.frames(newest, run_view.last),
        ):
            if frame != self._frame:
                changes.append(frame)
            self._frame = frame
        return changes
