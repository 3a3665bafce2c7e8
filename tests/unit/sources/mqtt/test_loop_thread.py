"""A loop on a thread of its own: it ends when it is told to, whenever that is."""

import asyncio
import queue
import threading

from neurosnap.sources.mqtt.loop_thread import LoopThread
from tests.support.patience import PATIENCE


def test_it_serves_until_it_is_told_to_stop() -> None:
    said: queue.Queue[str] = queue.Queue()

    async def serve(stop: asyncio.Event) -> None:
        said.put("begun")
        await stop.wait()
        said.put("over")

    thread = LoopThread("served", serve, lambda error: said.put(str(error)))
    thread.start()
    assert said.get(timeout=PATIENCE) == "begun"
    thread.stop()
    assert said.get_nowait() == "over"
    thread.stop()
    assert said.empty()


def test_who_was_stopped_before_does_not_begin() -> None:
    begun = threading.Event()

    async def serve(stop: asyncio.Event) -> None:
        begun.set()

    thread = LoopThread("served", serve, lambda _: begun.set())
    thread.stop()
    thread.start()
    thread.stop()
    assert not begun.is_set()


def test_what_it_fails_of_is_passed_on_and_it_can_be_stopped_then() -> None:
    failed: queue.Queue[Exception] = queue.Queue()

    async def serve(stop: asyncio.Event) -> None:
        raise ValueError("no such thing")

    thread = LoopThread("served", serve, failed.put)
    thread.start()
    # Its loop is closed by now: to wake it would be an error.
    assert str(failed.get(timeout=PATIENCE)) == "no such thing"
    thread.stop()
