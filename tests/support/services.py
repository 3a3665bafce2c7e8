"""Parts of a swarm as services, each a command in its own process."""

import asyncio
import json
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from neurosnap import wire
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sources.open import open_source
from tests.support.commands import Command
from tests.support.patience import PATIENCE

if TYPE_CHECKING:
    from neurosnap.sources.protocol import Argument

PATH = "neurosnap/Path-v0"
SWARM = "demo"
SMALL = ("--set", "places=7", "--seed", 3)
ENDLESS = (*SMALL, "--ticks", 1_000_000)
CELLS = 6
going = Command
"""A verb in its own process, which does not outlive the block."""


def ended(process: Command, code: int = 0) -> str:
    """Wait for the end and return what was said, in one line."""
    out, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == code, said + out
    return " ".join((said + out).split())


@contextmanager
def hub_at(where: str, *more: object) -> Iterator[None]:
    with going("serve", "hub", "--listen", where, *more) as hub:
        assert "listening on" in hub.stderr.readline()
        yield
        hub.send_signal(signal.SIGINT)
        ended(hub)


def up(endpoint: str, *parts: str, swarm: str = SWARM) -> None:
    """Return once all of `parts` are there."""

    async def wait() -> None:
        missing, there = set(parts), asyncio.Event()

        def change(who: str, alive: bool) -> None:
            missing.difference_update({who} if alive else ())
            if not missing:
                there.set()

        async with ZenohFabric("watcher", swarm, HubAddress(endpoint)) as fabric:
            await fabric.watch(change)
            async with asyncio.timeout(PATIENCE):
                await there.wait()

    asyncio.run(wait())


def begun(endpoint: str, tick: int, swarm: str = SWARM) -> None:
    """Return once a swarm has come so far."""

    async def wait() -> None:
        far = asyncio.Event()

        def handle(burst: list[wire.Delivery]) -> None:
            for each in burst:
                state = wire.decode(each.key, each.payload)
                if isinstance(state, wire.State) and state.tick >= tick:
                    far.set()

        async with ZenohFabric("watcher", swarm, HubAddress(endpoint)) as fabric:
            await fabric.subscribe(("state",), handle)
            async with asyncio.timeout(PATIENCE):
                await far.wait()

    asyncio.run(wait())


def facts(said: str) -> dict[str, Any]:
    found = re.search(r"\{.*\}", said)
    assert found is not None, said
    told: dict[str, Any] = json.loads(found[0])
    return told


def in_one_piece(ticks: int, log: Path) -> Path:
    """Record the same run in one process."""
    arguments: dict[str, Argument] = {"places": 7}
    source = open_source(PATH, 3, arguments)
    source.close()
    options = RunOptions(
        source=PATH,
        arguments=arguments,
        body=body_of(source, "walker"),
        ticks=ticks,
        seed=3,
        cells="inline",
    )
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    return log
