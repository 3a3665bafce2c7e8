"""Drives the pure core of a coordinator: delivers messages, and keeps deadlines.

It waits until every part is there, hands the core what arrives, publishes what the core
answers, and keeps a deadline for every wave in flight, and for the world's next
observation. It decides nothing itself.
"""

import asyncio
import logging
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Protocol

from neurosnap import wire
from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.wait_for_events import first_of
from neurosnap.runtime.parts.job import decoded

_log = logging.getLogger(__name__)
_WARNED = 1 / 3  # of its time is over when the world is named as who is waited for
_LAST_WORD = 0.5  # seconds
_WORD = 0.25  # seconds between two words of how far it is, at most


class Core(Protocol):
    """The pure core that the loop drives: messages in, messages out."""

    finished: bool

    @property
    def tick(self) -> int:
        """The last whole tick, for reports of progress."""

    @property
    def in_flight(self) -> tuple[int, ...]:
        """What has not come to its end.

        Waves by number; a question as its -round; and 0, if workers learn.
        """

    def begin(self) -> list[wire.Message]:
        """Return what opens the run."""

    def receive(self, message: wire.Message) -> list[wire.Message]:
        """Receive one message; return what is to be published for it."""

    def overdue(self, number: int) -> list[wire.Message]:
        """Return what is to be published because what has this number is late."""

    def stop(self) -> list[wire.Message]:
        """End after what is under way."""


@dataclass(frozen=True)
class Deadlines:
    """How long a coordinator waits, in seconds."""

    wave: float
    """For a wave to settle, before it is sent again."""
    answer: float | None = None
    """For the world to answer a decision; None if that may take any time."""
    parts: float = 60.0
    """For the parts to come up."""


async def run_coordinator(
    core: Core,
    fabric: Fabric,
    stop: asyncio.Event,
    *,
    parts: Collection[str],
    deadlines: Deadlines,
    on_progress: Callable[[int], None] = lambda _: None,
    on_said: Callable[[wire.Message], None] = lambda _: None,
) -> float:
    """Run `core` as the swarm's coordinator until it has finished or `stop` is set.

    Reads `wire.COORDINATOR_KEYS` and the presence of `parts`; publishes what the core
    says. On `stop`, and when a part leaves in order
    because it is done, the tick under way is brought to its end first.

    Args:
        core: Decides what is sent.
        fabric: Entered by the caller, and closed by it.
        stop: Ends the run in order.
        parts: Who must be there before it begins, and stay until it ends.
        deadlines: How long it waits for what.
        on_progress: Called with the core's tick once the swarm is up, after each burst,
            and while nothing is over its deadline four times a second; on any thread.
        on_said: Called with every message that is received and published, likewise.

    Returns:
        Seconds from the beginning to the end, the wait for the parts left out.

    Raises:
        SwarmError: A part did not come up, or went away, or the world does not answer;
            it is named.
        AnswerLostError: A wave did not settle, a question to the cells' histories was
            not answered, or workers did not learn, and neither did the repeats.
    """
    shell = _CoordinatorLoop(core, fabric, parts, deadlines, on_progress, on_said)
    presence = _Presence(parts, fabric, shell)
    await fabric.subscribe(wire.COORDINATOR_KEYS, shell.handle)
    await fabric.watch(presence.change)
    await fabric.announce()
    watching = asyncio.create_task(shell.watch(), name="coordinator/deadlines")
    try:
        await presence.wait_complete(stop, deadlines.parts)
        began = time.perf_counter()
        if not stop.is_set() and not shell.over.is_set():
            shell.begin()
        await first_of(fabric.serve(shell.over), stop.wait())
        if not shell.over.is_set():
            shell.send(core.stop)
        await fabric.serve(shell.over)
        return time.perf_counter() - began
    finally:
        watching.cancel()


class WorldDeadline:
    """A deadline for the world's next observation: `patience` seconds, or none if None.

    Only what the coordinator says is needed: a decision asks the world for an
    observation, and the first wave of a tick shows that this has come.
    """

    def __init__(self, patience: float | None) -> None:
        self._patience = patience
        self._tick: int | None = None  # of the decision that is not answered
        self._since = 0.0
        self._warned = False

    def published(self, message: wire.Message) -> None:
        """Note what the coordinator has just published."""
        match message:
            case wire.Decision(tick=tick):
                self._tick, self._since = tick, time.monotonic()
                self._warned = False
            case wire.WaveStart():
                self._tick = None
            case _:
                pass

    def check(self) -> None:
        """Log that the world's observation is late, once it takes long.

        Raises:
            PartDiedError: It takes longer than it may: who hangs is as good as dead.
        """
        if self._patience is None or self._tick is None:
            return
        waited = time.monotonic() - self._since
        if waited > self._patience:
            rule = f"must answer the decision of tick {self._tick}"
            raise PartDiedError(
                f"world: {rule} within {self._patience:g} s, got nothing"
            )
        if waited > self._patience * _WARNED and not self._warned:
            self._warned = True
            _log.warning("waiting for world: tick %d, %.1f s", self._tick + 1, waited)


class _CoordinatorLoop:
    """Feeds the core and keeps the deadlines.

    Messages come on the fabric's thread and deadlines on the loop's: `_lock` is held
    whenever the core is used, and while what it says is published, so that the order
    on the wire is the order in which it was said.
    """

    def __init__(
        self,
        core: Core,
        fabric: Fabric,
        parts: Collection[str],
        deadlines: Deadlines,
        on_progress: Callable[[int], None],
        on_said: Callable[[wire.Message], None],
    ) -> None:
        self._answer = WorldDeadline(deadlines.answer)
        self._parts = frozenset(parts)
        self.over = asyncio.Event()
        self.left: set[str] = set()  # who said a last word
        self._core = core
        self._fabric = fabric
        self._deadline = deadlines.wave
        self._on_progress = on_progress
        self._on_said = on_said
        self._begun = False
        self._loop = asyncio.get_running_loop()
        self._lock = threading.Lock()
        self._started: dict[int, float] = {}  # when what is in flight was sent
        self._repeat = 0  # the last wave that was one

    def handle(self, deliveries: list[wire.Delivery]) -> None:
        """Hand a burst to the core. Called on the fabric's thread."""
        with self._lock:
            for message in decoded(self._fabric, deliveries):
                if isinstance(message, wire.Leave) and message.who == self._fabric.who:
                    continue  # its own last word comes back to it
                if isinstance(message, wire.Leave) and message.who not in self._parts:
                    what = (
                        f"leave: must be of a part of this run, got {message.who:.40}"
                    )
                    self._publish([wire.Fault("coordinator", what)])
                elif isinstance(message, wire.Leave):
                    self.left.add(message.who)
                    if "/" not in message.who:  # without its cells no tick would end
                        self._publish(self._core.stop())
                else:
                    self._on_said(message)
                    self._publish(self._core.receive(message))
            if self._repeat:  # may have settled, and another waited for that
                self._find_overdue()
        self._report_progress()

    def begin(self) -> None:
        """Begin the run: all parts are there."""
        self.send(self._core.begin)
        self._begun = True
        self._report_progress()

    def _report_progress(self) -> None:
        if self._begun:
            self._on_progress(self._core.tick)

    def send(self, speak: Callable[[], list[wire.Message]]) -> None:
        """Publish what the core says when asked by `speak`."""
        with self._lock:
            self._publish(speak())

    def _publish(self, messages: list[wire.Message]) -> None:
        self._fabric.publish(*messages)
        for message in messages:
            self._answer.published(message)
            if isinstance(message, wire.WaveStart):
                self._started[message.wave] = time.monotonic()
                if message.repeats:
                    self._repeat = message.wave
            elif isinstance(message, wire.Recall):
                self._started[-message.round] = time.monotonic()
            elif isinstance(message, wire.Learn):
                self._started[0] = time.monotonic()
            self._on_said(message)
        if self._core.finished:
            self._loop.call_soon_threadsafe(self.over.set)

    async def watch(self) -> None:
        """See to every deadline, until cancelled; say how far it is."""
        while True:
            await asyncio.sleep(min(self._deadline / 8, _WORD))
            try:
                with self._lock:
                    self._find_overdue()
                    self._answer.check()
                self._report_progress()
            except Exception as error:  # noqa: BLE001 - goes on to the owner, whole
                self._fabric.fail(error)
                return

    def _find_overdue(self) -> None:
        """Tell the core of a wave that is over its deadline, one at a time.

        Before a repeat all cells are wired anew, and the report of a cell that is half
        way through that is refused. So the next waits until the last repeat has
        settled, or is late itself.
        """
        flying = self._core.in_flight
        limit = time.monotonic() - self._deadline
        self._started = {n: t for n, t in self._started.items() if n in flying}
        late = [n for n, t in self._started.items() if t < limit]
        if self._repeat in flying:
            late = [self._repeat] if self._repeat in late else []
        else:
            self._repeat = 0
        if late:
            self._publish(self._core.overdue(late[0]))


class _Presence:
    """Keeps which of the parts that must be there are there, each once."""

    def __init__(
        self, parts: Collection[str], fabric: Fabric, shell: _CoordinatorLoop
    ) -> None:
        self._missing = set(parts)
        self._parts = frozenset(parts)
        self._seconds: set[str] = set()
        self._fabric = fabric
        self._shell = shell
        self._complete = asyncio.Event()

    def change(self, who: str, alive: bool) -> None:
        """Note that `who` came or went."""
        name = who.rpartition("/")[0]
        if who in self._parts and not alive:
            # Its last word may be on the way still: nothing orders the two.
            asyncio.get_running_loop().call_later(_LAST_WORD, self._miss, who)
        elif name in self._parts or name == self._fabric.who:
            (self._seconds.add if alive else self._seconds.discard)(who)
        self._missing.discard(who)
        if not self._missing:  # before that the recorder hears nothing
            self._refuse_seconds()

    def _refuse_seconds(self) -> None:
        """Name who is the second of its name: its service hears that, and ends it."""
        for who in sorted(self._seconds):
            what = f"{who}: must be there once, is the second of its name"
            self._fabric.publish(wire.Fault(self._fabric.who, what))
            if self._complete.is_set() or who.startswith(f"{self._fabric.who}/"):
                self._fabric.fail(PartDiedError(what))  # both may have answered
        if not self._seconds:
            self._complete.set()

    def _miss(self, who: str) -> None:
        """Fail, unless `who` is gone in order or the run has ended meanwhile.

        A cell, or a worker, has no order to go in before that.
        """
        left = who in self._shell.left
        if self._shell.over.is_set() or (left and "/" not in who):
            return
        kind = SwarmError if left else PartDiedError
        self._fabric.fail(kind(f"{who}: must stay until the run ends, is gone"))

    async def wait_complete(self, stop: asyncio.Event, patience: float) -> None:
        """Wait until all are there, or `stop`; raise naming who is not in time."""
        if not (self._missing or self._seconds):
            return
        over = self._fabric.serve(self._shell.over)
        waits = over, self._complete.wait(), stop.wait()
        if not await first_of(*waits, seconds=patience):
            late = sorted(self._missing or self._seconds)
            more = f" and {len(late) - 10} more" if len(late) > 10 else ""
            raise SwarmError(
                f"swarm: every part must come up within {patience:g} s,"
                f" missing: {', '.join(late[:10])}{more}"
            )
