"""The recorder: receives all traffic of a swarm and writes it to a recording.

It is the last to leave: every other part says `wire.Leave` as its last word, and once
that has come from all of them, with no number missing before it, the recording is known
to be whole.
"""

import asyncio
import logging
import sys
import time
from collections.abc import Callable, Collection, Mapping
from functools import partial
from importlib import metadata
from pathlib import Path

import msgspec

from neurosnap import wire
from neurosnap.errors import NeurosnapError, RecordingError
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.wait_for_events import first_of
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.runtime.parts.job import PartContext
from neurosnap.runtime.recorded_source import recordable
from neurosnap.sources.live.journal import cut, journal_of
from neurosnap.system.distribution import version

_PACKAGES = ("eclipse-zenoh", "mcap", "msgspec", "numpy", "numba")
_POLL = 0.02  # seconds messages may wait before they are written into a chunk
_LAST_WORD = 0.5  # seconds a last word may arrive after its part has gone
_FLUSH = 0.2  # seconds a chunk may wait before it goes to the operating system


class RecorderJob(msgspec.Struct, frozen=True):
    """The job of the recorder."""

    options: RunOptions
    """The run's."""
    path: str
    """Where to record; of several files the first."""
    past: ResumePoint | None
    """The recording of a resumed run that it takes over."""
    swarm: str
    """The swarm's id."""
    parts: tuple[str, ...]
    """Whose last words it waits for."""

    async def run(self, part: PartContext) -> None:
        """Record everything, after what is recorded of a resumed run."""
        options = self.options
        with SplitWriter(
            self.path,
            {**describe(options), "swarm": self.swarm},
            self.past,
            split=split_of(options),
            sync_every=options.sync,
            senders={*self.parts, part.connection.who},
        ) as writer:
            async with part.connection.fabric() as fabric:
                balance = await run_recorder(
                    writer,
                    fabric,
                    part.stop,
                    parts=self.parts,
                    # Cut off no earlier: a run may go on from the last but one.
                    on_safe=partial(cut, journal_of(Path(self.path))),
                    on_ready=part.reporter.ready,
                )
        part.reporter.done(balance)


def split_of(options: RunOptions) -> Split | None:
    """Return how a run's recording is spread over files; None if it is one file."""
    return Split(options.split, options.keep) if options.split else None


def describe(options: RunOptions) -> dict[str, str]:
    """Return the facts of a run, as text: each option, all of them, the versions."""
    options = recordable(options)
    facts = {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in msgspec.structs.asdict(options).items()
    }
    versions = {"neurosnap": version()}
    versions |= {name: metadata.version(name) for name in _PACKAGES}
    versions["python"] = ".".join(map(str, sys.version_info[:3]))
    return {
        **facts,
        "sensors": msgspec.json.encode(options.sensors).decode(),
        "options": msgspec.json.encode(options).decode(),
        "versions": msgspec.json.encode(versions).decode(),
    }


async def run_recorder(
    writer: SplitWriter,
    fabric: Fabric,
    stop: asyncio.Event,
    *,
    parts: Collection[str],
    grace: float = 5.0,
    on_safe: Callable[[int], object] = lambda _: None,
    on_ready: Callable[[], None] = lambda: None,
) -> Completeness:
    """Record all traffic until every one of `parts` has left; finish the recording.

    Reads everything, and the presence of `parts`, since one that was killed has no
    last word; publishes a ``fault`` for what cannot be recorded.

    Args:
        writer: Entered by the caller, who also leaves it in case of an error.
        fabric: Entered by the caller.
        stop: Once set, those who have not left get `grace` seconds to do so.
        parts: Whose last word is awaited.
        grace: Seconds.
        on_safe: Called on a thread with a tick, the last but one that has a key-frame:
            no run goes on from before it, and all up to it is where `sync` wants it.
        on_ready: Called once it misses no message any more.

    Returns:
        What the recording holds of what was sent; a part that never said its last word
        lacks at least that. A disk that takes no more ends the run in order: what was
        flushed stays readable, and this says that the rest is missing.
    """
    listener = _Listener(writer, parts, fabric)
    await fabric.subscribe(("**",), listener.handle, poll=_POLL)
    await fabric.watch(listener.change)
    await fabric.announce()
    await fabric.confirm()
    on_ready()
    flushing = asyncio.create_task(
        _flush(writer, fabric, lambda: listener.framed, on_safe), name="recorder/flush"
    )
    try:
        await first_of(fabric.serve(listener.all_left), stop.wait())
        await first_of(fabric.serve(listener.all_left), seconds=grace)
        return writer.finish({"ticks": str(listener.ticks)}, listener.expected())
    except RecordingError as error:
        logging.getLogger(__name__).log(logging.ERROR, "%s", error)
        # Then the coordinator ends the run, and does not wait for the recorder.
        fabric.publish(wire.Fault(fabric.who, str(error)), wire.Leave(fabric.who))
        return writer.give_up(listener.expected())
    finally:
        listener.closed = True
        flushing.cancel()


async def _flush(
    writer: SplitWriter,
    fabric: Fabric,
    framed: Callable[[], int] = lambda: 0,
    on_safe: Callable[[int], object] = lambda _: None,
) -> None:
    """Bound what a crash may cost, and a power cut if the run wants that.

    What `framed` returned is safe once it was flushed, or synced if the run wants that,
    and read back.
    """
    synced = time.monotonic()
    safe = syncing = told = 0  # ticks
    while True:
        await asyncio.sleep(_FLUSH)
        frame = framed()
        try:
            writer.flush(time.time_ns())
            if not writer.sync_every:
                safe = frame
            elif writer.sync_every <= time.monotonic() - synced:
                synced = time.monotonic()
                if writer.sync():  # the one before is over
                    safe, syncing = syncing, frame
            if safe > told and writer.read_back():
                await asyncio.to_thread(on_safe, safe)
                told = safe
        except NeurosnapError as error:
            fabric.fail(error)
            return


class _Listener:
    """Writes each delivery, and keeps count of who has left and what it came to."""

    def __init__(
        self, writer: SplitWriter, parts: Collection[str], fabric: Fabric
    ) -> None:
        self._fabric = fabric
        self.all_left = asyncio.Event()
        self.closed = False
        self._writer = writer
        self._parts = frozenset(parts)
        self._left: dict[str, int] = {}
        self._going: dict[str, asyncio.TimerHandle] = {}
        self._gone: set[str] = set()
        self.ticks = 0
        """As far as the recorder can tell."""
        self._frame = 0  # the tick of the last key-frame
        self.framed = 0
        """The tick of the last key-frame but one: no run resumes from before it."""

    def handle(self, deliveries: list[wire.Delivery]) -> None:
        """Write a burst down; what comes after the end shows as missing."""
        if self.closed:
            return
        is_first = False
        for delivery in deliveries:
            match self._writer.add(delivery, time.time_ns()):
                case None:
                    # Its receiver says what is wrong, if it has one.
                    rule = "must hold a message that can be recorded"
                    what = f"{delivery.key:.100}: {rule}"
                    self._fabric.publish(wire.Fault(self._fabric.who, what))
                case wire.State(tick=tick):
                    is_first, self.ticks = not self.ticks, tick
                case wire.KeyFrame(tick=tick) if tick > self._frame:
                    self.framed, self._frame = self._frame, tick
                case wire.Leave(who=who):
                    self._left[who] = delivery.sequence + 1
                case _:
                    pass
        if is_first:
            # There is something to go on from, and be it the only tick.
            self._writer.flush(time.time_ns())
        self._find_all_left()

    def change(self, who: str, alive: bool) -> None:
        """Note that a part came or went."""
        if self.closed:
            return
        if alive:
            self._gone.discard(who)
            if (timer := self._going.pop(who, None)) is not None:
                timer.cancel()
        else:
            # Its last word travels apart from its presence, and may be on the way.
            loop = asyncio.get_running_loop()
            self._going[who] = loop.call_later(_LAST_WORD, self._give_up, who)

    def _give_up(self, who: str) -> None:
        self._going.pop(who, None)
        self._gone.add(who)
        self._find_all_left()

    def _find_all_left(self) -> None:
        if self._parts <= self._left.keys() | self._gone:
            self.all_left.set()

    def expected(self) -> Mapping[str, int]:
        """Return how many messages each part must have sent."""
        return {
            who: self._left.get(who, self._writer.upcoming(who) + 1)
            for who in self._parts
        }
