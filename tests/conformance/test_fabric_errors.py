"""Failures inside a fabric reach its user, and a hub refuses bad requests."""

import asyncio
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
from tests.support.fabrics import Heard, Hub, Network, Seen, ZenohNetwork, listening
from tests.support.patience import PATIENCE

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
