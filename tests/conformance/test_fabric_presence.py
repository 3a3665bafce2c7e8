"""Every fabric tells who comes and who goes."""

import asyncio
import secrets
from collections import Counter

import pytest

from neurosnap import wire
from neurosnap.fabric.protocol import Place, PlaceHandler
from neurosnap.fabric.security.hub_address import HubAddress
from neurosnap.fabric.zenoh.client import ZenohFabric
from tests.support.fabrics import Hub, Network, Seen
from tests.support.patience import PATIENCE


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
async def test_a_part_that_is_located_says_where_it_is(hub: Hub) -> None:
    swarm, first, late = secrets.token_hex(4), Seen(), Seen()

    def end(who: str, *, located: bool = False) -> ZenohFabric:
        return ZenohFabric(who, swarm, HubAddress(hub.endpoint), located=located)

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
        await world.announce()
        told = (f"cell/1 at {Place.here()}", True), ("cell/1", True), ("world", True)
        await first.wait(*told)
        await recorder.locate(noting(late))
        await recorder.watch(late)
        await late.wait(*told)
        assert sorted(late.changes) == sorted(first.changes) == sorted(told)


@pytest.mark.zenoh
async def test_a_place_that_cannot_be_is_nobodys(hub: Hub) -> None:
    swarm, placed, seen = secrets.token_hex(4), list[tuple[str, Place]](), Seen()
    async with (
        ZenohFabric("recorder", swarm, HubAddress(hub.endpoint)) as recorder,
        ZenohFabric("cell/1", swarm, HubAddress(hub.endpoint)) as cell,
    ):
        await recorder.locate(lambda who, place: placed.append((who, place)))
        await recorder.watch(seen)
        for wrong in ("cell/1/oak/x", "cell/1", "oak/7", "cell/1/" + "o" * 65 + "/7"):
            key = f"{wire.ROOT}/{swarm}/place/{wrong}"
            cell._declared.append(cell._session.liveliness().declare_token(key))
        await cell.announce()
        await seen.wait(("cell/1", True))
        assert placed == []
