"""A worker process: connects a `Worker` to the network."""

import asyncio
from collections.abc import Sequence

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.partition import shares
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_kernels import warm
from neurosnap.runtime.parts.child_process import Reporter, Seat
from neurosnap.runtime.parts.participant import decoded, take_part


async def run_worker(
    worker: int, hosted: Sequence[range], fabric: Fabric, stop: asyncio.Event
) -> None:
    """Be a worker until `stop` is set.

    Reads `wire.worker_keys`; publishes bursts, tallies and faults.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Worker(worker, hosted)
    warm()

    def handle(deliveries: list[wire.Delivery]) -> None:
        fabric.publish(*core.receive(decoded(fabric, deliveries)))

    await fabric.subscribe(wire.worker_keys(worker), handle)
    await fabric.announce()
    await fabric.serve(stop)


async def be_worker(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    worker: int,
    cells: int,
    workers: int,
) -> None:
    """Be one worker of so many, for so many cells."""
    async with seat.fabric(swift=True) as fabric:
        hosted = shares(cells, workers)
        await take_part(fabric, run_worker(worker, hosted, fabric, stop))
