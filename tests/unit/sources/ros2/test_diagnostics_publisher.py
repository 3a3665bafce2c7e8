"""What is believed is heard as diagnostics, over a router of ROS 2."""

import asyncio
import logging
import queue
from collections.abc import Callable
from contextlib import asynccontextmanager
from functools import partial
from itertools import count
from typing import Any

import numpy as np
import pytest
import zenoh

from neurosnap import wire
from neurosnap.errors import FabricError
from neurosnap.fabric.zenoh.connect_session import configuration
from neurosnap.sensorium import pack
from neurosnap.sources.ros2.diagnostics import ARRAY, ERROR, OK, STALE, WARN
from neurosnap.sources.ros2.diagnostics_publisher import DiagnosticsPublisher
from neurosnap.sources.ros2.graph import GraphWatch, open_session
from neurosnap.sources.ros2.keys_and_tokens import (
    NO_HASH,
    SUBSCRIPTION,
    Attachment,
    Endpoint,
    GraphNode,
    gid_of,
    parse_attachment,
)
from neurosnap.sources.ros2.message_types import stock_types
from neurosnap.sources.ros2.options import Ros2Options
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

pytestmark = pytest.mark.zenoh
Connect = Callable[[], zenoh.Session]
PUBLISHER = "neurosnap.sources.ros2.diagnostics_publisher"
SENSORS = ("door", "hall", "push&door")  # the last is the agent's own
domains = count(100)  # no test hears another's


class Listener:
    """Hears diagnostics, as another program would."""

    def __init__(self, session: zenoh.Session, domain: int) -> None:
        self._changes: queue.Queue[None] = queue.Queue()
        self.watch = GraphWatch(session, domain, partial(self._changes.put, None))
        self._said: queue.Queue[zenoh.Sample] = queue.Queue()
        session.declare_subscriber(f"{domain}/diagnostics/**", self._said.put)

    async def next(self) -> tuple[Attachment, Any]:
        sample = await asyncio.to_thread(self._said.get, timeout=PATIENCE)
        assert sample.attachment is not None
        message = stock_types().deserialize_cdr(sample.payload.to_bytes(), ARRAY)
        return parse_attachment(sample.attachment.to_bytes()), message

    def there(self) -> tuple[list[str], list[Endpoint]]:
        """Return the nodes in the graph, and the publishers."""
        with self.watch.lock:
            graph = self.watch.graph
            return [node.path for node in graph.nodes], [*graph.endpoints()]

    async def change(self, until: Callable[[list[str], list[Endpoint]], bool]) -> None:
        """Wait until nodes and publishers are such."""
        while not until(*self.there()):
            await asyncio.to_thread(self._changes.get, timeout=PATIENCE)

    async def until(self, **values: str) -> list[int]:
        """Return the levels, once a first status says so."""
        while True:
            _, message = await self.next()
            first = {one.key: one.value for one in message.status[0].values}
            if first | values == first:
                return [status.level for status in message.status]


def publisher(router: str, domain: int, **more: Any) -> DiagnosticsPublisher:
    options = Ros2Options(router=router, domain=domain, sensors=("/door.data",))
    return DiagnosticsPublisher(options, SENSORS, 2, **more)


def tick(to: DiagnosticsPublisher, number: int, reads: list[int | None]) -> None:
    """Let it hear a tick at which what is read is believed."""
    row = [*reads, 1]
    bits, known = [bit == 1 for bit in row], [bit is not None for bit in row]
    literals = [each for bit in row for each in (bit == 1, bit == 0)]
    to.observation(
        wire.Observation(number, pack(np.array(bits)), known=pack(np.array(known)))
    )
    state = pack(np.array(literals))
    to.state(wire.State(number, number, state, False, 0, 0, 0, 0, 0))


@asynccontextmanager
async def serving(of: DiagnosticsPublisher) -> Any:
    stop = asyncio.Event()
    task = asyncio.create_task(of.serve(stop))
    try:
        async with asyncio.timeout(PATIENCE):
            yield task
    finally:
        stop.set()
        await task


async def test_it_is_heard_as_a_node_says_it(router: str, connect: Connect) -> None:
    domain, clock = next(domains), count(5 * 10**9 + 7)
    other = Listener(connect(), domain)
    said = publisher(router, domain, clock=lambda: next(clock))
    tick(said, 1, [1, None])
    async with serving(said):
        attachment, message = await other.next()
        nodes, (endpoint,) = other.there()
        assert nodes == [endpoint.node.path] == ["/neurosnap"]
        assert (endpoint.name, endpoint.type) == ("/diagnostics", ARRAY)
        assert (attachment.number, attachment.gid) == (1, gid_of(endpoint.token))
        stamp = message.header.stamp
        assert (stamp.sec, stamp.nanosec) == (5, 7)
        assert [one.hardware_id for one in message.status] == ["door", "hall"]
        assert [one.level for one in message.status] == [OK, STALE]
        assert [one.values[1].value for one in message.status] == ["on", "unknown"]
        attachment, message = await other.next()  # though nothing is new
        assert attachment.number == 2
        tick(said, 2, [0, 1])
        assert await other.until(reads="off", since="tick 2") == [OK, OK]


async def test_every_anomaly_is_said_however_soon_it_is_over(
    router: str, connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{PUBLISHER}._EVERY", 1e6)  # only what is new is said
    domain = next(domains)
    other, said = Listener(connect(), domain), publisher(router, domain)
    wrong = {"culprits": ["door"], "candidates": ["door", "hall"], "text": "why"}
    said.anomaly({"tick": 2, **wrong})  # before its state
    for number in (1, 2, 3, 4):
        tick(said, number, [1, number % 2])
    said.anomaly({"tick": 4, **wrong})  # behind it
    async with serving(said):
        assert await other.until(why="why") == [ERROR, WARN]
        assert await other.until(why="why") == [ERROR, WARN]
        said.anomaly(None)
        tick(said, 5, [1, 1])
        assert await other.until(why="") == [OK, OK]


async def test_it_does_not_begin_beside_a_node_of_humble(
    router: str, connect: Connect
) -> None:
    domain, other = next(domains), connect()
    token = other.liveliness().declare_token(older(domain))
    said = publisher(router, domain)
    tick(said, 1, [1, 1])
    with pytest.raises(FabricError, match="must be none of Humble"):
        await said.serve(asyncio.Event())
    listener = Listener(other, domain)
    assert not listener.there()[1]
    await listener.change(lambda nodes, _: not nodes)  # its session closed just now
    token.undeclare()
    tick(said, 2, [1, 1])
    async with serving(said):
        assert await listener.until(reads="on") == [OK, OK]


async def test_it_leaves_when_one_comes_later_and_the_run_goes_on(
    router: str, connect: Connect, caplog: pytest.LogCaptureFixture
) -> None:
    domain, session = next(domains), connect()
    other, said = Listener(session, domain), publisher(router, domain)
    tick(said, 1, [1, 1])
    async with serving(said) as task:
        await other.next()
        with caplog.at_level(logging.WARNING):
            token = session.liveliness().declare_token(older(domain))
            await other.change(lambda nodes, _: not nodes)
            token.undeclare()
        assert "/old: nothing is published any more" in caplog.messages[0]
        tick(said, 2, [0, 0])
        assert not task.done()
    assert len(caplog.messages) == 1


async def test_a_run_that_goes_on_minds_neither_humble_nor_a_router_that_is_away(
    router: str, connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    domain, session, tries = next(domains), connect(), count()
    warned: queue.Queue[str] = queue.Queue()

    def late(*given: Any) -> zenoh.Session:
        if next(tries) < 2:
            raise FabricError("away")
        return open_session(*given)

    monkeypatch.setattr(f"{PUBLISHER}.open_session", late)
    monkeypatch.setattr(
        f"{PUBLISHER}._logger.warning", lambda *a: warned.put(a[0] % a[1:])
    )
    said = publisher(router, domain)
    with pytest.raises(FabricError, match="away"):
        await said.serve(asyncio.Event())
    other = Listener(session, domain)
    said = publisher(router, domain, resumed=True)
    tick(said, 1, [1, 1])
    async with serving(said):
        assert await other.until(reads="on") == [OK, OK]
    assert warned.get_nowait() == "away; it goes on trying"
    token = session.liveliness().declare_token(older(domain))
    async with serving(publisher(router, domain, resumed=True)) as task:
        said_why = await asyncio.to_thread(warned.get, timeout=PATIENCE)
        assert "must be none of Humble" in said_why
        assert not task.done()
    token.undeclare()


async def test_to_a_router_that_comes_back_a_new_session_publishes() -> None:
    endpoint, domain = f"tcp/127.0.0.1:{free_port()}", next(domains)
    config = configuration("router", listen__endpoints=[endpoint])
    said = publisher(endpoint, domain)
    tick(said, 1, [1, 1])
    hub = zenoh.open(config)
    async with serving(said):
        with open_session(endpoint) as session:
            before, _ = await Listener(session, domain).next()
        await asyncio.to_thread(hub.close)
        hub = zenoh.open(config)
        with open_session(endpoint) as session:
            after, _ = await Listener(session, domain).next()
    assert before.gid != after.gid
    hub.close()


async def test_after_a_restart_there_is_one_node_of_the_name(
    router: str, connect: Connect
) -> None:
    domain = next(domains)
    other, tokens = Listener(connect(), domain), []
    for _ in range(2):
        said = publisher(router, domain)
        async with serving(said):
            await other.change(lambda _, publishers: bool(publishers))
            tick(said, 1, [1, 1])  # before that there is nothing to say
            attachment, message = await other.next()
            assert message.status[0].level == OK
            nodes, (endpoint,) = other.there()
            assert nodes == ["/neurosnap"]
            assert attachment.gid == gid_of(endpoint.token)
            tokens.append(endpoint.token)
        await other.change(lambda nodes, _: not nodes)
    assert tokens[0] != tokens[1]


def test_what_comes_after_its_end_is_left_out(router: str) -> None:
    said = publisher(router, next(domains))

    async def once() -> None:
        stop = asyncio.Event()
        stop.set()
        await said.serve(stop)

    asyncio.run(once())
    tick(said, 1, [1, 1])


def older(domain: int) -> str:
    node = GraphNode(domain, "ab", "0", "old")
    return Endpoint(node, "1", SUBSCRIPTION, "/x", ARRAY, NO_HASH).token
