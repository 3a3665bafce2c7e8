"""What both fabrics guarantee for messages and presence, and how their errors show."""

import asyncio
import os
import signal
import threading
import time
from collections import Counter

import psutil
import pytest

from neurosnap import wire
from neurosnap.errors import FabricError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from tests.support.fabrics import (
    Heard,
    Hub,
    Network,
    Seen,
    ZenohNetwork,
    hub_in_process,
    listening,
)
from tests.support.patience import PATIENCE
from tests.support.ports import free_port

LARGE = wire.KeyFrame(1, os.urandom(150_000))  # 200 kB of JSON
SMALL = wire.KeyFrame(1, b"")


def hold(hub: Hub) -> None:
    """Stop a hub, which is a child of this process, and wait until it stands still.

    On a busy machine its threads answer for a while after the signal was sent.
    """
    os.kill(hub.pid, signal.SIGSTOP)
    os.waitid(os.P_PID, hub.pid, os.WSTOPPED)


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
    keys = ("keyframe", "pulse/**", "leave/**")
    async with listening(network, *keys) as heard, network.end("sender") as sender:
        for message in messages:
            sender.publish(message)
        await heard.wait(len(messages))
        assert heard.sequences() == list(range(len(messages)))
        assert [d.key for d in heard.deliveries] == [m.key for m in messages]


async def test_a_key_expression_picks_its_messages(network: Network) -> None:
    async with (
        listening(network, "pulse/*/cell/1", "leave/**") as some,
        listening(network, "**", who="all") as everything,
        network.end("sender") as sender,
    ):
        for target in range(8):
            sender.publish(wire.Pulse(1, target % 4, target, 1, 0))
        sender.publish(wire.Leave("sender"))
        await everything.wait(9)
        await some.wait(5)
        assert [d.key for d in some.deliveries] == [
            "pulse/1/cell/1",
            "pulse/1/cell/1",
            "pulse/3/cell/1",
            "pulse/3/cell/1",
            "leave/sender",
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


async def test_what_is_published_after_a_listener_has_confirmed_arrives(
    network: Network,
) -> None:
    async with network.end("world") as sender:
        for turn in range(1, 11):
            heard = Heard()
            async with network.end(f"cell/{turn}") as end:
                await end.subscribe(("**",), heard)
                await end.announce()
                await end.confirm()
                sender.publish(wire.Observation(turn, b"\1"))
                (delivery,) = await heard.wait(1)
                assert delivery.sequence == turn - 1


@pytest.mark.zenoh
async def test_a_hub_that_does_not_answer_has_confirmed_nothing(hub: Hub) -> None:
    async with ZenohFabric(
        "cell/1", "silent", HubAddress(hub.endpoint), patience=1.0
    ) as end:
        await end.subscribe(("**",), lambda _: None)
        hold(hub)
        try:
            with pytest.raises(FabricError, match=r"^hub: must answer within 1 s$"):
                await end.confirm()
        finally:
            os.kill(hub.pid, signal.SIGCONT)
        await end.confirm()


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


async def test_numbers_run_from_the_first_over_all_keys_heard_or_not(
    network: Network,
) -> None:
    async with (
        listening(network, "leave/**") as heard,
        network.end("sender", first=41) as sender,
    ):
        for _ in range(3):
            sender.publish(wire.Fault("sender", ""))
            sender.publish(wire.Leave("sender"))
        await heard.wait(3)
        assert heard.sequences() == [42, 44, 46]


@pytest.mark.zenoh
async def test_a_hub_that_stalls_loses_nothing(hub: Hub) -> None:
    network = ZenohNetwork(hub, swift=False)
    count = 100  # of 200 kB: more than anything on the way can hold

    async with listening(network, "keyframe") as heard, network.end("sender") as sender:

        def publish() -> None:
            for _ in range(count):
                sender.publish(LARGE)

        hold(hub)
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


# Who comes and who goes ---------------------------------------------------------------


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


@pytest.mark.zenoh
async def test_a_second_part_of_a_name_is_told_from_the_first() -> None:
    seen = Seen()
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_in_process(where):
        hub = HubAddress(where)
        async with (
            ZenohFabric("watcher", "demo", hub) as watcher,
            ZenohFabric("world", "demo", hub, instance="a") as first,
        ):
            await watcher.watch(seen)
            await first.announce()
            await seen.wait(("world", True))
            async with ZenohFabric("world", "demo", hub, instance="b") as second:
                await second.announce()
                await seen.wait(("world/b", True))
                assert await watcher.present() == {"world"}
            await seen.wait(("world/b", False))
            assert ("world", False) not in seen.changes


@pytest.mark.zenoh
async def test_the_second_part_of_a_name_takes_the_place_of_the_first() -> None:
    seen = Seen()
    where = f"tcp/127.0.0.1:{free_port()}"
    with hub_in_process(where):
        hub = HubAddress(where)
        async with ZenohFabric("watcher", "demo", hub) as watcher:
            await watcher.watch(seen)
            async with ZenohFabric("world", "demo", hub, instance="b") as second:
                async with ZenohFabric("world", "demo", hub, instance="a") as first:
                    await first.announce()
                    await seen.wait(("world", True))
                    await second.announce()
                    await seen.wait(("world/b", True))
                await seen.wait(("world/b", False))
                assert ("world", False) not in seen.changes
            await seen.wait(("world", False))


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


# Errors -------------------------------------------------------------------------------


class TroubleError(Exception):
    """What a handler raises."""


@pytest.mark.parametrize("poll", [None, 0.001])
async def test_a_handler_that_raised_is_not_called_again_and_ends_its_part(
    network: Network, poll: float | None
) -> None:
    seen, heard, called = Seen(), Heard(), Counter[str]()

    def handler(burst: list[wire.Delivery]) -> None:
        called["handler"] += 1
        raise TroubleError(burst[0].key)

    async with network.end("sender") as sender, network.end("witness") as witness:
        await sender.watch(seen)
        await witness.subscribe(("leave/**",), heard)
        await witness.announce()
        with pytest.raises(TroubleError, match=r"^leave/sender$"):
            async with network.end("listener") as end, asyncio.timeout(PATIENCE):
                await end.subscribe(("leave/**",), handler, poll=poll)
                await end.announce()
                await seen.wait(("listener", True), ("witness", True))
                sender.publish(wire.Leave("sender"))
                with pytest.raises(TroubleError, match=r"^leave/sender$"):
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
    fabric = ZenohFabric("cell/3", "one", HubAddress(endpoint), patience=0.3)
    began = time.monotonic()
    expected = rf"^cell/3: must reach the hub at {endpoint}, got "
    with pytest.raises(FabricError, match=expected) as caught:
        async with fabric:
            pass
    assert ".rs:" not in str(caught.value)  # no place in Zenoh's own code
    assert time.monotonic() - began < PATIENCE / 2  # and not for ever


@pytest.mark.zenoh
async def test_a_hub_that_comes_late_is_waited_for(endpoint: str) -> None:
    fabric = ZenohFabric("cell/3", "one", HubAddress(endpoint), patience=PATIENCE)
    entering = asyncio.create_task(fabric.__aenter__())
    await asyncio.sleep(0)
    session = await asyncio.to_thread(open_hub, [endpoint], 3)
    try:
        await entering
        await fabric.__aexit__(None, None, None)
    finally:
        await asyncio.to_thread(session.close)


@pytest.mark.zenoh
def test_a_place_where_none_can_listen_is_an_error(hub: Hub) -> None:
    for endpoint in (hub.endpoint, "unixsock-stream//nowhere/at/all/hub"):
        rule = rf"^hub: must be able to listen on {endpoint}, got "
        with pytest.raises(FabricError, match=rule) as caught:
            open_hub([endpoint], sessions=3)
        assert ".rs:" not in str(caught.value)


@pytest.mark.zenoh
async def test_a_session_leaves_no_thread_of_ours(hub: Hub) -> None:
    before = set(threading.enumerate())
    async with listening(ZenohNetwork(hub, swift=True), "leave/**"):
        during = {thread.name for thread in set(threading.enumerate()) - before}
    assert "inbox/listener" in during
    after = {thread.name for thread in set(threading.enumerate()) - before}
    assert not {name for name in after if name.startswith("inbox")}
