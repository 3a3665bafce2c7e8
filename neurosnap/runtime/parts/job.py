"""A part of a swarm: its job, its place on the network, and its reports.

Reports go to what started the part, and not over the network: they must work when the
network does not.
"""

import asyncio
import contextlib
import secrets
import threading
import time
import traceback
from collections.abc import Awaitable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, Protocol, TypeAlias, TypeVar

import msgspec

from neurosnap import wire
from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.errors import MessageError, NeurosnapError, PartDiedError
from neurosnap.fabric.hub_address import HubAddress
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.zenoh.zenoh_fabric import ZenohFabric
from neurosnap.protocol.tick_times import Behind, further

if TYPE_CHECKING:
    from neurosnap.fabric.in_memory import MemoryHub

T = TypeVar("T")
_SHOWN = 400  # characters of a fault; what is wrong with a message may quote all of it
# A pipe keeps writes of up to 4,096 bytes whole, so that many cells can share one; four
# of them are the length of what follows.
_LONGEST = 4096 - 4
_PROGRESS = 0.05  # seconds between two reports of progress


class WavesSoFar(msgspec.Struct):
    """The waves of a run, since one looks on."""

    tick: int = 0
    """That of the last wave."""
    number: int = 0
    """Its number: as many were started in the whole run."""
    depth: int = 0
    """Its hops."""
    height: int = 0
    """The height of the order, in implications."""
    deepest: dict[int, int] = {}
    """The most hops, by the height of what the waves began with."""
    behind: Behind | None = None
    """How far the last tick was behind its readings; None if it was not."""
    most: Behind | None = None
    """The tick that was furthest behind."""

    def add(self, settled: wire.State | wire.Reached) -> None:
        """Add a wave that has settled."""
        self.tick, self.number = settled.tick, settled.wave
        self.depth, self.height = settled.depth, settled.height
        most = self.deepest.get(settled.longest, 0)
        self.deepest[settled.longest] = max(most, settled.depth)

    def tell(self, behind: Behind | None) -> None:
        """Note how far a tick was behind."""
        self.behind, self.most = behind, further(self.most, behind)


class Ready(msgspec.Struct, frozen=True, tag=True):
    """A part reports that it is ready."""

    who: str


class Advanced(msgspec.Struct, frozen=True, tag=True):
    """A part reports how many ticks it has done."""

    who: str
    tick: Annotated[int, msgspec.Meta(ge=0)]
    waves: WavesSoFar | None = None


class Grown(msgspec.Struct, frozen=True, tag=True):
    """A part reports that sensors were grown or retired."""

    who: str
    changes: list[Changed]


class Found(msgspec.Struct, frozen=True, tag=True):
    """A part reports an anomaly, as a `NamedAnomaly`."""

    who: str
    anomaly: msgspec.Raw


class Health(msgspec.Struct, frozen=True, tag=True):
    """A part reports the health of the home's sensors, as a `Standing`."""

    who: str
    standing: msgspec.Raw


class Done(msgspec.Struct, frozen=True, tag=True):
    """A part reports that it has done its work, with this result."""

    who: str
    result: msgspec.Raw = msgspec.Raw(b"null")


class Failed(msgspec.Struct, frozen=True, tag=True):
    """A part reports that it cannot go on."""

    who: str
    what: str
    died: bool = False
    """It would be able to if another part had not died."""


Report: TypeAlias = Ready | Advanced | Grown | Found | Health | Done | Failed
_encode = msgspec.json.encode
_decoder: msgspec.json.Decoder[Report] = msgspec.json.Decoder(Report)


def decode_report(content: bytes) -> Report:
    """Return a report as it was."""
    return _decoder.decode(content)


class Line(Protocol):
    """The channel that takes reports, such as a pipe."""

    def send_bytes(self, buf: bytes, /) -> None:
        """Send one report."""


class Reporter:
    """A part's line to what started it; any thread may report.

    Args:
        who: The part's name.
        line: Where reports go.
        every_tick: Report every tick; otherwise at most twenty a second, since a pipe
            is not read faster.
    """

    def __init__(self, who: str, line: Line, *, every_tick: bool = False) -> None:
        self._who = who
        self._line = line
        self._every_tick = every_tick
        self._tick = -1
        self._lock = threading.Lock()  # a long report is several writes
        self._next_progress = 0.0

    def ready(self) -> None:
        """Report that the part is up."""
        self._send(Ready(self._who))

    def progress(
        self, tick: int, waves: WavesSoFar | None = None, *, last: bool = False
    ) -> None:
        """Report the tick it has come to, unless it did a moment ago; but its last."""
        now = time.monotonic()
        is_due = last or now >= self._next_progress
        if not is_due and not (self._every_tick and tick != self._tick):
            return
        self._tick = tick
        if is_due:
            self._next_progress = now + _PROGRESS
        self._send(Advanced(self._who, tick, waves if is_due else None))

    def changed(self, changes: list[Changed]) -> None:
        """Say what was grown or retired. Only for parts with a pipe of their own."""
        if changes:
            self._send(Grown(self._who, changes))

    def found(self, anomaly: object) -> None:
        """Report an anomaly. Only for parts with a pipe of their own."""
        self._send(Found(self._who, msgspec.Raw(msgspec.json.encode(anomaly))))

    def health(self, standing: object) -> None:
        """Say how the sensors are. Only for parts with a pipe of their own."""
        self._send(Health(self._who, msgspec.Raw(msgspec.json.encode(standing))))

    def done(self, result: object = None) -> None:
        """Report the result. Only for parts with a pipe of their own."""
        self._send(Done(self._who, msgspec.Raw(msgspec.json.encode(result))))

    def failed(self, what: str, *, died: bool = False) -> None:
        """Say why it cannot go on; the end of a long text is what counts.

        That it is short enough shows once it is encoded: a character may take six
        bytes.
        """
        kept = what[-_LONGEST:]
        while len(_encode(report := Failed(self._who, kept, died))) > _LONGEST:
            kept = kept[len(kept) // 16 + 1 :]
        self._send(report)

    def _send(self, report: Report) -> None:
        # A line that is broken: no launcher is left to report to.
        with self._lock, contextlib.suppress(BrokenPipeError):
            self._line.send_bytes(_encode(report))


class PartConnection(msgspec.Struct, frozen=True):
    """The name of a part, the id of its swarm, and the address of its hub."""

    who: str
    """Its name, as in `Message.sender`."""
    swarm: str
    """The run's id."""
    hub: HubAddress | None = None
    """Where its hub is; None if it needs none."""
    first: int = 0
    """The number of its first message."""
    local: "MemoryHub | None" = None
    """The network in memory, where all parts are tasks of one loop."""
    instance: str = msgspec.field(default_factory=partial(secrets.token_hex, 4))
    """Tells it from another part that has its name by mistake."""

    def fabric(self, *, swift: bool = False) -> Fabric:
        """Return the part's end of the network, to be entered; see `ZenohFabric`."""
        if self.local is not None:
            return self.local.fabric(self.who, first=self.first)
        return ZenohFabric(
            self.who,
            self.swarm,
            self.address,
            first=self.first,
            swift=swift,
            instance=self.instance,
        )

    @property
    def address(self) -> HubAddress:
        """Where the hub is.

        Raises:
            ValueError: The part has none.
        """
        if self.hub is None:
            raise ValueError(f"{self.who}: must have a hub")
        return self.hub


@dataclass(frozen=True)
class PartContext:
    """What a job is given to work with: a connection, a stop event, a reporter."""

    connection: PartConnection
    """Its place on the network."""
    stop: asyncio.Event
    """Set once it is to end in order."""
    reporter: Reporter
    """Its line to what started it."""


class Job(Protocol):
    """The work of a part, as a struct that can be pickled.

    Its class must be importable: the part looks it up by its module.
    """

    async def run(self, part: PartContext) -> None:
        """Work until it is done, or `part.stop` is set."""


async def carry_out(job: Job, part: PartContext) -> bool:
    """Run a job to its end, and report why if it fails; tell whether it did not."""
    try:
        await job.run(part)
    except NeurosnapError as error:
        part.reporter.failed(str(error), died=isinstance(error, PartDiedError))
        return False
    except Exception:  # noqa: BLE001 - the part ends here, and says why
        part.reporter.failed(traceback.format_exc())
        return False
    return True


async def take_part(fabric: Fabric, work: Awaitable[T]) -> T:
    """Await `work` inside an entered fabric, then say the part's last word.

    A part that fails says why, as a `Fault`, before its last word: the recording then
    holds the reason. A cancelled part says nothing: it has no time left.
    """
    try:
        result = await work
    except Exception as error:
        # In one go, so that none of its messages comes between: it shows who failed.
        fault = wire.Fault(fabric.who, f"{type(error).__name__}: {error}")
        fabric.publish(fault, wire.Leave(fabric.who))
        raise
    fabric.publish(wire.Leave(fabric.who))
    return result


def decoded(fabric: Fabric, deliveries: Iterable[wire.Delivery]) -> list[wire.Message]:
    """Return the messages in a burst; what is none is reported and dropped."""
    messages: list[wire.Message] = []
    for delivery in deliveries:
        try:
            messages.append(wire.decode(delivery.key, delivery.payload))
        except MessageError as error:
            fabric.publish(wire.Fault(fabric.who, f"{error!s:.{_SHOWN}}"))
    return messages
