"""Waiting for the first of several things."""

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
