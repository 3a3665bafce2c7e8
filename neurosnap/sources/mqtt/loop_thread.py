"""An event loop on a thread of its own."""

import asyncio
import threading
from collections.abc import Callable, Coroutine
from functools import partial


class LoopThread:
    """Serves something on a thread, in a loop that lives as long as that takes.

    Args:
        name: The thread's.
        serve: What to run; it ends once the event it is given is set.
        fail: Is called from that thread with what `serve` fails of.
    """

    def __init__(
        self,
        name: str,
        serve: Callable[[asyncio.Event], Coroutine[None, None, None]],
        fail: Callable[[Exception], None],
    ) -> None:
        self._serve = serve
        self._fail = fail
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._lock = threading.Lock()  # around the next two
        self._stop: Callable[[], object] | None = None
        self._stopped = False

    def start(self) -> None:
        """Begin, without waiting for anything."""
        self._thread.start()

    def stop(self) -> None:
        """End, and return once it has; from any thread, without a start, also twice."""
        with self._lock:
            self._stopped = True
            if self._stop is not None:
                self._stop()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        try:
            asyncio.run(self._main())
        except Exception as error:  # noqa: BLE001 - it is passed on, whatever it is
            self._fail(error)

    async def _main(self) -> None:
        stop = asyncio.Event()
        with self._lock:
            if self._stopped:
                return
            loop = asyncio.get_running_loop()
            self._stop = partial(loop.call_soon_threadsafe, stop.set)
        try:
            await self._serve(stop)
        finally:
            with self._lock:
                self._stop = None  # the loop is about to close
