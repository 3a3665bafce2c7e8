"""Configures and opens Zenoh sessions, with a hub that may not be up yet.

No session uses multicast, and every message is bounded. Zenoh's own patience cannot be
cut short: its ``open`` blocks in C. So each try is a short one, on a thread that is
left alone when it is not waited for any longer.
"""

import asyncio
import atexit
import contextlib
import json
import logging
import re
import threading
from collections.abc import Callable
from typing import Any

import zenoh

from neurosnap.errors import FabricError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.wire import LARGEST_PAYLOAD

LARGEST = LARGEST_PAYLOAD + (1 << 16)
"""Bytes of a message with its key, at most. What is larger is dropped before it is put
together: no part can fill another's memory."""
_BOUNDED = {"transport/link/rx/max_message_size": LARGEST}
# A stalled part must not get its link closed and lose what waits: microseconds.
_UNHURRIED = {
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 60_000_000
}
RETRY = {"period_init_ms": 50, "period_max_ms": 200, "period_increase_factor": 1.5}
"""How soon a session connects again that lost its hub."""
_log = logging.getLogger(__name__)
_SAID_AFTER = 2.0  # seconds
_SOURCE = re.compile(r"\s+at /\S+\.rs:\d+")
_PAUSE = 0.2  # seconds between two tries
_LAST = 5.0  # seconds that the program's end may wait for a try that was left alone


def configuration(mode: str, **more: object) -> zenoh.Config:
    """Return Zenoh's configuration of a session that neither listens nor searches.

    Args:
        mode: ``client`` or ``router``.
        more: More of Zenoh's keys, ``__`` for ``/``; values as JSON can say them.
    """
    config = zenoh.Config()
    own = {
        "mode": mode,
        "listen/endpoints": [],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "scouting/delay": 0,
        # On, some 350 sessions at most connect to one router.
        "transport/shared_memory/enabled": False,
    }
    named = {key.replace("__", "/"): value for key, value in more.items()}
    for key, value in (own | _BOUNDED | _UNHURRIED | named).items():
        config.insert_json5(key, json.dumps(value))
    return config


def connecting(hub: HubAddress, patience: float) -> zenoh.Config:
    """Return the configuration of a session that tries to connect for some seconds."""
    guard: dict[str, object] = {}
    if hub.credentials is not None:
        guard["transport__link__tls"] = hub.credentials.to_connect()
    return configuration(
        "client",
        connect__endpoints=[hub.endpoint],
        connect__timeout_ms=int(patience * 1000),
        connect__retry=RETRY,
        # A megabyte, taken as it is needed: what a cell sends while it receives.
        transport__link__tx__queue__size__data=16,
        **guard,
    )


async def reach(
    who: str,
    hub: HubAddress,
    stop: asyncio.Event,
    patience: float = 60.0,
) -> zenoh.Session | None:
    """Return a session with a hub, as soon as that answers; None if `stop` was set.

    It goes on trying for `patience` seconds. After two it is logged, once, that the hub
    is waited for.

    Raises:
        FabricError: The hub cannot be reached.
    """
    loop = asyncio.get_running_loop()
    began, said = loop.time(), False
    while not stop.is_set():
        attempt = _Attempt(hub)
        try:
            await wait_any(attempt.over, stop)
        finally:
            session = attempt.leave()
        if session is not None or stop.is_set():
            return session
        waited = loop.time() - began
        if waited > patience:
            got = reason_of(attempt.error)
            raise FabricError(f"{who}: must reach the hub at {hub.endpoint}, got {got}")
        if waited > _SAID_AFTER and not said:
            said = True
            _log.warning("%s", absence(hub.endpoint))
        await wait_any(stop, seconds=_PAUSE)
    return None


class _Attempt:
    """One try, on another thread."""

    def __init__(self, hub: HubAddress) -> None:
        self.over = asyncio.Event()
        self.error: zenoh.ZError | None = None
        self._session: zenoh.Session | None = None
        self._config = connecting(hub, 0.0)
        self._loop = asyncio.get_running_loop()
        self._left = False
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._open, name="reach", daemon=True)
        self._thread.start()

    def _open(self) -> None:
        try:
            session = zenoh.open(self._config)
        except zenoh.ZError as error:
            self.error = error
        else:
            with self._lock:
                self._session = session
                if self._left:  # it is not waited for any longer
                    session.close()
        with contextlib.suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self.over.set)

    def leave(self) -> zenoh.Session | None:
        """Return the session if there is one; one that comes later is closed."""
        if self._thread.is_alive():
            # Python kills a thread that comes back from C once the interpreter ends,
            # and that aborts the program.
            atexit.register(self._thread.join, _LAST)
        with self._lock:
            self._left = True
            return self._session


def when_lost(session: zenoh.Session, then: Callable[[], object]) -> Callable[[], None]:
    """Call `then` when the router of a client's session goes; return what ends that.

    It is called on a thread of Zenoh's, once or more often. Open another session then:
    one that connects again by itself may be deaf. The router knows that it is there,
    sends it nothing and answers nothing (one time in some 20 to 200 with Zenoh 1.10).
    """

    def on_event(event: zenoh.TransportEvent) -> None:
        if event.kind == zenoh.SampleKind.DELETE:
            then()

    listener: Any = session.info.declare_transport_events_listener(
        zenoh.handlers.Callback(on_event, indirect=False)
    )
    if not any(session.info.routers_zid()):  # it went before anything listened
        then()
    end: Callable[[], None] = listener.undeclare
    return end


def reason_of(error: object) -> str:
    """Return what an error of Zenoh says, without places in Zenoh's own code."""
    return _SOURCE.sub("", str(error))


def absence(endpoint: str) -> str:
    """Return the error text for a hub that cannot be reached."""
    return (
        f"waiting for a hub at {endpoint}: start one with"
        f" `neurosnap serve hub --listen {endpoint}`; if one is there, its log says"
        " whom it refuses"
    )
