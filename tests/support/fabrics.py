"""Ends of swarms over memory and over Zenoh, and handlers that wait."""

import asyncio
import secrets
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass

from neurosnap import wire
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.zenoh.client import ZenohFabric
from tests.support.patience import PATIENCE


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
