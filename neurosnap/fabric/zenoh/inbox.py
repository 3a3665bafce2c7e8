"""The inbox: hands messages from Zenoh's threads to the rest of the process.

Any thread pushes and never blocks. What waits is delivered in bursts, in order, by one
thread: the event loop's (`Inbox`), or one of its own (`DeliveryThread`) where latency
counts. Waking an event loop takes two system calls and its selector, a hundred
microseconds on a small machine, and a wave pays that at every hop; waking a thread
takes a fifth of it.

Both are bounded: a push beyond the bound is an error for the owner, never a silent
loss.
"""
# MERGED DOC """A polled subscription: messages wait in Zenoh's channel until read.
#
# That costs neither a thread nor the GIL. A full channel holds back the hub, and so the
# senders: a slow reader slows the run down and loses nothing.
# """

import asyncio
import queue
import threading
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

import zenoh

from neurosnap import wire
from neurosnap.errors import InboxOverflowError
from neurosnap.fabric.events import Failure
from neurosnap.fabric.protocol import Handler

T = TypeVar("T")
T_contra = TypeVar("T_contra", contravariant=True)

_CAPACITY = 1 << 20


class Door(Protocol[T_contra]):
    """What both have in common."""

    def push(self, item: T_contra) -> None:
        """Leave `item`; any thread, never blocks, ignored when closed."""
        ...

    def close(self) -> None:
        """Ignore every later push; deliver what waits."""
        ...


class Inbox(Generic[T]):
    """A bounded queue from any thread into one loop.

    Args:
        owner: Whose inbox it is, for the error.
        deliver: Called on the loop with all that waited, oldest first.
        fail: Called on the loop, once, with what `deliver` raised or with an
            `InboxOverflowError`; the inbox is closed then.
        capacity: How many items may wait.
    """

    def __init__(
        self,
        owner: str,
        deliver: Callable[[list[T]], None],
        fail: Callable[[BaseException], None],
        capacity: int = _CAPACITY,
    ) -> None:
        self._owner = owner
        self._deliver = deliver
        self._fail = fail
        self._capacity = capacity
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._items: list[T] = []
        self._overflown = False
        self._closed = False

    def push(self, item: T) -> None:
        """Leave `item` for the loop; any thread, never blocks, ignored when closed."""
        with self._lock:
            if self._closed or self._overflown:
                return
            if len(self._items) == self._capacity:
                self._overflown = True
                return
            self._items.append(item)
            if len(self._items) == 1:
                # Under the lock: `close` cannot come between the check and the call,
                # so the loop is still running here.
                self._loop.call_soon_threadsafe(self._drain)

    def close(self) -> None:
        """Ignore every later push. What waits is still delivered by the loop."""
        with self._lock:
            self._closed = True

    def _drain(self) -> None:
        error: BaseException | None = None
        with self._lock:
            items, self._items = self._items, []
            if self._overflown:
                error = InboxOverflowError(self._owner, self._capacity)
        try:
            if items:
                self._deliver(items)
        except BaseException as raised:  # noqa: BLE001 - goes on to the owner, whole
            error = raised
        if error is not None:
            with self._lock:
                self._closed = True
                self._items.clear()  # what came meanwhile
            self._fail(error)


class DeliveryThread(Generic[T]):
    """A bounded queue with a thread of its own that delivers.

    Args:
        owner: Whose it is, for the error.
        deliver: Called on the courier's thread with all that waited, oldest first.
        fail: Called on the loop, once, with what `deliver` raised or with an
            `InboxOverflowError`; nothing more is taken in then.
        capacity: How many items may wait.
    """

    def __init__(
        self,
        owner: str,
        deliver: Callable[[list[T]], None],
        fail: Callable[[BaseException], None],
        capacity: int = _CAPACITY,
    ) -> None:
        self._owner = owner
        self._deliver = deliver
        self._fail = fail
        self._capacity = capacity
        self._loop = asyncio.get_running_loop()
        self._closed = False
        # Not `queue.Queue`: this one is a single lock in C, safe to use in a callback.
        self._items: queue.SimpleQueue[T | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"courier/{owner}")
        self._thread.start()

    def push(self, item: T) -> None:
        """Leave `item` for the thread; any thread, never blocks."""
        if self._closed:
            return
        if self._items.qsize() >= self._capacity:
            self._end(InboxOverflowError(self._owner, self._capacity))
            return
        self._items.put(item)

    def close(self) -> None:
        """Deliver what waits, then end the thread. Blocks until it has ended."""
        self._closed = True
        self._items.put(None)
        self._thread.join()

    def _end(self, error: BaseException) -> None:
        self._closed = True
        self._loop.call_soon_threadsafe(self._fail, error)

    def _run(self) -> None:
        while (first := self._items.get()) is not None:
            batch = [first]
            last = False
            # Nobody else takes items out, so what is not empty can be taken.
            while not last and not self._items.empty():
                item = self._items.get()
                if item is None:
                    last = True
                else:
                    batch.append(item)
            try:
                self._deliver(batch)
            except BaseException as error:  # noqa: BLE001 - goes on to the owner, whole
                self._end(error)
                return
            if last:
                return


_CHUNK = 4096  # deliveries handled before other tasks get their turn


class Poll:
    """Empties a channel every so often, for readers that need rate and not latency.

    Args:
        channel: Where the samples wait.
        take: Makes a delivery of a sample, or of the last of several.
        handler: Gets them, as in `Fabric.subscribe`.
        every: Seconds between two looks.
        failure: Gets what the handler raises.
    """

    def __init__(
        self,
        channel: zenoh.Handler[zenoh.Sample],
        take: Callable[[zenoh.Sample], wire.Delivery | None],
        handler: Handler,
        every: float,
        failure: Failure,
    ) -> None:
        self._channel = channel
        self._take = take
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
        found = map(self._take, samples)
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
