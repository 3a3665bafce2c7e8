"""Hands messages from Zenoh's threads to the rest of the process.

An `Inbox` is filled by any thread, which never blocks, and delivers in bursts, in
order: on the event loop, or on a thread where latency counts. Waking an event loop
takes two system calls and its selector, a hundred microseconds on a small machine, and
a wave pays that at every hop; waking a thread takes a fifth of it. Nothing is woken
where the thread that pushes may deliver. It is bounded: a push beyond the bound is an
error for the owner, never a silent loss. A `Poll` reads every so often.
"""

import asyncio
import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

import zenoh

from neurosnap import wire
from neurosnap.errors import InboxOverflowError
from neurosnap.fabric.protocol import Handler
from neurosnap.fabric.wait_for_events import Failure

T = TypeVar("T")
_CAPACITY = 1 << 20
_CHUNK = 4096  # deliveries a poll handles before other tasks get their turn


class Inbox(Generic[T]):
    """A bounded queue that any thread fills and one thread delivers.

    Args:
        owner: Whose inbox it is, for the error.
        deliver: Called with all that waited, oldest first.
        fail: Called on the loop, once, with what `deliver` raised or with an
            `InboxOverflowError`; nothing more is let in then.
        swift: Deliver on a thread of the inbox, not on the loop.
        light: Of a swift one: asked before each burst whether the thread that pushes
            delivers it, instead of the inbox's; None: never.
    """

    def __init__(
        self,
        owner: str,
        deliver: Callable[[list[T]], None],
        fail: Callable[[BaseException], None],
        *,
        swift: bool = False,
        light: Callable[[], bool] | None = None,
    ) -> None:
        self._light = light
        self._owner = owner
        self._deliver = deliver
        self._fail = fail
        self._capacity = _CAPACITY
        self._loop = asyncio.get_running_loop()
        # Not `queue.Queue`: this one is a single lock in C, safe to use in a callback.
        self._items: queue.SimpleQueue[T] = queue.SimpleQueue()
        self._wakes: queue.SimpleQueue[bool] = queue.SimpleQueue()  # of the thread
        self._turn = threading.Lock()  # who holds it delivers, and no other
        # Written by `close`, by the thread that delivers and by any that pushes too
        # much. It only ever becomes true, so a push may read it without the lock: what
        # it then still puts is an item that came while the inbox was closed.
        self._closed = False
        self._lock = threading.Lock()  # of `_woken`, and of calls to a loop that runs
        self._woken = False
        self._failed = False  # used on the loop alone
        self._broken = False  # `deliver` has raised; used by what delivers alone
        self._thread: threading.Thread | None = None
        if swift:
            self._thread = threading.Thread(target=self._run, name=f"inbox/{owner}")
            self._thread.start()

    def push(self, item: T) -> None:
        """Leave `item`; any thread, never blocks, ignored when closed."""
        if self._closed:
            return
        if self._items.qsize() >= self._capacity:
            self._overflow()
            return
        self._items.put(item)
        if self._thread is not None:
            if self._light is None or not self._light():
                self._wakes.put(True)
            else:
                self._deliver_here(self._light)
            return
        # Under the lock: `close` cannot come between the check and the call, so the
        # loop is still running here.
        with self._lock:
            if not self._woken and not self._closed:
                self._woken = True
                self._loop.call_soon_threadsafe(self._drain)

    def _overflow(self) -> None:
        error = InboxOverflowError(self._owner, self._capacity)
        with self._lock:
            if not self._closed:
                self._closed = True
                self._loop.call_soon_threadsafe(self._report, error)

    def close(self) -> None:
        """Ignore every later push. What waits is still delivered.

        Blocks until the thread has ended, where there is one; otherwise the loop
        delivers the rest.
        """
        with self._lock:
            self._closed = True
        if self._thread is not None:
            self._wakes.put(False)
            self._thread.join()

    def _drain(self) -> None:
        """Deliver what waits, on the loop."""
        with self._lock:
            self._woken = False  # first: what is put from now on wakes the loop again
        self._deliver_waiting()

    def _run(self) -> None:
        """Deliver until the inbox is closed, on its thread."""
        goes_on = True
        while goes_on and not self._broken:
            goes_on = self._wakes.get()
            # Checked again after each turn: what came meanwhile found it taken.
            while not self._items.empty():
                with self._turn:
                    self._deliver_waiting()

    def _deliver_here(self, light: Callable[[], bool]) -> None:
        """Deliver what waits on this thread, unless another is at it, which will."""
        while not self._items.empty() and self._turn.acquire(blocking=False):
            try:
                self._deliver_waiting()
            finally:
                self._turn.release()
            if not light():
                self._wakes.put(True)
                return

    def _deliver_waiting(self) -> None:
        """Deliver what waits as one burst. Only one at a time: see `_turn`."""
        batch: list[T] = []
        while not self._items.empty():
            batch.append(self._items.get())
        if batch and not self._broken:
            self._hand_over(batch)

    def _hand_over(self, batch: list[T]) -> None:
        try:
            self._deliver(batch)
        except BaseException as error:  # noqa: BLE001 - goes on to the owner, whole
            self._closed = self._broken = True
            self._loop.call_soon_threadsafe(self._report, error)

    def _report(self, error: BaseException) -> None:
        if not self._failed:
            self._failed = True
            self._fail(error)


class Poll:
    """Empties a channel at intervals, for readers that can wait but must keep up.

    Messages wait in Zenoh's channel until they are read, which costs neither a thread
    nor the GIL. A full channel holds back the hub, and so the senders: a slow reader
    slows the run down and loses nothing.

    Args:
        channel: Where the samples wait.
        read: Makes a delivery of a sample; None of a stranger's.
        handler: Gets them, as in `Fabric.subscribe`.
        every: Seconds between two looks.
        failure: Gets what the handler raises.
    """

    def __init__(
        self,
        channel: zenoh.Handler[zenoh.Sample],
        read: Callable[[zenoh.Sample], wire.Delivery | None],
        handler: Handler,
        every: float,
        failure: Failure,
    ) -> None:
        self._channel = channel
        self._read = read
        self._handler = handler
        self._every = every
        self._failure = failure
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(every, self._turn)

    def _turn(self) -> None:
        try:
            more = self._drain()
        except BaseException as error:  # noqa: BLE001 - goes on to `serve`, whole
            self._failure.set(error)
            return
        self._timer = self._loop.call_later(0.0 if more else self._every, self._turn)

    def _drain(self) -> bool:
        """Hand over up to a chunk of deliveries; tell whether more may wait."""
        samples: list[zenoh.Sample] = []
        while len(samples) < _CHUNK:
            try:
                sample = self._channel.try_recv()
            except zenoh.ZError:  # empty, and closed for good
                break
            if sample is None:
                break
            samples.append(sample)
        found = map(self._read, samples)
        batch = [delivery for delivery in found if delivery is not None]
        if batch:
            self._handler(batch)
        return len(samples) == _CHUNK

    def finish(self) -> None:
        """Hand over the rest, unless the part has failed.

        Called once nothing more can arrive.
        """
        self._timer.cancel()
        while not self._failure.happened and self._drain():
            pass
