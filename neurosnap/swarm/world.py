"""The world's part of a swarm: it answers every decision with the next observation."""

import asyncio
from typing import TYPE_CHECKING

from neurosnap import wire
from neurosnap.agent.context import Body, Senses
from neurosnap.errors import ShapeError
from neurosnap.fabric.protocol import Fabric
from neurosnap.record.past import Past
from neurosnap.sensorium import pack, unpack
from neurosnap.source import Source, open_source
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.part import decoded, take_part
from neurosnap.swarm.process import Reporter, Seat

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


async def run_world(
    source: Source,
    body: Body,
    fabric: Fabric,
    stop: asyncio.Event,
    *,
    past: Past | None = None,
) -> None:
    """Be the world until the source is over or `stop` is set.

    Reads ``decide``, and ``state`` where a sensor looks back at it; publishes
    ``observe``. The decision of tick `t` makes the observation of `t + 1`, unless that
    begins a trajectory: then it follows no action, and none is sensed. A decision that
    came before changes nothing. A tick's state comes before its decision, both from
    the coordinator.

    Args:
        source: Where observations come from; the caller closes it.
        body: What is made of them.
        fabric: Entered by the caller.
        stop: Ends it.
        past: For a run that is resumed: the source is brought to where it was without
            publishing anything.
    """
    senses = Senses(body)
    choices = len(body.choices)
    literals = 2 * len(body.sensors)
    tick = 0
    state: NDArray[np.bool_] | None = None
    over = asyncio.Event()
    loop = asyncio.get_running_loop()
    if past is not None:
        source.first()
        for action in past.actions:
            source.step(action)
        tick, state = past.tick, unpack(past.state, literals)

    def handle(deliveries: list[wire.Delivery]) -> None:
        nonlocal tick, state
        for message in decoded(fabric, deliveries):
            if isinstance(message, wire.State) and message.tick == tick:
                try:
                    state = unpack(message.literals, literals)
                except ShapeError as error:
                    fabric.publish(wire.Fault("world", f"state: {error}"))
            if not isinstance(message, wire.Decision) or message.tick < tick:
                continue  # it came before
            fits = tick == 0 or not choices or 0 <= message.action < choices
            if message.tick > tick or not fits:
                what = f"must be for tick {tick}, of {choices} choices, got {message}"
                fabric.publish(wire.Fault("world", f"decide: {what:.200}"))
                continue
            bits = source.first() if tick == 0 else source.step(message.action)
            if bits is None:
                loop.call_soon_threadsafe(over.set)
                return
            tick += 1
            action = -1 if source.begins else message.action
            bits = senses.observe(bits, action, state)
            fabric.publish(wire.Observation(tick, pack(bits), source.begins))

    topics = ("state", "decide") if senses.looks_back else ("decide",)
    await fabric.subscribe(topics, handle)
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
    options: RunOptions,
    past: Past | None,
) -> None:
    """Be the world, or the file of readings."""
    source = open_source(options.source, options.seed, options.arguments)
    try:
        async with seat.fabric(swift=True) as fabric:
            work = run_world(source, options.body, fabric, stop, past=past)
            await take_part(fabric, work)
    finally:
        source.close()
    reporter.done()
