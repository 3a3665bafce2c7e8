"""The world's part of a swarm: it answers every decision with the next observation."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body, Senses
from neurosnap.errors import MessageError, NeurosnapError, ShapeError
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.resume_point import Past
from neurosnap.runtime.parts.child_process import Reporter, Seat
from neurosnap.runtime.parts.participant import decoded, take_part
from neurosnap.sensorium import pack, unpack
from neurosnap.sources.live.journal import Journal
from neurosnap.sources.live.live_source import OutsideSource
from neurosnap.sources.live.open import lost_by, open_outside
from neurosnap.sources.live.remote_source import RemoteSource
from neurosnap.sources.live.zenoh_source import Hub
from neurosnap.sources.open import Source, open_source

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class World:
    """A source and what is sensed of it, tick by tick.

    Args:
        source: Where observations come from; the caller closes it.
        body: What is made of them.
        past: For a run that is resumed: the source is brought to where it was, unless
            it is live: then it says itself whether what it shows next follows an action
            of the run.
    """

    def __init__(self, source: Source, body: Body, past: Past | None = None) -> None:
        self._source = source
        self._senses = Senses(body)
        self._choices = len(body.choices)
        self._literals = 2 * len(body.sensors)
        self._tick = 0  # of the last observation
        self._answered = -1  # the tick of the last decision taken up
        self._state: NDArray[np.bool_] | None = None
        self._recorded = 0  # the tick of that state
        self._known: NDArray[np.bool_] | None = None  # of the last own readings
        self._began = past is not None
        if past is not None:
            self._go_on(past)

    def _go_on(self, past: Past) -> None:
        if not self._source.live:
            self._source.first()
            for action in past.actions:
                self._source.step(action)
        self._known = self._source.known
        self._tick, self._answered = past.tick, past.tick - 1
        self._state = unpack(past.state, self._literals)
        self._recorded = past.tick

    @property
    def topics(self) -> tuple[str, ...]:
        """What it has to hear of."""
        return ("state", "decide") if self._senses.looks_back else ("decide",)

    def hear(self, message: wire.Message) -> wire.Decision | None:
        """Take in a message; return it if it is a decision to be answered.

        A decision that came before changes nothing.

        Raises:
            MessageError: It cannot be right.
        """
        match message:
            case wire.State() if message.tick == self._tick:
                try:
                    self._state = unpack(message.literals, self._literals)
                except ShapeError as error:
                    raise MessageError(f"state: {error}") from error
                self._recorded = message.tick
            case wire.Decision() if message.tick > self._answered:
                free = self._tick == 0 or not self._choices
                fits = free or 0 <= message.action < self._choices
                if message.tick > self._tick or not fits:
                    rule = f"must be for tick {self._tick}, of {self._choices} choices"
                    raise MessageError(f"decide: {f'{rule}, got {message}':.200}")
                if self._senses.looks_back and self._recorded < self._tick:
                    # What would be sensed in context would be wrong.
                    rule = f"must come after the state of tick {self._tick}"
                    got = f"that of {self._recorded}"
                    raise MessageError(f"decide: {rule}, got {got}")
                self._answered = message.tick
                return message
            case _:
                pass
        return None

    def answer(self, decision: wire.Decision) -> wire.Observation | None:
        """Return the observation that follows a decision; None: the source is over.

        With a live source it takes as long as that does.
        """
        source = self._source
        bits = source.step(decision.action) if self._began else source.first()
        if bits is None:
            return None
        self._began = True
        self._tick += 1
        step = (-1 if source.begins else decision.action, self._state)
        known = self._senses.known(source.known, *step, self._known)
        self._known = source.known
        if source.known is not None:
            bits = bits & source.known
        return wire.Observation(
            tick=self._tick,
            bits=pack(self._senses.observe(bits, *step)),
            begins=source.begins,
            known=b"" if known is None else pack(known),
        )


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
    begins a trajectory: then it follows no action, and none is sensed. A tick's state
    comes before its decision, both from the coordinator.

    A live source is waited for on a thread of its own, so that neither messages nor
    `stop` have to wait; it is closed at the end.

    Args:
        source: Where observations come from; the caller closes it.
        body: What is made of them.
        fabric: Entered by the caller.
        stop: Ends it.
        past: For a run that is resumed.
    """
    world = World(source, body, past)
    over = asyncio.Event()
    decisions: asyncio.Queue[wire.Decision] = asyncio.Queue()
    loop = asyncio.get_running_loop()

    def handle(deliveries: list[wire.Delivery]) -> None:
        for message in decoded(fabric, deliveries):
            try:
                decision = world.hear(message)
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
    serving = asyncio.create_task(fabric.serve(stop), name="world/serve")
    ending = asyncio.create_task(end, name="world/over")
    try:
        await asyncio.wait((serving, ending), return_when=asyncio.FIRST_COMPLETED)
        for task in (serving, ending):
            if task.done():
                await task
    finally:
        if source.live:
            source.close()
        serving.cancel()
        ending.cancel()


class WayIn(msgspec.Struct, frozen=True):
    """How outside readings that are kept get to the world."""

    journal: str
    """The folder that they are kept in."""
    address: str = ""
    """Where to ask for them; empty: the world takes them in, and keeps them."""


async def be_world(
    seat: Seat,
    stop: asyncio.Event,
    reporter: Reporter,
    options: RunOptions,
    past: Past | None,
    way_in: WayIn | None = None,
) -> None:
    """Be the world, or the file of readings."""
    source: Source
    kept = None if way_in is None else open_kept(options, way_in, seat)
    if kept is None:
        source = open_source(options.source, options.seed, options.arguments, seat)
    else:
        source = kept
    try:
        if kept is not None:
            # In a thread: it asks another process, which may be coming back.
            await asyncio.to_thread(kept.go_on, 0 if past is None else past.tick)
        async with seat.fabric(swift=True) as fabric, synced(source, options.sync):
            work = run_world(source, options.body, fabric, stop, past=past)
            await take_part(fabric, work)
    finally:
        source.close()
    reporter.done(lost_of(source, options))


def open_kept(
    options: RunOptions, way_in: WayIn, hub: Hub | None = None
) -> OutsideSource | RemoteSource:
    """Return the source of a run whose readings are kept; `go_on` comes first.

    Raises:
        NeurosnapError: As from `open_outside`; or readings cannot be kept.
    """
    body = options.body
    if way_in.address:
        return RemoteSource(way_in.address, body.own, body.actions)
    journal = Journal(Path(way_in.journal), body.own)
    return open_outside(
        options.source, options.arguments, hub, journal=journal, most=options.ticks
    )


@asynccontextmanager
async def synced(source: Source, seconds: float) -> AsyncIterator[None]:
    """Let what a source keeps survive a power cut after `seconds`; 0: none does.

    What the disk fails of, the source fails of.
    """
    if not isinstance(source, OutsideSource) or not source.journal or not seconds:
        yield
        return
    syncing = asyncio.create_task(_sync(source, source.journal, seconds), name="sync")
    try:
        yield
    finally:
        syncing.cancel()


async def _sync(source: OutsideSource, journal: Journal, seconds: float) -> None:
    try:
        while True:
            await asyncio.sleep(seconds)
            await asyncio.to_thread(journal.sync)
    except NeurosnapError as error:
        source.fail(error)


def lost_of(source: Source, options: RunOptions) -> int:
    """Return how many readings a source that takes them in itself has lost."""
    if not isinstance(source, OutsideSource):
        return 0
    return lost_by(options.source, source.statistics())
