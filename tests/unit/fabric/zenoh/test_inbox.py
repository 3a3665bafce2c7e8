"""Inboxes between threads and the loop: order, bounds, and what a failure does."""

import asyncio
import itertools
import threading
from collections.abc import Callable

import pytest

from neurosnap.errors import InboxOverflowError
from neurosnap.fabric.zenoh.inbox import Inbox
from tests.support.patience import PATIENCE

both = pytest.mark.parametrize("swift", [False, True], ids=["loop", "thread"])


class Owner:
    """What an inbox delivers to; both may be called on any thread."""

    def __init__(self, raises: Callable[[list[int]], None] = lambda _: None) -> None:
        self.bursts: list[list[int]] = []
        self.threads: set[str] = set()
        self.failures: list[BaseException] = []
        self._raises = raises
        self._loop = asyncio.get_running_loop()
        self._changed = asyncio.Event()

    def deliver(self, items: list[int]) -> None:
        self.bursts.append(items)
        self.threads.add(threading.current_thread().name)
        self._loop.call_soon_threadsafe(self._changed.set)
        self._raises(items)

    def fail(self, error: BaseException) -> None:
        self.threads.add(threading.current_thread().name)
        self.failures.append(error)
        self._changed.set()

    @property
    def items(self) -> list[int]:
        return [item for burst in self.bursts for item in burst]

    async def until(self, condition: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not condition():
                await self._changed.wait()
                self._changed.clear()


async def pushed_at_once(inbox: Inbox[int], owner: Owner) -> None:
    """Push from four threads at once; each one's items come once and in order."""

    def push(first: int) -> None:
        for item in range(first, first + 1000):
            inbox.push(item)

    before = len(owner.items)
    async with asyncio.TaskGroup() as group:
        for number in range(4):
            group.create_task(asyncio.to_thread(push, 1000 * number))
    await owner.until(lambda: len(owner.items) == before + 4000)
    inbox.close()
    for number in range(4):
        first = 1000 * number
        mine = [item for item in owner.items if first <= item < first + 1000]
        assert mine == list(range(first, first + 1000))


@both
async def test_threads_that_push_at_once_lose_nothing_and_keep_their_order(
    swift: bool,
) -> None:
    owner = Owner()
    inbox = Inbox("me", owner.deliver, owner.fail, swift=swift)
    await pushed_at_once(inbox, owner)
    assert all(owner.bursts)
    assert owner.failures == []
    here = threading.current_thread().name
    assert owner.threads == {"inbox/me" if swift else here}


async def test_an_inbox_wakes_the_loop_once_a_burst() -> None:
    owner = Owner()
    inbox = Inbox("me", owner.deliver, owner.fail)
    for item in range(100):
        inbox.push(item)
    await owner.until(lambda: len(owner.items) == 100)
    assert owner.bursts == [list(range(100))]
    inbox.push(100)
    await owner.until(lambda: len(owner.items) == 101)
    assert len(owner.bursts) == 2


@both
async def test_what_waits_when_it_is_closed_is_delivered(swift: bool) -> None:
    owner = Owner()
    inbox = Inbox("me", owner.deliver, owner.fail, swift=swift)
    for item in range(10):
        inbox.push(item)
    inbox.close()
    inbox.close()  # twice changes nothing
    inbox.push(99)
    await owner.until(lambda: len(owner.items) == 10)
    await asyncio.sleep(0)
    assert owner.items == list(range(10))


@both
async def test_an_inbox_that_is_pushed_too_much_is_an_error(swift: bool) -> None:
    go_on = threading.Event()

    def block(_: list[int]) -> None:
        assert not swift or go_on.wait(10)

    owner = Owner(block)
    inbox = Inbox("cell/3", owner.deliver, owner.fail, swift=swift)
    inbox._capacity = 3
    try:
        for item in range(1000):  # of which a thread takes some first
            inbox.push(item)
        await owner.until(lambda: bool(owner.failures))
    finally:
        go_on.set()
        await asyncio.to_thread(inbox.close)
    assert owner.items == list(range(len(owner.items)))
    assert 3 <= len(owner.items) < 1000
    (error,) = owner.failures
    assert isinstance(error, InboxOverflowError)
    assert str(error) == (
        "cell/3: inbox must be read before it holds more than 3 messages"
    )
    assert (error.owner, error.capacity) == ("cell/3", 3)


class TroubleError(Exception):
    """What a delivery raises."""


@both
async def test_what_a_delivery_raises_goes_to_the_owner_on_the_loop_and_is_the_last(
    swift: bool,
) -> None:
    def refuse(items: list[int]) -> None:
        for item in range(5):
            inbox.push(item)  # as another thread may, just then
        raise TroubleError(items[0])

    owner = Owner(refuse)
    inbox = Inbox("me", owner.deliver, owner.fail, swift=swift)
    inbox.push(7)
    await owner.until(lambda: bool(owner.failures))
    inbox.push(8)
    assert inbox._items.qsize() <= 5, "what comes later must not fill the memory"
    for _ in range(5):
        await asyncio.sleep(0)
    inbox.close()
    assert owner.items == [7]
    (error,) = owner.failures
    assert isinstance(error, TroubleError)
    assert error.args == (7,)
    assert threading.current_thread().name in owner.threads


async def test_an_inbox_that_overflows_and_fails_says_so_once() -> None:
    def refuse(_: list[int]) -> None:
        raise TroubleError

    owner = Owner(refuse)
    inbox = Inbox("me", owner.deliver, owner.fail)
    inbox._capacity = 2
    for item in range(5):
        inbox.push(item)
    await owner.until(lambda: bool(owner.failures))
    assert [type(error) for error in owner.failures] == [InboxOverflowError]


async def test_what_is_light_is_delivered_where_it_is_pushed_one_burst_at_a_time() -> (
    None
):
    busy, overlaps, may_end = threading.Lock(), list[int](), threading.Event()

    def work(items: list[int]) -> None:
        if not busy.acquire(blocking=False):
            overlaps.append(len(items))
            return
        may_end.wait(PATIENCE)
        busy.release()

    owner = Owner(work)
    asked = itertools.count()
    inbox = Inbox(
        "me", owner.deliver, owner.fail, swift=True, light=lambda: next(asked) % 3 > 0
    )
    inbox.push(-1)  # heavy
    await owner.until(lambda: owner.items == [-1])
    inbox.push(-2)  # light, while the other is at work: that one delivers it
    assert owner.items == [-1]
    may_end.set()
    await owner.until(lambda: owner.items == [-1, -2])
    assert owner.threads == {"inbox/me"}
    await pushed_at_once(inbox, owner)
    assert len(owner.threads) > 1
    assert (overlaps, owner.failures) == ([], [])


async def test_what_a_delivery_pushes_itself_comes_after_it() -> None:
    owner = Owner(lambda items: inbox.push(items[0] - 1) if items[0] else None)
    inbox = Inbox("me", owner.deliver, owner.fail, swift=True, light=lambda: True)
    inbox.push(3)
    assert owner.bursts == [[3], [2], [1], [0]]
    inbox.close()
