"""A cell process: connects a `Cell` to the network."""

import asyncio

import msgspec

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.cell import Cell
from neurosnap.runtime.parts.job import PartContext
from neurosnap.runtime.parts.participant import decoded, take_part


async def run_cell(cell: int, fabric: Fabric, stop: asyncio.Event) -> None:
    """Be the cell of sensor `cell` until `stop` is set.

    Reads `wire.cell_keys`; publishes pulses, reports and faults.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Cell(cell)

    def handle(deliveries: list[wire.Delivery]) -> None:
        fabric.publish(*core.receive(decoded(fabric, deliveries)))

    await fabric.subscribe(wire.cell_keys(cell), handle)
    await fabric.announce()
    await fabric.serve(stop)


class CellJob(msgspec.Struct, frozen=True):
    """One cell."""

    cell: int
    """Its sensor's number."""

    async def run(self, part: PartContext) -> None:
        """Be the cell until the end."""
        async with part.connection.fabric(swift=True) as fabric:
            await take_part(fabric, run_cell(self.cell, fabric, part.stop))
