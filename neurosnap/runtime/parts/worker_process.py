"""A worker process: connects a `Worker` to the network."""

import asyncio
from collections.abc import Sequence

import msgspec

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.partition import shares
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_kernels import warm
from neurosnap.protocol.worker_learning import WorkerLearning
from neurosnap.runtime.parts.job import PartContext, decoded, take_part


async def run_worker(
    worker: int,
    hosted: Sequence[range],
    fabric: Fabric,
    stop: asyncio.Event,
    learning: WorkerLearning | None = None,
) -> None:
    """Be a worker until `stop` is set.

    Reads `wire.worker_keys`, and `wire.LEARNING_KEYS` if it learns; publishes bursts,
    reports and faults, and what it learned.
    Cancellation ends it at once; the fabric is the caller's to close.
    """
    core = Worker(worker, hosted, learning)
    warm()

    def handle(deliveries: list[wire.Delivery]) -> None:
        fabric.publish(*core.receive(decoded(fabric, deliveries)))

    keys = wire.worker_keys(worker)
    if learning is not None:
        keys += wire.LEARNING_KEYS
    await fabric.subscribe(keys, handle)
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
    learning: RunOptions | None = None
    """The run whose learning they share, too; None if they share none."""

    async def run(self, part: PartContext) -> None:
        """Be the worker until the end."""
        async with part.connection.fabric(swift=True) as fabric:
            hosted, learning = shares(self.cells, self.workers), None
            if self.learning is not None:
                learning = self.learning.new_worker_learning(self.worker)
            work = run_worker(self.worker, hosted, fabric, part.stop, learning)
            await take_part(fabric, work)
