"""A link to a broker with a thread and a loop of its own, for who has none."""

import asyncio
import threading
from collections.abc import Callable
from functools import partial

from neurosnap.outside.mqtt_link import MqttLink


class MqttThread:
    """Serves a link from a thread.

    Args:
        link: Which; nobody else may serve it.
        fail: Is called from that thread with what the link fails of, see
            `MqttLink.serve`.
    """

    def __init__(self, link: MqttLink, fail: Callable[[Exception], None]) -> None:
        self._link = link
        self._fail = fail
        self._thread = threading.Thread(target=self._run, name="mqtt", daemon=True)
        self._lock = threading.Lock()  # around the next two
        self._stop: Callable[[], object] | None = None
        self._stopped = False

    def start(self) -> None:
        """Begin to connect, without waiting for it."""
        self._thread.start()

    def stop(self) -> None:
        """Say goodbye to the broker and end; from any thread, also twice.

        Takes no longer than a connection that is being made: a broker that accepts and
        then says nothing holds it up for five seconds, and one whose machine does not
        answer for as long again.
        """
        with self._lock:
            self._stopped = True
            if self._stop is not None:
                self._stop()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:  # noqa: BLE001 - it is passed on, whatever it is
            self._fail(error)

    async def _serve(self) -> None:
        stop = asyncio.Event()
        with self._lock:
            if self._stopped:
                return
            loop = asyncio.get_running_loop()
            self._stop = partial(loop.call_soon_threadsafe, stop.set)
        try:
            await self._link.serve(stop)
        finally:
            with self._lock:
                self._stop = None  # the loop is about to close
