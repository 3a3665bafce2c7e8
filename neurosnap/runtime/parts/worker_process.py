"""A worker process: connects a `Worker` to the network.

Apart from `hub_and_cell`, since it needs numpy, which a cell's process must not load.
"""

import asyncio

import msgspec

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_kernels import warm
from neurosnap.protocol.worker_shares import shares
from neurosnap.runtime.parts.job import PartContext, decoded, take_part


class WorkerJob(msgspec.Struct, frozen=True):
    """The job of one worker, with its share of the cells."""

    worker: int
    """Its number."""
    cells: int
    """Of the whole swarm."""
    workers: int
    """That share them."""
    learning: RunOptions | None = None
    """The run whose learning they share, too; None if they share none."""

    async def run(self, part: PartContext) -> None:
        """Run the worker until the end.

        Reads `wire.worker_keys`; publishes bursts, reports and faults, and what it
        learned.
        """
        async with part.connection.fabric(swift=True) as fabric:
            await take_part(fabric, self._work(fabric, part.stop))

    async def _work(self, fabric: Fabric, stop: asyncio.Event) -> None:
        learning = None
        if self.learning is not None:
            learning = self.learning.new_worker_learning(self.worker)
        keys = wire.worker_keys(self.worker, learns=learning is not None)
        core = Worker(self.worker, shares(self.cells, self.workers), learning)
        warm()

        def handle(deliveries: list[wire.Delivery]) -> None:
            fabric.publish(*core.receive(decoded(fabric, deliveries)))

        await fabric.subscribe(keys, handle)
        await fabric.announce()
        await fabric.serve(stop)
