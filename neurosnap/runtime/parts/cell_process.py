"""A cell process: connects a `Cell` to the network."""

import asyncio

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.cell import Cell
from neurosnap.runtime.parts.child_process import Reporter, Seat
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


async def be_cell(
    seat: Seat, stop: asyncio.Event, reporter: Reporter, cell: int
) -> None:
    """Be one cell."""
    async with seat.fabric(swift=True) as fabric:
        await take_part(fabric, run_cell(cell, fabric, stop))
