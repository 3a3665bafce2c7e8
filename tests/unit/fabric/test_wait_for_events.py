"""Waiting for the first of several events."""

import asyncio

import pytest

from neurosnap.fabric.wait_for_events import first_of, wait_any


@pytest.mark.parametrize("which", [0, 1, 2])
async def test_any_of_them_ends_the_wait(which: int) -> None:
    events = [asyncio.Event() for _ in range(3)]
    waiting = asyncio.create_task(wait_any(*events))
    await asyncio.sleep(0)
    assert not waiting.done()
    events[which].set()
    await waiting
    assert [event.is_set() for event in events] == [n == which for n in range(3)]


async def test_a_wait_that_is_cancelled_leaves_no_task() -> None:
    before = asyncio.all_tasks()
    waiting = asyncio.create_task(wait_any(asyncio.Event(), asyncio.Event()))
    await asyncio.sleep(0)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    await asyncio.sleep(0)
    assert asyncio.all_tasks() == before


async def test_a_limit_that_is_over_is_told_from_what_a_part_raises() -> None:
    async def fails() -> None:
        raise TimeoutError("the disk")

    never = asyncio.Event()
    assert not await first_of(never.wait(), seconds=0)
    with pytest.raises(TimeoutError, match="the disk"):
        await first_of(never.wait(), fails(), seconds=100)
