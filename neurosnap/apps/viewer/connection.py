"""An HTTP connection that must send its request soon.

Any user of the machine can connect, and a connection costs a place of the few there
are. One that asks nothing is closed after some seconds; and when all places are taken,
the one that has been silent longest makes room. So nobody who only holds connections
keeps out whoever has the token.
"""

import asyncio
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle

MOST = 64
"""Connections, at most."""
SILENCE = 5.0
"""Seconds until a whole request has come: the first, and each after an answer."""


class Connection(H11Protocol):
    """One connection; see the module."""

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
