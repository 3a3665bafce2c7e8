"""What every fabric promises, over memory and over Zenoh."""

import asyncio
import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.fabric.location import Place
from neurosnap.fabric.protocol import Fabric, PlaceHandler
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.fabric.zenoh.hub import open_hub
from tests.support.patience import PATIENCE

LARGE = wire.KeyFrame(1, os.urandom(150_000))  # 200 kB of JSON
SMALL = wire.KeyFrame(1, b"")


class Heard:
    """A handler that keeps what it is given; it may be called on any thread."""

    def __init__(self) -> None:
        self.deliveries: list[wire.Delivery] = []
        self._loop = asyncio.get_running_loop()
        self._more = asyncio.Event()

    def __call__(self, burst: list[wire.Delivery]) -> None:
        self.deliveries += burst
        self._loop.call_soon_threadsafe(self._more.set)

    async def wait(self, count: int) -> list[wire.Delivery]:
        """Return what came once there are at least `count`."""
        async with asyncio.timeout(PATIENCE):
            while len(self.deliveries) < count:
                await self._more.wait()
                self._more.clear()
        return self.deliveries

    def sequences(self) -> list[int]:
        return [delivery.sequence for delivery in self.deliveries]


class Seen:
    """A handler of presence that waits for changes."""

    def __init__(self) -> None:
        self.changes: list[tuple[str, bool]] = []
        self._more = asyncio.Event()

    def __call__(self, who: str, alive: bool) -> None:
        self.changes.append((who, alive))
        self._more.set()

    async def wait(self, *changes: tuple[str, bool]) -> None:
        """Return once each of `changes` has come."""
        async with asyncio.timeout(PATIENCE):
            while not set(changes) <= set(self.changes):
                await self._more.wait()
                self._more.clear()


BE_HUB = """
import sys
from neurosnap.fabric.zenoh.hub import open_hub
session = open_hub([sys.argv[1]], sessions=20)
print("ready", flush=True)
sys.stdin.read()
session.close()
"""


@dataclass(frozen=True)
class Hub:
    """A hub in a process of its own, as in a run.

    All sessions of one process share two receiving threads: a hub that waits there for
    one of its neighbours to take a message would wait for itself.
    """

    endpoint: str
    pid: int


class Network:
    """Makes the ends of swarms that share one hub."""

    def end(self, who: str, *, swarm: str = "one", first: int = 0) -> Fabric:
        raise NotImplementedError


class MemoryNetwork(Network):
    def __init__(self) -> None:
        self._hubs: dict[str, MemoryHub] = {}

    def end(self, who: str, *, swarm: str = "one", first: int = 0) -> Fabric:
        hub = self._hubs.setdefault(swarm, MemoryHub())
        return hub.fabric(who, first=first)


class ZenohNetwork(Network):
    def __init__(self, hub: Hub, *, swift: bool) -> None:
        self._endpoint = hub.endpoint
        self._swift = swift
        self._run = secrets.token_hex(4)  # a hub may still hold an earlier test's

    def end(self, who: str, *, swarm: str = "one", first: int = 0) -> Fabric:
        return ZenohFabric(
            who,
            f"{self._run}-{swarm}",
            self._endpoint,
            first=first,
            patience=PATIENCE,
            swift=self._swift,
        )


@pytest.fixture
def endpoint(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return where a hub can listen; a socket's path must be short."""
    return f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"


@pytest.fixture(scope="module")
def hub(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hub]:
    endpoint = f"unixsock-stream/{tmp_path_factory.mktemp('n')}/hub"
    command = [sys.executable, "-c", BE_HUB, endpoint]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield Hub(endpoint, process.pid)
        process.communicate()
    assert process.returncode == 0


@pytest.fixture(
    params=[
        "memory",
        pytest.param("zenoh", marks=pytest.mark.zenoh),
        pytest.param("zenoh-swift", marks=pytest.mark.zenoh),
    ]
)
def network(request: pytest.FixtureRequest) -> Network:
    if request.param == "memory":
        return MemoryNetwork()
    return ZenohNetwork(
        request.getfixturevalue("hub"), swift=request.param == "zenoh-swift"
    )


@asynccontextmanager
async def listening(
    network: Network,
    *keys: str,
    who: str = "listener",
    swarm: str = "one",
    poll: float | None = None,
) -> AsyncIterator[Heard]:
    """Be a part that hears `keys`, once every sender can reach it."""
    heard, seen = Heard(), Seen()
    async with (
        network.end(who, swarm=swarm) as end,
        network.end(f"usher of {who}", swarm=swarm) as usher,
    ):
        await usher.watch(seen)
        await end.subscribe(keys, heard, poll=poll)
        await end.announce()
        await seen.wait((who, True))
        yield heard


# Messages -----------------------------------------------------------------------------


async def test_a_message_arrives_as_it_was_sent(network: Network) -> None:
    message = wire.Fault("sender", "nothing")
    async with listening(network, "fault/**") as heard, network.end("sender") as sender:
        before = time.time_ns()
        sender.publish(message)
        (delivery,) = await heard.wait(1)
        assert delivery[:2] == ("fault/sender", 0)
        assert before <= delivery.sent <= time.time_ns()
        assert delivery.payload == wire.encode(message)


async def test_one_senders_messages_keep_their_order_whatever_their_key_and_size(
    network: Network,
) -> None:
    messages = [
        message
        for number in range(60)
        for message in (
            LARGE if number % 3 == 0 else SMALL,
            wire.Pulse(1, 0, 2 * (number % 5) + number % 2, 1, 0),
            wire.Leave("sender"),
        )
    ]
    keys = ("keyframe", "excite/**", "inhibit/**", "leave/**")
    async with listening(network, *keys) as heard, network.end("sender") as sender:
        for message in messages:
            sender.publish(message)
        await heard.wait(len(messages))
        assert heard.sequences() == list(range(len(messages)))
        assert [d.key for d in heard.deliveries] == [m.key for m in messages]


async def test_a_key_expression_picks_its_messages(network: Network) -> None:
    async with (
        listening(network, "excite/1/**", "inhibit/**") as some,
        listening(network, "**", who="all") as everything,
        network.end("sender") as sender,
    ):
        for target in range(8):
            sender.publish(wire.Pulse(1, 0, target, 1, 0))
        sender.publish(wire.Leave("sender"))
        await everything.wait(9)
        await some.wait(5)
        assert [d.key for d in some.deliveries] == [
            "inhibit/0/cell/0",
            "excite/1/cell/0",
            "inhibit/1/cell/0",
            "inhibit/2/cell/0",
            "inhibit/3/cell/0",
        ]


@pytest.mark.parametrize("poll", [None, 0.01])
async def test_a_listener_to_everything_gets_everything_exactly_once(
    network: Network, poll: float | None
) -> None:
    each = 500
    async with (
        listening(network, "**", poll=poll) as heard,
        network.end("a") as a,
        network.end("b") as b,
        network.end("c") as c,
    ):
        for number in range(each):
            for end in (a, b, c):
                end.publish(wire.Fault(end.who, "x" * (number % 100)))
        await heard.wait(3 * each)
        numbers: dict[str, list[int]] = {}
        for delivery in heard.deliveries:
            message = wire.decode(delivery.key, delivery.payload)
            numbers.setdefault(message.sender, []).append(delivery.sequence)
        assert numbers == {who: list(range(each)) for who in ("a", "b", "c")}


async def test_what_was_sent_before_leaving_arrives(network: Network) -> None:
    async with listening(network, "**", poll=0.01) as heard:
        async with network.end("sender") as sender:
            for _ in range(1000):
                sender.publish(wire.Leave("sender"))
            sender.publish(LARGE)
        await heard.wait(1001)
        assert heard.sequences() == list(range(1001))


async def test_own_messages_reach_own_subscriptions(network: Network) -> None:
    heard, seen = Heard(), Seen()
    async with network.end("both") as end:
        await end.subscribe(("leave/**",), heard)
        await end.watch(seen)
        await end.announce()
        await seen.wait(("both", True))
        end.publish(wire.Leave("both"))
        end.publish(wire.Leave("both"))
        await heard.wait(2)
        assert heard.sequences() == [0, 1]


async def test_messages_are_numbered_from_the_first(network: Network) -> None:
    async with (
        listening(network, "leave/**") as heard,
        network.end("sender", first=41) as sender,
    ):
        assert sender.sent == 41
        for _ in range(3):
            sender.publish(wire.Leave("sender"))
        assert sender.sent == 44
        await heard.wait(3)
        assert heard.sequences() == [41, 42, 43]


async def test_numbers_run_over_all_keys_heard_or_not(network: Network) -> None:
    async with listening(network, "leave/**") as heard, network.end("sender") as sender:
        for _ in range(3):
            sender.publish(wire.Fault("sender", ""))
            sender.publish(wire.Leave("sender"))
        await heard.wait(3)
        assert heard.sequences() == [1, 3, 5]


@pytest.mark.zenoh
async def test_a_hub_that_stalls_loses_nothing(hub: Hub) -> None:
    network = ZenohNetwork(hub, swift=False)
    count = 100  # of 200 kB: more than anything on the way can hold

    async with listening(network, "keyframe") as heard, network.end("sender") as sender:

        def publish() -> None:
            for _ in range(count):
                sender.publish(LARGE)

        os.kill(hub.pid, signal.SIGSTOP)
        loop = asyncio.get_running_loop()
        loop.call_later(0.2, os.kill, hub.pid, signal.SIGCONT)
        await asyncio.to_thread(publish)
        await heard.wait(count)
        assert heard.sequences() == list(range(count))


@pytest.mark.zenoh
async def test_threads_may_publish_at_once_and_every_number_is_used_once(
    hub: Hub,
) -> None:
    network = ZenohNetwork(hub, swift=True)
    async with listening(network, "leave/**") as heard, network.end("sender") as sender:

        def publish() -> None:
            for _ in range(500):
                sender.publish(wire.Leave("sender"))

        async with asyncio.TaskGroup() as group:
            for _ in range(4):
                group.create_task(asyncio.to_thread(publish))
        await heard.wait(2000)
        assert heard.sequences() == list(range(2000))


async def test_two_swarms_on_one_hub_do_not_hear_each_other(network: Network) -> None:
    seen = Seen()
    async with (
        listening(network, "**", swarm="one") as one,
        listening(network, "**", swarm="two") as two,
        network.end("sender", swarm="one") as first,
        network.end("sender", swarm="two") as second,
    ):
        await first.watch(seen)
        await second.announce()
        await first.announce()
        for _ in range(50):
            first.publish(wire.Fault("sender", "one"))
            second.publish(wire.Fault("sender", "two"))
        await one.wait(50)
        await two.wait(50)
        await seen.wait(("sender", True))
        for heard, what in ((one, b"one"), (two, b"two")):
            assert len(heard.deliveries) == 50
            assert all(what in delivery.payload for delivery in heard.deliveries)
        assert seen.changes.count(("sender", True)) == 1


async def test_nothing_is_received_after_leaving(network: Network) -> None:
    async with (
        listening(network, "leave/**", who="stays") as stays,
        network.end("sender") as sender,
    ):
        async with listening(network, "leave/**", who="goes") as goes:
            sender.publish(wire.Leave("sender"))
            await goes.wait(1)
        for _ in range(20):
            sender.publish(wire.Leave("sender"))
        await stays.wait(21)
        assert goes.sequences() == [0]


# Presence -----------------------------------------------------------------------------


async def test_a_watcher_is_told_who_comes_and_who_goes(network: Network) -> None:
    seen = Seen()
    async with network.end("watcher") as watcher:
        await watcher.watch(seen)
        async with network.end("cell/1") as part:
            await part.announce()
            await seen.wait(("cell/1", True))
        await seen.wait(("cell/1", False))
        assert seen.changes == [("cell/1", True), ("cell/1", False)]


async def test_a_late_watcher_is_told_who_is_there(network: Network) -> None:
    first, late = Seen(), Seen()
    async with (
        network.end("watcher") as watcher,
        network.end("world") as world,
        network.end("cell/1") as cell,
        network.end("silent"),
    ):
        await watcher.watch(first)
        await world.announce()
        await cell.announce()
        await first.wait(("world", True), ("cell/1", True))
        async with network.end("gone") as gone:
            await gone.announce()
            await first.wait(("gone", True))
        await first.wait(("gone", False))
        await watcher.watch(late)
        await late.wait(("world", True), ("cell/1", True))
        assert Counter(late.changes) == {("world", True): 1, ("cell/1", True): 1}


async def test_a_part_that_returns_is_seen_again(network: Network) -> None:
    seen = Seen()
    async with network.end("watcher") as watcher:
        await watcher.watch(seen)
        for turn in (1, 2):
            async with network.end("world") as world:
                await world.announce()
                await seen.wait(("world", True))
            async with asyncio.timeout(PATIENCE):
                while len(seen.changes) < 2 * turn:
                    await seen._more.wait()
                    seen._more.clear()
        assert seen.changes == [("world", True), ("world", False)] * 2


@pytest.mark.zenoh
async def test_a_part_that_is_located_is_placed_before_it_is_there(hub: Hub) -> None:
    swarm, first, late = secrets.token_hex(4), Seen(), Seen()

    def end(who: str, *, located: bool = False) -> ZenohFabric:
        return ZenohFabric(who, swarm, hub.endpoint, located=located)

    def noting(seen: Seen) -> PlaceHandler:
        return lambda who, place: seen(f"{who} at {place}", True)

    async with (
        end("recorder") as recorder,
        end("cell/1", located=True) as cell,
        end("world") as world,
    ):
        await recorder.locate(noting(first))
        await recorder.watch(first)
        await cell.announce()
        await first.wait(("cell/1", True))
        await world.announce()
        await first.wait(("world", True))
        placed = f"cell/1 at {Place.here()}"
        assert first.changes == [(placed, True), ("cell/1", True), ("world", True)]
        await recorder.locate(noting(late))
        await recorder.watch(late)
        await late.wait(("world", True), ("cell/1", True))
        assert late.changes[0] == (placed, True)
        assert sorted(late.changes) == sorted(first.changes)


@pytest.mark.zenoh
async def test_a_place_that_cannot_be_is_nobodys(hub: Hub) -> None:
    swarm, placed, seen = secrets.token_hex(4), list[tuple[str, Place]](), Seen()
    async with (
        ZenohFabric("recorder", swarm, hub.endpoint) as recorder,
        ZenohFabric("cell/1", swarm, hub.endpoint) as cell,
    ):
        await recorder.locate(lambda who, place: placed.append((who, place)))
        await recorder.watch(seen)
        for wrong in ("cell/1/oak/x", "cell/1", "oak/7", "cell/1/" + "o" * 65 + "/7"):
            key = f"{wire.ROOT}/{swarm}/place/{wrong}"
            cell._declared.append(cell._session.liveliness().declare_token(key))
        await cell.announce()
        await seen.wait(("cell/1", True))
        assert placed == []


# Errors -------------------------------------------------------------------------------


class TroubleError(Exception):
    """What a handler raises."""


@pytest.mark.parametrize("poll", [None, 0.01])
async def test_what_a_handler_raises_comes_out_of_serve(
    network: Network, poll: float | None
) -> None:
    seen = Seen()

    def handler(burst: list[wire.Delivery]) -> None:
        raise TroubleError(burst[0].key)

    async with network.end("sender") as sender:
        await sender.watch(seen)
        with pytest.raises(TroubleError, match=r"^leave/sender$"):
            async with network.end("listener") as end:
                await end.subscribe(("leave/**",), handler, poll=poll)
                await end.announce()
                await seen.wait(("listener", True))
                sender.publish(wire.Leave("sender"))
                async with asyncio.timeout(PATIENCE):
                    await end.serve(asyncio.Event())
        await seen.wait(("listener", False))


@pytest.mark.zenoh
async def test_a_handler_that_raised_is_not_called_again_and_the_session_closes(
    hub: Hub,
) -> None:
    network = ZenohNetwork(hub, swift=False)
    seen, called = Seen(), Counter[str]()

    def handler(burst: list[wire.Delivery]) -> None:
        called["handler"] += 1
        raise TroubleError(f"call {called['handler']}")

    async with network.end("sender") as sender, network.end("witness") as witness:
        heard = Heard()
        await sender.watch(seen)
        await witness.subscribe(("leave/**",), heard)
        await witness.announce()
        with pytest.raises(TroubleError, match=r"^call 1$"):
            async with network.end("listener") as end:
                await end.subscribe(("leave/**",), handler, poll=0.001)
                await end.announce()
                await seen.wait(("listener", True), ("witness", True))
                sender.publish(wire.Leave("sender"))
                with pytest.raises(TroubleError, match=r"^call 1$"):
                    await end.serve(asyncio.Event())
                for _ in range(10):
                    sender.publish(wire.Leave("sender"))
                await heard.wait(11)
                await end.serve(asyncio.Event())
        await seen.wait(("listener", False))
        assert called["handler"] == 1


async def test_serve_ends_when_it_is_asked_to(network: Network) -> None:
    stop = asyncio.Event()
    async with network.end("part") as end, asyncio.timeout(PATIENCE):
        serving = asyncio.create_task(end.serve(stop))
        await asyncio.sleep(0)
        assert not serving.done()
        stop.set()
        await serving


async def test_what_fails_a_part_comes_out_of_serve_once_first(
    network: Network,
) -> None:
    async with network.end("part") as end, asyncio.timeout(PATIENCE):
        end.fail(TroubleError("first"))
        end.fail(TroubleError("second"))
        with pytest.raises(TroubleError, match=r"^first$"):
            await end.serve(asyncio.Event())


async def test_only_one_key_can_be_polled(network: Network) -> None:
    async with network.end("part") as end:
        with pytest.raises(InvalidValueError, match=r"^keys: must be one where it is"):
            await end.subscribe(("state", "decide"), Heard(), poll=0.01)


# The hub ------------------------------------------------------------------------------


@pytest.mark.zenoh
async def test_nothing_listens_on_tcp_or_udp(hub: Hub) -> None:
    async with ZenohNetwork(hub, swift=False).end("part") as end:
        await end.announce()
        for process in (psutil.Process(hub.pid), psutil.Process()):
            assert process.net_connections("inet") == []
        sockets = {c.laddr for c in psutil.Process(hub.pid).net_connections("unix")}
        assert hub.endpoint.removeprefix("unixsock-stream/") in sockets


@pytest.mark.zenoh
async def test_a_hub_that_cannot_be_reached_is_an_error_in_time(endpoint: str) -> None:
    fabric = ZenohFabric("cell/3", "one", endpoint, patience=0.3)
    began = time.monotonic()
    expected = rf"^cell/3: must reach the hub at {endpoint}, got "
    with pytest.raises(FabricError, match=expected):
        async with fabric:
            pass
    assert time.monotonic() - began < PATIENCE / 2  # and not for ever


@pytest.mark.zenoh
async def test_a_hub_that_comes_late_is_waited_for(endpoint: str) -> None:
    fabric = ZenohFabric("cell/3", "one", endpoint, patience=PATIENCE)
    entering = asyncio.create_task(fabric.__aenter__())
    await asyncio.sleep(0)
    session = await asyncio.to_thread(open_hub, [endpoint], 3)
    try:
        await entering
        await fabric.__aexit__(None, None, None)
    finally:
        await asyncio.to_thread(session.close)


@pytest.mark.zenoh
def test_an_endpoint_in_use_is_an_error(hub: Hub) -> None:
    with pytest.raises(
        FabricError, match=rf"^hub: must be able to listen on {hub.endpoint}, got "
    ):
        open_hub([hub.endpoint], sessions=3)


@pytest.mark.zenoh
def test_a_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FabricError, match=r"^hub: must be able to listen on unixsock"):
        open_hub(["unixsock-stream//nowhere/at/all/hub"], sessions=3)


@pytest.mark.zenoh
async def test_a_session_leaves_no_thread_of_ours(hub: Hub) -> None:
    before = set(threading.enumerate())
    async with listening(ZenohNetwork(hub, swift=True), "leave/**"):
        during = {thread.name for thread in set(threading.enumerate()) - before}
    assert "courier/listener" in during
    after = {thread.name for thread in set(threading.enumerate()) - before}
    assert not {name for name in after if name.startswith("courier")}
