"""The world process: opens the source and answers decisions."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, closing
from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import MessageError, NeurosnapError
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.wait_for_events import first_of
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.world import World
from neurosnap.runtime.parts.job import PartContext, decoded, take_part
from neurosnap.sources.camera import Camera
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.latest_or_late import Bits
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.remote_source import RemoteSource
from neurosnap.sources.live.zenoh_source import Hub
from neurosnap.sources.open import open_live, open_source
from neurosnap.sources.protocol import Source


async def run_world(
    source: Source,
    body: Body,
    fabric: Fabric,
    stop: asyncio.Event,
    *,
    past: ResumePoint | None = None,
    known: Bits | None = None,
    frames: int = 0,
) -> None:
    """Run the world until the source is over or `stop` is set.

    Reads ``decision``, and ``state`` where a sensor looks back at it; publishes
    ``observation``, and ``image`` behind it. The decision of tick `t` makes the
    observation of `t + 1`, unless that begins a trajectory: then it follows no action,
    and none is sensed. A tick's state comes before its decision, both from the
    coordinator.

    A live source is waited for on another thread, so that neither messages nor
    `stop` have to wait; it is closed at the end.

    Args:
        source: Where observations come from; the caller closes it.
        body: What is made of them.
        fabric: Entered by the caller.
        stop: Ends it.
        past: For a run that is resumed.
        known: As for `World`.
        frames: Ticks from one image to the next; 0: there are none.
    """
    world = World(source, body, past, known)
    camera = Camera(source, frames) if frames else None
    over = asyncio.Event()
    decisions: asyncio.Queue[wire.Decision] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def handle(deliveries: list[wire.Delivery]) -> None:
        for message in decoded(fabric, deliveries):
            try:
                decision = world.receive(message)
            except MessageError as error:
                fabric.publish(wire.Fault("world", str(error)))
                continue
            if decision is None:
                continue
            if source.live:
                loop.call_soon_threadsafe(decisions.put_nowait, decision)
                continue
            observation = world.answer(decision)
            if observation is None:
                loop.call_soon_threadsafe(over.set)
                return
            fabric.publish(observation)
            if camera is not None and camera.is_due(observation.tick):
                fabric.publish(camera.image(observation.tick))

    async def wait_for_it() -> None:
        while True:
            decision = await decisions.get()
            observation = await asyncio.to_thread(world.answer, decision)
            if observation is None:
                return
            fabric.publish(observation)

    await fabric.subscribe(world.topics, handle)
    await fabric.announce()
    end = wait_for_it() if source.live else over.wait()
    try:
        await first_of(fabric.serve(stop), end)
    finally:
        if isinstance(source, LiveSource):
            source.over = stop.is_set()
        if source.live:
            source.close()


class WayIn(msgspec.Struct, frozen=True):
    """Where the world gets journaled readings: the journal's folder, or an address."""

    journal: str
    """The folder that they are kept in."""
    address: str = ""
    """Where to ask for them; empty: the world takes them in, and keeps them."""


class WorldJob(msgspec.Struct, frozen=True):
    """The job of the world: a source, or a file of readings."""

    options: RunOptions
    past: ResumePoint | None
    """Where it goes on from, for a run that is resumed."""
    way_in: WayIn | None = None
    """How outside readings that are kept get here."""

    async def run(self, part: PartContext) -> None:
        """Answer decisions until the end."""
        options, past, connection = self.options, self.past, part.connection
        source, known = _opened(options, self.way_in, connection), None
        with closing(source):
            if isinstance(source, LiveSource | RemoteSource):
                # In a thread: it asks another process, which may be coming back.
                tick = 0 if past is None else past.tick
                known = await asyncio.to_thread(source.resume_after, tick)
            async with (
                connection.fabric(swift=True) as fabric,
                synced(source, options.sync),
            ):
                work = run_world(
                    source,
                    options.body,
                    fabric,
                    part.stop,
                    past=past,
                    known=known,
                    frames=options.frames,
                )
                await take_part(fabric, work)
        part.reporter.done(
            source.statistics() if isinstance(source, LiveSource) else None
        )


def _opened(options: RunOptions, way_in: WayIn | None, hub: Hub) -> Source:
    """Return the source of a run."""
    name, arguments, body = options.source, options.arguments, options.body
    if way_in is None:
        return open_source(name, options.seed, arguments, hub, options.frames > 0)
    if way_in.address:
        return RemoteSource(way_in.address, body.own, body.actions)
    journal = Journal(Path(way_in.journal), body.own)
    return open_live(name, arguments, hub, journal=journal, most=options.ticks)


@asynccontextmanager
async def synced(source: Source, seconds: float) -> AsyncIterator[None]:
    """Sync a source's journal every `seconds`, against power cuts; 0: never.

    What the disk fails of, the source fails of.
    """
    if not isinstance(source, LiveSource) or not source.journal or not seconds:
        yield
        return
    syncing = asyncio.create_task(_sync(source, source.journal, seconds), name="sync")
    try:
        yield
    finally:
        syncing.cancel()


async def _sync(source: LiveSource, journal: Journal, seconds: float) -> None:
    try:
        while True:
            await asyncio.sleep(seconds)
            await asyncio.to_thread(journal.sync)
    except NeurosnapError as error:
        source.fail(error)
