"""Connections of parts on both fabrics, and message handlers that can wait."""

import asyncio
import os
import secrets
import subprocess
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

from neurosnap import wire
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
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
        await self._until(lambda: len(self.deliveries) >= count)
        return self.deliveries

    async def wait_for(self, message: wire.Message) -> list[wire.Message]:
        """Return what came once a message is among it."""
        await self._until(lambda: message in self.messages())
        return self.messages()

    async def _until(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not holds():
                await self._more.wait()
                self._more.clear()

    def messages(self) -> list[wire.Message]:
        return [wire.decode(each.key, each.payload) for each in self.deliveries]

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
from pathlib import Path
from neurosnap.fabric.certificates import read_credentials
from neurosnap.fabric.zenoh.hub import open_hub
endpoint, keys, *links = sys.argv[1:]
own = read_credentials(Path(keys), "hub") if keys else None
session = open_hub([endpoint], 30, credentials=own, links=links)
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

    def end(self, who: str, swarm: str = "linked") -> ZenohFabric:
        return ZenohFabric(who, swarm, HubAddress(self.endpoint), patience=PATIENCE)


@contextmanager
def hub_process(
    endpoint: str, *links: str, keys: Path | None = None, log: str = "off"
) -> Iterator[tuple[int, list[str]]]:
    """Run a hub in a process of its own: its id, and Zenoh's log once it has ended."""
    command = [sys.executable, "-c", BE_HUB, endpoint, str(keys or ""), *links]
    pipe, said = subprocess.PIPE, list[str]()
    env = os.environ | {"RUST_LOG": log, "NO_COLOR": "1"}
    with subprocess.Popen(
        command, stdin=pipe, stdout=pipe, stderr=pipe, text=True, env=env
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        try:
            yield process.pid, said
        finally:
            log, errors = process.communicate(timeout=PATIENCE)
            said += log.splitlines()
    assert process.returncode == 0, errors


@contextmanager
def hub_in_process(endpoint: str, *links: str) -> Iterator[Hub]:
    """A hub in a process of its own."""
    with hub_process(endpoint, *links) as (pid, _):
        yield Hub(endpoint, pid)


async def are_one_network(*ends: Callable[[str], Fabric]) -> None:
    """Return once parts on any of several hubs are heard on all others.

    Declarations of before two hubs were linked are passed on in no order: who is seen
    through a new link may not be heard yet. For each hub, `ends` returns the end of a
    part on it.
    """
    for one, other in permutations(ends, 2):
        heard = Heard()
        async with one("recorder") as recorder, other("world") as world:
            await recorder.subscribe(("**",), heard)
            async with asyncio.timeout(PATIENCE):
                while not heard.deliveries:
                    world.publish(wire.Leave("world"))
                    await recorder.confirm()


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
    """Parts on one hub; given a far one, those that only speak are there."""

    def __init__(self, hub: Hub, *, swift: bool, far: Hub | None = None) -> None:
        self._endpoint = hub.endpoint
        self._far = hub.endpoint if far is None else far.endpoint
        self._swift = swift
        self._run = secrets.token_hex(4)  # a hub may still hold an earlier test's

    def end(self, who: str, *, swarm: str = "one", first: int = 0) -> Fabric:
        # Who listens is seen by an usher, and heard by all parts on the usher's hub.
        far = who in ("sender", "a", "b", "c") or who.startswith("usher")
        return ZenohFabric(
            who,
            f"{self._run}-{swarm}",
            HubAddress(self._far if far else self._endpoint),
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
