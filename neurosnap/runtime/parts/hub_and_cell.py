"""The hub process and the cell process, preloaded by the fork server."""

import asyncio
import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import msgspec

from neurosnap import wire
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.zenoh.hub import open_hub
from neurosnap.protocol.cell import Cell
from neurosnap.runtime.parts.job import PartContext, decoded, take_part

ONE_THREAD = (
    "(app: (worker_threads: 1), rx: (handover: app), tx: (handover: app),"
    " net: (handover: app), acc: (handover: app))"
)
"""Zenoh's threads of a cell. By default one hears that something came, another reads it
and wakes a third, and a fourth sends: a cell does one thing at a time. No hub may have
this: what it passes on would wait for the thread that waits."""


async def run_cell(cell: int, fabric: Fabric, stop: asyncio.Event) -> None:
    """Run the cell of sensor `cell` until `stop` is set.

    Reads `wire.cell_keys`; publishes pulses, reports and faults.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Cell(cell)

    def handle(deliveries: list[wire.Delivery]) -> None:
        messages = decoded(fabric, deliveries)
        core.waiting += len(deliveries) - len(messages)  # each was a fault
        fabric.publish(*core.receive(messages))

    await fabric.subscribe(wire.cell_keys(cell), handle, light=lambda: core.is_light)
    await fabric.announce()
    await fabric.serve(stop)


class CellJob(msgspec.Struct, frozen=True):
    """The job of one cell."""

    cell: int
    """Its sensor's number."""

    async def run(self, part: PartContext) -> None:
        """Run the cell until the end."""
        async with part.connection.fabric(swift=True) as fabric:
            await take_part(fabric, run_cell(self.cell, fabric, part.stop))


class HubJob(msgspec.Struct, frozen=True):
    """The job of the hub, the router that all parts connect to."""

    sessions: int
    """How many may connect."""
    folder: str
    """The swarm's own, which goes with the hub: a launcher that was killed cannot
    remove it."""

    async def run(self, part: PartContext) -> None:
        """Route until the end."""
        try:
            async with routing(part.connection.address, self.sessions):
                part.reporter.ready()
                await part.stop.wait()
        finally:
            shutil.rmtree(self.folder, ignore_errors=True)


@asynccontextmanager
async def routing(own: HubAddress, sessions: int) -> AsyncIterator[None]:
    """Run a hub at `own`, which has its credentials; so many sessions may connect."""
    session = await asyncio.to_thread(
        open_hub,
        [own.endpoint],
        sessions,
        credentials=own.credentials,
        insecure=own.insecure,
    )
    try:
        yield
    finally:
        await asyncio.to_thread(session.close)
