"""The world's part of a swarm: it answers every decision with the next observation."""

import asyncio

from neurosnap import wire
from neurosnap.fabric.protocol import Fabric
from neurosnap.record.past import Past
from neurosnap.sensorium import pack
from neurosnap.source import Source, open_source
from neurosnap.swarm.part import decoded, take_part
from neurosnap.swarm.process import Reporter, Seat


async def run_world(
    source: Source,
    fabric: Fabric,
    stop: asyncio.Event,
    *,
    past: tuple[int, ...] | None = None,
) -> None:
    """Be the world until the source is over or `stop` is set.

    Reads ``decide``; publishes ``observe``. The decision of tick `t` makes the
    observation of `t + 1`; one that came before changes nothing.

    Args:
        source: Where observations come from; the caller closes it.
        fabric: Entered by the caller.
        stop: Ends it.
        past: For a run that is resumed, the actions that led from its first observation
            to its last: the source is brought there without publishing anything.
    """
    tick = 0
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    if past is not None:
        source.first()
        for action in past:
            source.step(action)
        tick = len(past) + 1

    def handle(deliveries: list[wire.Delivery]) -> None:
        nonlocal tick
        for message in decoded(fabric, deliveries):
            if not isinstance(message, wire.Decision) or message.tick != tick:
                continue
            bits = source.first() if tick == 0 else source.step(message.action)
            if bits is None:
                loop.call_soon_threadsafe(over.set)
                return
            tick += 1
            fabric.publish(wire.Observation(tick, pack(bits)))

    await fabric.subscribe(("decide",), handle)
    await fabric.announce()
    serving = asyncio.create_task(fabric.serve(stop), name="world/serve")
    ending = asyncio.create_task(over.wait(), name="world/over")
    try:
        await asyncio.wait((serving, ending), return_when=asyncio.FIRST_COMPLETED)
        if serving.done():
            await serving
    finally:
        serving.cancel()
        ending.cancel()


async def be_world(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    name: str,
    seed: int,
    past: Past | None,
) -> None:
    """Be the world, or the file of readings."""
    source = open_source(name, seed)
    try:
        async with seat.fabric(swift=True) as fabric:
            actions = None if past is None else past.actions
            await take_part(fabric, run_world(source, fabric, stop, past=actions))
    finally:
        source.close()
    reporter.done()
