"""Compares the recordings of one server, on views of its own."""

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from typing import TypeVar

from neurosnap.apps.viewer.partings import Partings, SideBySide
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.apps.viewer.tick_difference import TickDifference, difference

T = TypeVar("T")

_PATIENCE = 0.3
"""Seconds that an answer takes while there is more to read."""
_KEPT = 4
"""Views of recordings, and pairs of them, that are kept."""


class Comparisons:
    """What is compared, one question at a time: the event loop does not wait."""

    def __init__(self) -> None:
        self._lock = asyncio.Lock()
        self._views: OrderedDict[ViewSession, tuple[RunView, RunView]] = OrderedDict()
        self._pairs: OrderedDict[tuple[RunView, RunView], SideBySide] = OrderedDict()

    async def partings(self, here: ViewSession, there: ViewSession) -> Partings:
        """Return where two recordings part, as far as that is known by now.

        Raises:
            RecordingError: One of them cannot be read.
        """
        return await self._alone(lambda: self._side_by_side(here, there))

    async def difference(
        self, here: ViewSession, tick: int, there: ViewSession, then: int
    ) -> TickDifference:
        """Return what differs between two ticks.

        Raises:
            InvalidValueError: There is no such tick.
            RecordingError: What is needed cannot be read.
        """
        return await self._alone(
            lambda: difference(self._view(here), tick, self._view(there), then)
        )

    async def _alone(self, work: Callable[[], T]) -> T:
        async with self._lock:
            return await asyncio.to_thread(work)

    def _side_by_side(self, here: ViewSession, there: ViewSession) -> Partings:
        pair = self._view(here), self._view(there)
        if pair not in self._pairs:
            self._pairs[pair] = SideBySide(*pair)
            if len(self._pairs) > _KEPT:
                self._pairs.popitem(last=False)
        self._pairs.move_to_end(pair)
        return self._pairs[pair].read_on(_PATIENCE)

    def _view(self, session: ViewSession) -> RunView:
        """Return a view of a recording: another one once that is another file."""
        shown = session.run_view
        known, own = self._views.get(session, (None, None))
        if own is None or known is not shown:
            own = RunView(shown.path, shown.scene)
            self._views[session] = (shown, own)
            if len(self._views) > _KEPT:
                self._views.popitem(last=False)
        self._views.move_to_end(session)
        own.grow()
        return own
