"""Waits for the first of several events, until a time limit or a failure."""

import asyncio
from collections.abc import Coroutine
from typing import Any


async def wait_any(*events: asyncio.Event, seconds: float | None = None) -> None:
    """Return once one of `events` is set, or some seconds have gone by."""
    if not any(event.is_set() for event in events):
        await first_of(*(event.wait() for event in events), seconds=seconds)


async def first_of(
    *several: Coroutine[Any, Any, object], seconds: float | None = None
) -> bool:
    """Wait until one of several is over; raise what it raised, return whether one is.

    It waits `seconds` at most; if None, as long as it takes. The others are cancelled;
    all are, if the caller is.
    """
    tasks = [asyncio.create_task(each) for each in several]
    try:
        done, _ = await asyncio.wait(
            tasks, timeout=seconds, return_when=asyncio.FIRST_COMPLETED
        )
        for task in done:
            task.result()
        return bool(done)
    finally:
        for task in tasks:
            task.cancel()


class Failure:
    """The first error of any handler, for tasks of the event loop that wait for it.

    Handlers run as callbacks of the loop, or on a thread that is not awaited, where an
    exception would only be logged; here it ends the part that owns the fabric.
    """

    def __init__(self) -> None:
        self._error: BaseException | None = None
        self._event = asyncio.Event()

    def set(self, error: BaseException) -> None:
        """Keep `error` unless there is one already."""
        if self._error is None:
            self._error = error
        self._event.set()

    @property
    def happened(self) -> bool:
        """Whether there is an error."""
        return self._error is not None

    async def wait(self, stop: asyncio.Event) -> None:
        """Return when `stop` is set, raise as soon as there is an error."""
        if self._error is None:
            await wait_any(stop, self._event)
        if self._error is not None:
            raise self._error
