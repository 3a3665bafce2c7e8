"""All messages on the wire, and their keys.

A message is a frozen, tagged struct; its JSON is the payload, so what is on the wire is
what is in a recording. The union is closed, and `SCHEMA` grows with every change to it:
a recording of another schema is refused. Literals are numbered as in
`neurosnap.sensorium`; bit strings are packed with the lowest bit first and travel as
base64.

Which process sent a message follows from its key alone. A topic is one role's to say,
and a topic that several parts say ends its key with the part: ``leave/cell/3``,
``pulse/7/cell/3``. So the keys that a part may use decide as which part it can speak,
and `decode` refuses a payload that names another. The sender's running number and clock
travel beside the payload (`Delivery`), so that completeness can be proved without a
word about it in the messages.
"""

import re
import struct
from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple, TypeAlias, get_args

import msgspec

from neurosnap.errors import MessageError

SCHEMA = 20
ROOT = "neurosnap"
LARGEST_PAYLOAD = 1 << 26
"""Bytes of a message, at most."""
LARGEST_IMAGE = 1 << 24
"""Bytes of an image, at most."""
HISTORY = 8192
"""Ticks of a sensor's readings that are kept: 2 kB a sensor."""
HISTORY_OF_ACTIONS = 2 * HISTORY
"""The same where actions are taken, and more than one thing may follow each."""
_LARGEST = 2**31 - 1
_PART = re.compile(r"[a-z0-9]{1,20}(/[a-z0-9]{1,20})?")
Count = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
Moment = Annotated[float, msgspec.Meta(ge=0, lt=253402214400)]
"""Seconds since 1970, in a year of four digits by any clock."""
Natural = Annotated[int, msgspec.Meta(ge=0, le=_LARGEST)]
Numbered = Annotated[int, msgspec.Meta(ge=1, le=_LARGEST)]
Naturals = tuple[Natural, ...]
WaveKind: TypeAlias = Literal["state", "signal"]
ImageFormat: TypeAlias = Literal["png", "jpeg"]


class _Message(msgspec.Struct, frozen=True, gc=False, tag=str.lower):
    """What all messages have in common.

    The tag of a message is the name of its class in lower case, and so is its topic.
    """

    _sender: ClassVar[str] = "coordinator"
    """Its sender, as a format of the message."""
    _key: ClassVar[str]
    """Its key, as a format of the message."""

    @property
    def sender(self) -> str:
        """The part that sent it."""
        return self._sender.format(self)

    @property
    def key(self) -> str:
        """Where it travels, below the swarm's prefix."""
        return self._key.format(self)


class Received(msgspec.Struct, frozen=True, gc=False, omit_defaults=True):
    """Counts of the readings a live source has received: shown, late, refused, dropped.

    A reading is one message or line, whatever it says of how many sensors. The fields
    but the last two add up to all that was received.
    """

    shown: Count = 0
    """Those that ticks were made of: the tick after them has them, or newer ones."""
    late: Count = 0
    """Those that were older than what their sensor had read already."""
    refused: Count = 0
    """Those that were no readings, or of no sensor here."""
    dropped: Count = 0
    """Whole readings that too many others waited before."""
    missing: Count = 0
    """Rows that the journal should hold and does not, since it was damaged."""
    outages: Count = 0
    """How often nothing could be listened to: how many came then is not known."""

    @property
    def total(self) -> int:
        """Readings received."""
        return self.shown + self.late + self.refused + self.dropped


class Outage(msgspec.Struct, frozen=True, gc=False):
    """A stretch of time in which a live source could not listen."""

    since: Moment
    """When it was last sure to listen."""
    until: Moment
    """When it listened again."""
    why: str
    """What kept it from listening."""


class Observation(_Message, frozen=True, omit_defaults=True):
    """What every sensor read at one tick; each cell latches its own bit."""

    _sender: ClassVar[str] = "world"
    _key: ClassVar[str] = "observation"

    tick: Numbered
    """Counts from 1."""
    bits: bytes
    """The readings, sensor 0 in the lowest bit of the first byte."""
    begins: bool = False
    """It begins a trajectory: the action of the decision before did not lead to it."""
    known: bytes = b""
    """Which readings are known, packed like `bits`, one at least; empty: all are. One
    that is not is 0 in `bits` and says nothing."""
    cut: bool = False
    """It begins a trajectory, and the one before had not come to its own end: after a
    limit on time, say."""
    received: Received = Received()
    """What a live source has received so far."""
    outages: tuple[Outage, ...] = ()
    """When it could not listen since the observation before."""
    at: Moment = 0
    """When it was, as the source's data say; 0: when it was sent."""
    said: bytes = b""
    """The last number of each signal that sensors compare, in the order of its first
    sensor: float32, little endian, NaN where it is unknown."""
    due: Moment = 0
    """Since when a live source had it to give, if for too long; 0: it was not."""
    waiting: Count = 0
    """How many it had to give behind it then."""


class Wiring(_Message, frozen=True):
    """The out-edges of a cell's two literals: whole, or as changes to an epoch."""

    _key: ClassVar[str] = "wiring/{0.cell}"

    cell: Natural
    """The sensor whose cell this is for."""
    epoch: Numbered
    """The number of this wiring; grows with every message to the same cell."""
    after: Natural
    """The epoch these changes build on; 0: forget all edges first."""
    add: Naturals = ()
    """Targets gained by the sensor's own literal, ascending."""
    drop: Naturals = ()
    """Targets lost by the sensor's own literal, ascending."""
    add_complement: Naturals = ()
    """Targets gained by the complement, ascending."""
    drop_complement: Naturals = ()
    """Targets lost by the complement, ascending."""


class WaveStart(_Message, frozen=True):
    """A wave begins: the literals that it starts from fire.

    It goes to every cell, or only to those of the signal: waking every cell for a wave
    that concerns a few would make its time grow with the number of cells.
    """

    wave: Numbered
    """The wave's number; grows by one with each wave of a run."""
    tick: Natural
    """The tick it belongs to; 0 where there are no observations."""
    kind: WaveKind
    """`state`: every cell fires its own reading of `tick`. `signal`: those named."""
    credit: Natural
    """Every literal of the signal starts with the share ``2^-credit``."""
    settled_below: Numbered
    """All waves below this number have settled or were given up; forget them."""
    signal: Naturals = ()
    """Literals that fire; empty in a `state` wave unless it repeats a lost one."""
    repeats: Natural = 0
    """The number of the wave that was given up for this one; 0: none."""
    fence: Natural = 0
    """The last wave announced to every cell, itself or one before. A cell that has seen
    it has every wiring this wave is meant for, and may act."""
    cell: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """The one cell this copy is for; -1: for all."""

    @property
    def key(self) -> str:
        """Where it travels, below the swarm's prefix."""
        return "wavestart" if self.cell < 0 else f"wavestart/{self.cell}"


class Pulse(_Message, frozen=True):
    """One literal's firing, passed along one edge."""

    wave: Numbered
    """The wave it belongs to."""
    source: Natural
    """The literal that fired."""
    target: Natural
    """The literal it makes fire: positive excites, complementary inhibits."""
    hops: Numbered
    """Edges from the signal to the target along the way this pulse came."""
    credit: Natural
    """It carries the share ``2^-credit`` of the wave."""
    fence: Natural = 0
    """As in the wave's start, for cells that got none."""

    @property
    def sender(self) -> str:
        """The part that sent it."""
        return f"cell/{self.source >> 1}"

    @property
    def key(self) -> str:
        """Where it travels, below the swarm's prefix."""
        return f"pulse/{self.target >> 1}/cell/{self.source >> 1}"


class CellReport(_Message, frozen=True):
    """A cell's report on one wave: what fired since its last, and credit given back."""

    _sender: ClassVar[str] = "cell/{0.cell}"
    _key: ClassVar[str] = "cellreport/cell/{0.cell}"

    wave: Numbered
    """The wave it belongs to."""
    cell: Natural
    """The reporting cell's sensor."""
    part: Natural
    """How many reports on this wave the cell sent before this one."""
    literals: Naturals
    """Literals that fired, at most two."""
    hops: Naturals
    """For each of `literals`, the hops of the pulse that made it fire."""
    credit: Naturals
    """Exponents: the shares ``2^-e`` that end here."""
    pulses: Natural
    """Pulses sent with this report."""
    epoch: Natural = 0
    """The cell's wiring when it acted, by its number; 0: it was never wired."""


class WorkerWiring(_Message, frozen=True):
    """Out-edges of the cells of one worker: whole, or as changes to an epoch.

    What is too much for one frame goes on in the next, as a change to this one.
    """

    _key: ClassVar[str] = "workerwiring/{0.worker}"

    worker: Natural
    """The worker this is for."""
    epoch: Numbered
    """The number of this frame; grows with every message to the same worker."""
    after: Natural
    """The epoch these changes build on; 0: forget all edges first."""
    add: bytes = b""
    """Edges gained, as `numbers`: source and target of each, ascending."""
    drop: bytes = b""
    """Edges lost, as `numbers`: source and target of each, ascending."""


class PulseBatch(_Message, frozen=True):
    """Pulses of one wave from the cells of one worker to those of another.

    Every wave is announced to every worker, so a wave is its own fence here.
    """

    _sender: ClassVar[str] = "worker/{0.worker}"
    _key: ClassVar[str] = "pulsebatch/{0.to}/worker/{0.worker}"

    wave: Numbered
    """The wave they belong to."""
    worker: Natural
    """The sending worker."""
    to: Natural
    """The worker it is for."""
    part: Natural
    """How many batches of this wave the one sent the other before this one."""
    sources: bytes
    """The literals that fired, as `numbers`, one a pulse."""
    targets: bytes
    """The literals they make fire, as `numbers`."""
    hops: bytes
    """Edges from the signal to the target along each pulse's way, as `numbers`."""
    credit: bytes
    """Exponents, as `numbers`: each pulse carries the share ``2^-e`` of the wave."""


class WorkerReport(_Message, frozen=True):
    """A worker's report on one wave, for all its cells; see `CellReport`."""

    _sender: ClassVar[str] = "worker/{0.worker}"
    _key: ClassVar[str] = "workerreport/worker/{0.worker}"

    wave: Numbered
    """The wave it belongs to."""
    worker: Natural
    """The reporting worker."""
    part: Natural
    """How many reports on this wave the worker sent before this one."""
    literals: bytes
    """Literals that fired, as `numbers`."""
    hops: bytes
    """For each of `literals`, the hops of the pulse that made it fire, as `numbers`."""
    credit: Naturals
    """Exponents, ascending: the shares ``2^-e`` that end here, added up until each
    came once."""
    pulses: Natural
    """Pulses along edges of its cells, those to its own cells included."""
    epoch: Natural = 0
    """The worker's last frame of wiring when it acted; 0: it was never wired."""


class State(_Message, frozen=True):
    """The state that the settled wave of one tick gave."""

    _key: ClassVar[str] = "state"

    tick: Numbered
    """The tick it belongs to."""
    wave: Numbered
    """The wave that gave it."""
    literals: bytes
    """The coherent state ``S``: 2N bits, literal 0 in the lowest bit."""
    incoherent: bool
    """The observation contradicted what was learned."""
    depth: Natural
    """Hops until the last literal reached was first reached, as reported."""
    longest: Natural
    """Edges on the longest chain that starts in the signal."""
    height: Natural
    """Edges on the longest chain of the learned order."""
    edges: Natural
    """Edges of the learned order's Hasse wiring, an edge and its contrapositive one."""
    pulses: Natural
    """Pulses the wave took, as reported."""


class Reached(_Message, frozen=True):
    """What a settled planning wave reached: all that its starting literals imply."""

    _key: ClassVar[str] = "reached"

    tick: Numbered
    """The tick it belongs to."""
    wave: Numbered
    """The wave that gave it."""
    signal: Naturals
    """The literals it started from."""
    literals: bytes
    """``↑signal``: 2N bits, literal 0 in the lowest bit."""
    depth: Natural
    """Hops until the last literal reached was first reached, as reported."""
    longest: Natural
    """Edges on the longest chain that starts in the signal."""
    height: Natural
    """Edges on the longest chain of the learned order."""
    pulses: Natural
    """Pulses the wave took, as reported."""


class WeighedLink(msgspec.Struct, frozen=True, gc=False, omit_defaults=True):
    """A learned implication, with what spoke for it and against it."""

    number: Natural
    """Which broken implication it is a link of, from 0; or, of what a worker was asked
    for, its place there."""
    source: Natural
    """The literal that implies."""
    target: Natural
    """The literal implied."""
    support: float = 0.0
    """What was learned of both at once: a count, or a share."""
    against: float = 0.0
    """What was learned of the source without the target, in the same units."""
    since: Natural = 0
    """The tick since which it is believed."""
    occasions: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """On how many occasions, among the last 8,192 ticks, it was put to the test and
    held; -1: they were not counted."""
    worn: Natural = 0
    """The tick since which it breaks too often to be told; 0: it does not."""
    retired: Natural = 0
    """The last tick at which it is told nevertheless; 0: it is told, and if it was worn
    it returns with this anomaly."""


class NumberRead(msgspec.Struct, frozen=True):
    """The number that a sensor compared."""

    sensor: Natural
    number: float


class Anomaly(_Message, frozen=True, omit_defaults=True):
    """An observation contradicts what had been learned before that observation.

    Of each broken implication the links it follows from are listed: one, wherever every
    sensor was read.
    """

    _key: ClassVar[str] = "anomaly"

    tick: Numbered
    """The tick of the observation."""
    since: Numbered
    """The tick it began at; the ticks between are of the same anomaly."""
    culprits: Naturals
    """The fewest sensors that can be wrong, and of such sets the likeliest; the most
    suspect first."""
    candidates: Naturals
    """Sensors that are in one of the smallest such sets; the most suspect first."""
    exact: bool
    """Whether the search for them was complete."""
    implications: Natural
    """Broken implications in all, those that follow from others left out; the first of
    them are listed."""
    links: tuple[WeighedLink, ...]
    """The links of those that are listed."""
    numbers: tuple[NumberRead, ...] = ()
    """What was read of their sensors that compare a number, where it is known."""


class Decision(_Message, frozen=True, omit_defaults=True):
    """What to do next; the world answers it with the observation of ``tick + 1``.

    It also says which sensor is grown, or is read no more, from that observation on.
    """

    _key: ClassVar[str] = "decision"

    tick: Natural
    """The tick it was taken at; 0 opens the run."""
    action: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)]
    """The action, -1 where the source takes none."""
    why: str
    """The reason, for people."""
    born: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """The number of the sensor that is grown; -1: none is."""
    context: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = 0
    """The action of its context; -1: none, it is about the last ticks."""
    literals: Naturals = ()
    """The literals that must have been in the state before, ascending; without an
    action, that must have been read at each of some ticks."""
    since: Natural = 0
    """The first of these, in ticks before this one."""
    until: Natural = 0
    """The last of these."""
    reset: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """Of a latch, which stays on once its literal was read, the literal that ends it;
    -1: it is none."""
    ways: Naturals = ()
    """Of a clone, one of several places that may look alike: an action, the number of a
    clone it leads here from, another action, and so on."""
    among: Naturals = ()
    """Of a clone: the number of the first clone of its map, and how many there are."""
    history: Natural = 0
    """How many ticks its weights come from."""
    weights: bytes = b""
    """The four weights of its pairs with the sensors before it, row by row."""
    codes: bytes = b""
    """What follows from them, one byte a pair."""
    retires: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """The number of the grown sensor that is read no more; -1: none is."""
    chance: Naturals = ()
    """Literals of the world's own that the action before the tick leaves to chance, as
    it has just turned out: nothing is grown for them."""


class KeyFrame(_Message, frozen=True):
    """The whole snapshot after one tick, and what else it takes to go on from there.

    Nothing is under way at that point, and the next wiring is whole, for all cells: so
    a part that starts here needs no message from before.
    """

    _key: ClassVar[str] = "keyframe"

    tick: Natural
    """The tick after which it was taken."""
    snapshot: bytes
    """What `Snapshot.to_bytes` gave."""
    waves: Natural = 0
    """Waves started so far."""
    epochs: Naturals = ()
    """The number of the last wiring, or of each worker's last frame."""
    known: bytes = b""
    """Which readings of the tick were known, as in its observation."""
    action: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """The tick's decision, which follows; nothing here says how it was taken."""
    why: str = ""
    """The reason, as in the decision."""
    pulses: Count = 0
    """Pulses that all waves took so far."""
    depth: Natural = 0
    """Hops of the deepest of them."""
    incoherent: Natural = 0
    """Observations so far that contradicted what was learned."""
    anomalies: Natural = 0
    """Those that contradicted what was believed before they were learned."""
    agent: bytes = b""
    """What an agent that grows sensors or imagines knows besides, as arrays."""
    told: Natural = 0
    """The anomalies that have the support that the run asks for."""
    history: bytes = b""
    """The last readings of all sensors, as arrays, where occasions are counted and
    `agent` does not hold them."""
    bands: Natural = 0
    """How many bands follow, with what `snapshot` lacks; 0: it lacks nothing."""


class Band(_Message, frozen=True):
    """A stretch of what would make a key-frame too large.

    Of a snapshot the arrays with a number a pair of sensors travel so; in the
    key-frame's own snapshot they are there, and empty. And so do the bytes of its
    `snapshot`, `agent` and `history` where they are long, and are empty there.
    """

    _sender: ClassVar[str] = "{0.who}"
    _key: ClassVar[str] = "band/{0.who}"

    who: str
    """The part that holds it."""
    tick: Natural
    """That of the key-frame."""
    array: str
    """Its name in the archive; or that of a key-frame's field, whose bytes are its
    numbers."""
    offset: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]
    """Where the stretch begins in the array, row by row, in numbers."""
    data: memoryview
    """Its numbers, as they lie in memory on x86."""


class Recall(_Message, frozen=True, omit_defaults=True):
    """A question to cells about the last readings of their sensors.

    The readings are a ring of bits: tick ``t``, counted from 1, is bit ``(t - 1) % R``
    of ``R`` ticks. Bits travel packed, several rings one after the other, each as many
    bytes as the last that is not 0 in any of them takes.
    """

    tick: Numbered
    """The last tick that counts; a part that answers has its reading."""
    round: Numbered
    """Which of the tick's questions it is, from 1."""
    repeats: Natural = 0
    """The round that was given up for this one; 0: none."""
    readings: Naturals = ()
    """Literals: the ticks at which each was read."""
    within: bytes = b""
    """Rings: the ticks to count in."""
    counted: bytes = b""
    """For each ring literals, as `numbers`: at how many of its ticks was each read?"""
    sizes: Naturals = ()
    """For each ring how many of `counted` are for it."""
    cell: Annotated[int, msgspec.Meta(ge=-1, le=_LARGEST)] = -1
    """The one cell this copy is for; -1: for all."""

    @property
    def key(self) -> str:
        """Where it travels, below the swarm's prefix."""
        return "recall" if self.cell < 0 else f"recall/{self.cell}"


class Recalled(_Message, frozen=True, omit_defaults=True):
    """The answer of a cell or a worker to a `Recall`.

    Each of its fields is about those of the literals asked that are the sender's, in
    the order in which they were asked.
    """

    _sender: ClassVar[str] = "{0.who}"
    _key: ClassVar[str] = "recalled/{0.who}"

    who: str
    """The part that answers."""
    tick: Numbered
    """That of the question."""
    round: Numbered
    """That of the question."""
    lacks: Naturals = ()
    """The sender's cells that were asked and have no history up to that tick; if there
    are any, nothing else is said."""
    readings: bytes = b""
    """Rings: the ticks at which each literal was read."""
    counts: bytes = b""
    """How often each literal counted was read, as `numbers`."""


class Reminder(_Message, frozen=True):
    """The last readings of some sensors, sent to cells that lack them."""

    _key: ClassVar[str] = "reminder/{0.to}"

    to: str
    """The part that has the cells."""
    tick: Numbered
    """The last tick in it."""
    length: Numbered
    """``R``, the ticks to keep."""
    cells: Naturals
    """The cells."""
    on: bytes
    """A ring for each cell: the ticks at which it read on."""
    off: bytes
    """A ring for each cell: the ticks at which it read off."""


class Learn(_Message, frozen=True, omit_defaults=True):
    """What the workers learn now, where they share the learning.

    Each learns the pairs of its share of the sensors. That it is said by the
    coordinator, and not taken from the observation, makes all workers learn the same: a
    refused observation is learned by none.
    """

    _key: ClassVar[str] = "learn"

    tick: Natural
    """That of the observation. What is learned already is not learned again, and
    answered again."""
    bits: bytes = b""
    """As in the observation."""
    known: bytes = b""
    """As in the observation."""
    frame: Natural = 0
    """The tick of a key-frame that they send the bands of, before they answer; that is
    the tick learned last. 0: none."""
    begins: Natural = 0
    """In a run that goes on, until they have learned something: how many bytes the
    snapshot of its first key-frame has, for workers that know nothing but its bands."""
    sources: Naturals = ()
    """Literals: what spoke for these implications, and against them, before this was
    learned?"""
    targets: Naturals = ()
    """What each of them implies."""
    changes: tuple[Decision, ...] = ()
    """The decision of the tick learned last, if a sensor comes or goes with it: that is
    learned first."""


class Learned(_Message, frozen=True, omit_defaults=True):
    """What a worker's learning changed in the order, and implications it was asked for.

    The pairs whose implications changed; of sensors that have always read the same the
    first speaks for all. In pieces where they are many.
    """

    _sender: ClassVar[str] = "worker/{0.worker}"
    _key: ClassVar[str] = "learned/worker/{0.worker}"

    worker: Natural
    """The worker's number."""
    tick: Natural
    """That of what it has learned."""
    frame: Natural = 0
    """The tick of a key-frame of which its bands went before; 0: none was asked for."""
    part: Natural = 0
    """Which piece this is, from 0."""
    parts: Numbered = 1
    """How many there are."""
    latter: bytes = b""
    """The latter sensors of the pairs, as `numbers`."""
    former: bytes = b""
    """Their former sensors, as `numbers`."""
    codes: bytes = b""
    """What relates them now, a byte each."""
    links: tuple[WeighedLink, ...] = ()
    """The implications asked for that are of its pairs; in the last piece."""


class Timestamp(msgspec.Struct, frozen=True, gc=False):
    """A time, in seconds and nanoseconds since the epoch."""

    sec: Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
    nsec: Annotated[int, msgspec.Meta(ge=0, le=999_999_999)]


class Image(_Message, frozen=True):
    """What the world looked like at one tick, as it draws itself.

    All fields but `tick` are those of ``foxglove.CompressedImage``, so that image
    panels show it. Nothing follows from it.
    """

    _sender: ClassVar[str] = "world"
    _key: ClassVar[str] = "image"

    tick: Numbered
    """That of the observation that goes before."""
    timestamp: Timestamp
    """When it was drawn."""
    frame_id: str
    """Where it was seen from, as panels want to know: ``world``."""
    data: Annotated[bytes, msgspec.Meta(max_length=LARGEST_IMAGE)]
    """The compressed image."""
    format: ImageFormat
    """How it is compressed."""


class Fault(_Message, frozen=True):
    """The report of a part that dropped a bad or unexpected message."""

    _sender: ClassVar[str] = "{0.who}"
    _key: ClassVar[str] = "fault/{0.who}"

    who: str
    """The part that met it, as in `Message.sender`."""
    what: str
    """What was wrong with it."""


class Leave(_Message, frozen=True):
    """A part's last message: what came before it is all that the part sent."""

    _sender: ClassVar[str] = "{0.who}"
    _key: ClassVar[str] = "leave/{0.who}"

    who: str
    """The part that leaves."""


Message: TypeAlias = (
    Observation
    | Wiring
    | WaveStart
    | Pulse
    | CellReport
    | State
    | Reached
    | Decision
    | KeyFrame
    | Fault
    | Leave
    | WorkerWiring
    | PulseBatch
    | WorkerReport
    | Anomaly
    | Recall
    | Recalled
    | Reminder
    | Band
    | Learn
    | Learned
    | Image
)

TOPICS: dict[str, type[Message]] = {
    kind.__name__.lower(): kind for kind in get_args(Message)
}
"""The messages by topic, which is the first chunk of their keys."""


class Delivery(NamedTuple):
    """A message as it arrives: undecoded, with what travels beside the payload."""

    key: str
    """Below the swarm's prefix."""
    sequence: int
    """The sender's running number over all it sent, from 0."""
    sent: int
    """The sender's clock, nanoseconds since the epoch."""
    payload: bytes
    """The message's JSON."""


_encoder = msgspec.json.Encoder()
_decoder: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


def encode(message: Message) -> bytes:
    """Return the payload of `message`."""
    return _encoder.encode(message)


def decode(key: str, payload: bytes) -> Message:
    """Return the message in `payload`, which came under `key`.

    Raises:
        MessageError: It is no message of this protocol, belongs under another key, as
            what another part says does, or names no part as its sender.
    """
    try:
        message = _decoder.decode(payload)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise MessageError(f"{key}: must hold a message, got {error}") from error
    if message.key != key:
        raise MessageError(
            f"{key}: must hold its own messages, got one for {message.key}"
        )
    field = _NAMING.get(type(message))
    if field is not None and not is_part(named := getattr(message, field)):
        rule = "must be of a part such as cell/3"
        raise MessageError(f"{key}: {rule}, got {named:.40}")
    return message


_NAMING: dict[type[Message], str] = {
    Fault: "who",
    Leave: "who",
    Recalled: "who",
    Band: "who",
    Reminder: "to",
}
"""The field in which a message names a part that stands in its key."""


def is_part(who: str) -> bool:
    """Tell whether `who` can be a part's name, as in ``cell/3``.

    Only then can it stand in a key: there a ``*`` would be any part.
    """
    return _PART.fullmatch(who) is not None


def topic(key: str) -> str:
    """Return the first chunk of `key`: the channel it is recorded in."""
    return key.partition("/")[0]


COORDINATOR_KEYS = (
    *("observation", "cellreport/**", "workerreport/**", "recalled/**", "learned/**"),
    *("fault/**", "leave/**"),
)
"""The key expressions a coordinator listens to."""


def cell_keys(cell: int | str) -> tuple[str, ...]:
    """Return the key expressions a cell listens to; ``*``: any cell."""
    own = tuple(f"{topic}/{cell}" for topic in ("wiring", "wavestart", "recall"))
    others = f"reminder/cell/{cell}", f"pulse/{cell}/**"
    return ("observation", "wavestart", "recall", *own, *others)


def worker_keys(worker: int | str, *, learns: bool = True) -> tuple[str, ...]:
    """Return the key expressions a worker listens to; ``*``: any worker.

    One that learns is told what was observed with what it is to learn.
    """
    heard = ("learn", "band/coordinator") if learns else ("observation",)
    own = f"workerwiring/{worker}", f"reminder/worker/{worker}"
    pulses = f"pulsebatch/{worker}/**"
    return (*heard, *own, "wavestart", "recall", pulses)


_BETWEEN = frozenset({"pulse", "pulsebatch"})
_OF_MANY = _BETWEEN | {
    *("cellreport", "workerreport", "recalled", "band"),
    *("learned", "fault", "leave"),
}


def said_by(who: str, topic: str) -> str:
    """Return the key expression of all that a part can say on a topic.

    Args:
        who: The part; ``cell/*`` is any cell. On a topic that is one part's alone it
            does not matter.
        topic: One of `TOPICS`.
    """
    if topic in _BETWEEN:
        return f"{topic}/*/{who}"
    return f"{topic}/{who}" if topic in _OF_MANY else f"{topic}/**"


def numbers(name: str, data: bytes) -> tuple[int, ...]:
    """Return the numbers in field `name`: four bytes each, signed, the lowest first.

    Raises:
        MessageError: There is a part of a number in it.
    """
    count, rest = divmod(len(data), 4)
    if rest:
        raise MessageError(f"{name}: must be four bytes a number, got {len(data)}")
    return struct.unpack(f"<{count}i", data)


def joined_rings(rings: Sequence[bytes]) -> bytes:
    """Return rings of bits as they travel, see `Recall`."""
    trimmed = [ring.rstrip(b"\0") for ring in rings]
    size = max(map(len, trimmed), default=0)
    return b"".join(ring.ljust(size, b"\0") for ring in trimmed)


def split_rings(name: str, data: bytes, count: int) -> list[bytes]:
    """Return the rings of bits in field `name`.

    Raises:
        MessageError: They are not so many of the same size.
    """
    size, rest = divmod(len(data), count) if count else (0, len(data))
    if rest:
        rule = f"must hold {count} rings of the same size"
        raise MessageError(f"{name}: {rule}, got {len(data)} bytes")
    return [data[place * size : (place + 1) * size] for place in range(count)]
