"""The parts beside the cells, each as the job of a process of its own."""

import asyncio
import shutil
from pathlib import Path
from typing import Self

import msgspec

from neurosnap.fabric.over_zenoh import open_hub
from neurosnap.record.recorder import run_recorder
from neurosnap.record.resume import Past, begin_recording, restore
from neurosnap.record.writer import Writer
from neurosnap.source import open_source
from neurosnap.swarm.coordinator import Coordinator, Totals
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.part import take_part
from neurosnap.swarm.process import Reporter, Seat
from neurosnap.swarm.shell import conduct
from neurosnap.swarm.world import run_world


class Result(msgspec.Struct):
    """What the coordinator brings home."""

    totals: Totals
    seconds: float
    """What the run took, once every part was up."""
    implications: list[tuple[str, str]]
    """The learned order by name, covering pairs only."""

    @classmethod
    def of(cls, core: Coordinator, seconds: float) -> Self:
        """Sum a core up."""
        named = core.graph.implications(core.snapshot.sensorium)
        return cls(core.totals, seconds, named)


def coordinator_for(options: RunOptions, past: Past | None) -> Coordinator:
    """Return the core of a run: new, or as it was where it is taken up again."""
    return Coordinator.of(options) if past is None else restore(past, options.ticks)


async def be_hub(
    seat: Seat, stop: asyncio.Event, reporter: Reporter, sessions: int
) -> None:
    """Be the router all others connect to.

    The socket's folder goes with the hub: a launcher that was killed cannot remove it.
    """
    session = await asyncio.to_thread(open_hub, [seat.endpoint], sessions)
    try:
        reporter.ready()
        await stop.wait()
    finally:
        await asyncio.to_thread(session.close)
        shutil.rmtree(Path(seat.endpoint.partition("/")[2]).parent, ignore_errors=True)


async def be_recorder(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    path: str,
    metadata: dict[str, str],
    past: Past | None,
    parts: tuple[str, ...],
) -> None:
    """Record everything, after what there is of a resumed run."""
    with Writer(path) as writer:
        begin_recording(writer, metadata, past)
        async with seat.fabric() as fabric:
            balance = await run_recorder(writer, fabric, stop, parts=parts)
    reporter.done(balance)


async def be_world(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    options: RunOptions,
    past: Past | None,
) -> None:
    """Be the world, or the file of readings."""
    source = open_source(options.source, options.seed)
    try:
        async with seat.fabric(swift=True) as fabric:
            actions = None if past is None else past.actions
            await take_part(fabric, run_world(source, fabric, stop, past=actions))
    finally:
        source.close()
    reporter.done()


async def be_coordinator(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    options: RunOptions,
    past: Past | None,
    parts: tuple[str, ...],
) -> None:
    """Learn, conduct and decide."""
    core = coordinator_for(options, past)
    async with seat.fabric(swift=True) as fabric:
        seconds = await take_part(
            fabric,
            conduct(
                core,
                fabric,
                stop,
                parts=parts,
                deadline=options.deadline,
                patience=60.0 + 0.05 * len(parts),
                on_progress=reporter.progress,
            ),
        )
    reporter.done(Result.of(core, seconds))
