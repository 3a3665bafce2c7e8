"""The parts beside the cells, each as the job of a process of its own."""

import asyncio

import msgspec

from neurosnap.agent.walker import Walker
from neurosnap.fabric.over_zenoh import open_hub
from neurosnap.record.recorder import run_recorder
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


def new_coordinator(options: RunOptions) -> Coordinator:
    """Return the core of a run that has seen nothing yet."""
    return Coordinator(
        options.new_snapshot(),
        Walker(options.actions, options.seed),
        wiring=options.wiring,
        ticks=options.ticks,
        keyframe_every=options.keyframe_every,
    )


async def be_hub(
    seat: Seat, stop: asyncio.Event, reporter: Reporter, sessions: int
) -> None:
    """Be the router all others connect to."""
    session = await asyncio.to_thread(open_hub, [seat.endpoint], sessions)
    try:
        reporter.ready()
        await stop.wait()
    finally:
        await asyncio.to_thread(session.close)


async def be_recorder(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    path: str,
    metadata: dict[str, str],
    parts: tuple[str, ...],
) -> None:
    """Record everything."""
    with Writer(path) as writer:
        writer.start(metadata)
        async with seat.fabric() as fabric:
            balance = await run_recorder(writer, fabric, stop, parts=parts)
    reporter.done(balance)


async def be_world(
    seat: Seat, stop: asyncio.Event, reporter: Reporter, options: RunOptions
) -> None:
    """Be the world, or the file of readings."""
    source = open_source(options.source, options.seed)
    try:
        async with seat.fabric(swift=True) as fabric:
            await take_part(fabric, run_world(source, fabric, stop))
    finally:
        source.close()
    reporter.done()


async def be_coordinator(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    options: RunOptions,
    parts: tuple[str, ...],
) -> None:
    """Learn, conduct and decide."""
    core = new_coordinator(options)
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
    reporter.done(Result(core.totals, seconds))
