"""Waiting for the first of several events, or for one with a time limit."""

import asyncio


async def wait_any(*events: asyncio.Event) -> None:
    """Return once one of `events` is set.

    On cancellation nothing is left behind: no task outlives the call.
    """
    if any(event.is_set() for event in events):
        return
    waits = [asyncio.create_task(event.wait(), name="wait_any") for event in events]
    try:
        await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in waits:
            task.cancel()


async def wait_at_most(event: asyncio.Event, seconds: float) -> None:
    """Return once `event` is set, or some seconds have gone by."""
    try:
        async with asyncio.timeout(seconds):
            await event.wait()
    except TimeoutError:
        pass
