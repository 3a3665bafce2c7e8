"""Discovery picks the current incarnation of a swarm id."""

import asyncio
from typing import Any

import pytest
import zenoh

from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.discovery import Discovery, incarnation, is_of


@pytest.mark.parametrize(("number", "name"), [(0, "a"), (1, "a-1"), (10, "a-10")])
def test_an_incarnation_is_of_its_id(number: int, name: str) -> None:
    assert incarnation("a", number) == name
    assert is_of(name, "a")


@pytest.mark.parametrize(
    "name",
    ["demo-", "demo-x", "demo2", "demo-1-1", "demos", "demos-1", "dem", "-1", ""],
)
def test_what_only_looks_like_an_incarnation_is_none(name: str) -> None:
    assert not is_of(name, "demo")


def looking() -> Discovery:
    """A lookout that is told what to see."""
    hub = HubAddress("tcp/127.0.0.1:1")
    return Discovery("demo", hub, stop=asyncio.Event(), patience=60.0)


async def test_the_last_that_came_is_returned_once() -> None:
    discovery, stop = looking(), asyncio.Event()
    discovery._receive([("other", True), ("demo", True), ("demo-1", True)])
    seen = await discovery.next(stop)
    assert seen is not None
    assert (seen.name, seen.gone.is_set()) == ("demo-1", False)
    with pytest.raises(TimeoutError):
        await discovery.next(stop, 0.01)
    discovery._receive([("demo-1", False)])
    assert seen.gone.is_set()


async def test_one_that_has_gone_again_is_not_returned() -> None:
    discovery = looking()
    discovery._receive([("demo", True), ("demo", False)])
    with pytest.raises(TimeoutError):
        await discovery.next(asyncio.Event(), 0.01)


async def test_one_that_comes_again_is_another() -> None:
    discovery, stop = looking(), asyncio.Event()
    discovery._receive([("demo", True)])
    first = await discovery.next(stop)
    waiting = asyncio.create_task(discovery.next(stop))
    await asyncio.sleep(0)
    discovery._receive([("demo", True)])  # known: a token may be told of twice
    await asyncio.sleep(0)
    assert not waiting.done()
    discovery._receive([("demo", False), ("demo", True)])
    second = await waiting
    assert first is not None
    assert second is not None
    assert (first.name, second.name) == ("demo", "demo")
    assert (first.gone.is_set(), second.gone.is_set()) == (True, False)


async def test_a_wait_ends_when_asked_to() -> None:
    discovery, stop = looking(), asyncio.Event()
    waiting = asyncio.create_task(discovery.next(stop))
    await asyncio.sleep(0)
    stop.set()
    assert await waiting is None


class Refusing:
    """A session that declares nothing."""

    def __init__(self) -> None:
        self.closed = False

    def liveliness(self) -> Any:
        raise zenoh.ZError("the session is closed")

    def close(self) -> None:
        self.closed = True


async def test_a_session_is_closed_where_nothing_can_be_looked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    session = Refusing()
    monkeypatch.setattr(zenoh, "open", lambda _: session)
    with pytest.raises(zenoh.ZError, match="the session is closed"):
        async with looking():
            pytest.fail("there is nothing to look at")
    assert session.closed
