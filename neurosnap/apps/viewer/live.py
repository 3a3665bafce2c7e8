"""Server-sent events about a growing recording: its newest frames, as differences."""

import asyncio
from collections.abc import AsyncIterator

import msgspec

from neurosnap.apps.viewer.api import Event, Frame
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.errors import RecordingError
from neurosnap.fabric.events import wait_at_most

_EVERY = 0.1
"""Seconds between two events, at least."""
_NEWEST = 10
"""Frames in one event that were not sent before, at most: a page that falls behind asks
for the others."""
_HEARTBEAT = 15.0
"""Seconds of silence, at most."""


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
        await wait_at_most(stop, _EVERY)


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
        cut = None if live and not run_view.recording.spoiled else run_view.cut
        return Event(
            ticks=run_view.last, live=live, cut=cut, reset=reset, frames=changes
        )

    def cut(self, why: str) -> Event:
        """Return that no more can be read."""
        ticks = 0 if self._run_view is None else self._run_view.last
        return Event(ticks=ticks, live=False, cut=why, reset=False, frames=[])

    def _changes(self, run_view: RunView) -> list[dict[str, object]]:
        """Return how the newest frames differ from what was sent.

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
                changes.append(difference(self._frame, frame))
            self._frame = frame
        return changes


def difference(before: Frame | None, now: Frame) -> dict[str, object]:
    """Return a frame as the difference against another of the same run; see `Event`."""
    fields = msgspec.structs.asdict(now)
    if before is None:
        whole = {name: list(enumerate(fields[name])) for name in ("bits", "state")}
        return {**fields, **whole, "after": 0}
    changed: dict[str, object] = {"tick": now.tick, "after": before.tick}
    for name, is_now in fields.items():
        was = getattr(before, name)
        if was == is_now:
            continue
        if name in ("bits", "state"):
            pairs = enumerate(zip(was, is_now, strict=True))
            changed[name] = [(k, new) for k, (old, new) in pairs if old != new]
        else:
            changed[name] = is_now
    return changed
