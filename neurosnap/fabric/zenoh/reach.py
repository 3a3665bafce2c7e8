"""Connects to a hub that may not be up yet, and can be interrupted.

Zenoh's own patience cannot be cut short: its ``open`` blocks in C. So each try is a
short one, on a thread that is left alone when it is not waited for any longer.
"""

import asyncio
import atexit
import contextlib
import logging
import threading

import zenoh

from neurosnap.errors import FabricError
from neurosnap.fabric.events import wait_any, wait_at_most
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.zenoh.session import connecting

_log = logging.getLogger(__name__)

_SAID_AFTER = 2.0  # seconds
_PAUSE = 0.2  # seconds between two tries
_LAST = 5.0  # seconds that the program's end may wait for a try that was left alone
_LOOK = 1.0  # seconds that a look at whether anybody listens may take


async def reach(
    who: str,
    endpoint: str,
    stop: asyncio.Event,
    credentials: Credentials | None = None,
    patience: float = 60.0,
) -> zenoh.Session | None:
    """Return a session with a hub, as soon as that answers; None: `stop` was set.

    After two seconds it is logged, once, that the hub is waited for.

    Args:
        who: Who wants to reach it.
        endpoint: Where the hub listens.
        stop: Ends the wait at once.
        credentials: The part's, where the hub has some.
        patience: Seconds to go on trying.

    Raises:
        FabricError: The hub cannot be reached.
    """
    loop = asyncio.get_running_loop()
    began, said = loop.time(), False
    while not stop.is_set():
        attempt = _Attempt(endpoint, credentials)
        try:
            await wait_any(attempt.over, stop)
        finally:
            session = attempt.leave()
        if session is not None or stop.is_set():
            return session
        waited = loop.time() - began
        if waited > patience:
            raise FabricError(
                f"{who}: must reach the hub at {endpoint}, got {attempt.error}"
            )
        if waited > _SAID_AFTER and not said:
            said = True
            _log.warning("%s", await absence(endpoint))
        await wait_at_most(stop, _PAUSE)
    return None


class _Attempt:
    """One try, on a thread of its own."""

    def __init__(self, endpoint: str, credentials: Credentials | None) -> None:
        self.over = asyncio.Event()
        self.error: zenoh.ZError | None = None
        self._session: zenoh.Session | None = None
        self._config = connecting(endpoint, 0.0, credentials)
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
                if self._left:  # nobody waits for it any longer
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


async def absence(endpoint: str) -> str:
    """Return what to say of a hub that cannot be reached."""
    if await _listens(endpoint):
        return (
            f"waiting for the hub at {endpoint}: what listens there does not let us in;"
            " a hub's own log says why"
        )
    return (
        f"waiting for a hub at {endpoint}: start one with"
        f" `neurosnap serve hub --listen {endpoint}`"
    )


async def _listens(endpoint: str) -> bool:
    """Tell whether anybody listens there. Asked once: a hub counts it as a failure."""
    protocol, _, address = endpoint.partition("/")
    try:
        async with asyncio.timeout(_LOOK):
            if protocol == "unixsock-stream":
                _, writer = await asyncio.open_unix_connection(address)
            else:
                host, _, port = address.rpartition(":")
                _, writer = await asyncio.open_connection(host.strip("[]"), int(port))
    except (OSError, ValueError, TimeoutError):
        return False
    writer.close()
    with contextlib.suppress(OSError):
        await writer.wait_closed()
    return True
