"""A worker process: connects a `Worker` to the network."""

import asyncio
from collections.abc import Sequence

import msgspec

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.partition import shares
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_kernels import warm
from neurosnap.runtime.parts.job import PartContext
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


class WorkerJob(msgspec.Struct, frozen=True):
    """One worker, with its share of the cells."""

    worker: int
    """Its number."""
    cells: int
    """Of the whole swarm."""
    workers: int
    """That share them."""

    async def run(self, part: PartContext) -> None:
        """Be the worker until the end."""
        async with part.connection.fabric(swift=True) as fabric:
            hosted = shares(self.cells, self.workers)
            work = run_worker(self.worker, hosted, fabric, part.stop)
            await take_part(fabric, work)
