"""The page's HTTP interface: one struct per answer, sent as JSON.

Literals are numbered as in `neurosnap.sensorium`: ``2s`` is sensor `s` itself and
``2s + 1`` its complement. Ticks count from 1. A page and its
server are always of one version.

=================================================== ============
asked                                               answer
=================================================== ============
``/api/runs``                                       `Runs`
``/api/run``                                        `Run`
``/api/frames?from=&to=``                           `Frames`
``/api/wave?tick=&wave=``                           `WaveView`
``/api/graph?tick=``                                `Graph`
``/api/edge?source=&target=&tick=``                 `Edge`
``/api/series?from=&to=&points=``                   `Series`
``/api/image?tick=``                                an image
``/api/births``                                     `GrownView`
``/api/findings``                                   `FindingList`
``/api/marks?from=&to=&bins=``                      `Marks`
``/api/beside?tick=``                               `Beside`
``/api/depths``                                     `Depths`
``/api/raster?from=&to=&columns=&sensor=&sensors=`` `RasterPart`
``/api/events``                                     `Event`, again
``/api/presence``                                   `Presence`
``/api/difference?tick=&other=&then=``              `.tick_difference.TickDifference`
=================================================== ============

``run=`` says in each which recording is meant, by its number; without it the first.
What is wrong with a question is answered by `Wrong`, with status 400, 404 or 500.
``/api/events`` is a stream of server-sent events without names; a line that starts with
a colon is there to show that the connection is alive.
"""

from typing import Literal, TypeAlias

import msgspec

from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.recording.replay.grown_sensors import RecordedBirth

Bit: TypeAlias = Literal[0, 1] | None
"""On, off, or not known."""

WaveKind: TypeAlias = Literal["state", "signal"]

Column: TypeAlias = Literal[
    "edges",
    "depth",
    "longest",
    "height",
    "pulses",
    "on",
    "predicted",
    "contradicted",
    "unknown",
]
"""A number a tick: what `State` says; how many sensors are believed to be on, are
predicted, contradicted and unknown."""

STATED: tuple[Column, ...] = ("edges", "depth", "longest", "height", "pulses")
"""Those that a message of the state has."""

COUNTED: tuple[Column, ...] = ("on", "predicted", "contradicted", "unknown")
"""Those that count sensors."""

COLUMNS: tuple[Column, ...] = STATED + COUNTED

MOST_FRAMES = 240
MOST_IMAGINED = 200
"""Imagined waves in a frame: a search may take thousands."""
MOST_POINTS = 2000
MOST_BINS = 4000
MOST_FINDINGS = 100


class Stage(msgspec.Struct, frozen=True, kw_only=True):
    """A world that can be drawn."""

    kind: Literal["path", "cycle", "grid"]
    places: int
    """How many there are; they are numbered from 0."""
    coordinates: list[tuple[int, int]]
    """Of each place: x to the right and y upwards in a grid; its number and 0 along a
    path or clockwise around a cycle."""
    width: int
    """How many values x takes."""
    height: int
    """How many values y takes."""
    target: int | None
    """The place that is the target; None if there is none."""
    moves: list[list[int]]
    """For each action, where it leads from each place."""


class Listed(msgspec.Struct, frozen=True, kw_only=True):
    """One recording of the server; its place in the list is its number."""

    name: str
    """The file's name; its path where another has the same name."""
    live: bool


class Runs(msgspec.Struct, frozen=True):
    """All recordings of the server."""

    runs: list[Listed]


class Run(msgspec.Struct, frozen=True, kw_only=True):
    """The run on the page: its sensors, its length, its options."""

    log: str
    """The file's name."""
    source: str
    sensors: tuple[str, ...]
    """Their names when the run starts, those that may be grown last; what is grown
    gets its name in `Graph` and `GrownView`."""
    room: int
    """How many of them may be grown."""
    actions: tuple[str, ...]
    options: dict[str, object]
    """The options of the run, by name."""
    first: int
    """The first tick there is; 1 unless the recording begins later."""
    ticks: int
    """The last tick whose state is known; below `first` if there is none yet."""
    live: bool
    """It still grows."""
    cut: str | None
    """What is missing from a recording that is not whole; None where it is whole."""
    swarm: str
    world: Stage | None
    """None if it cannot be drawn."""


class WaveView(msgspec.Struct, frozen=True, kw_only=True):
    """One wave of a tick, by what the cells reported of it."""

    wave: int
    kind: WaveKind
    signal: list[int]
    """The literals it started from."""
    hops: list[tuple[int, int]] | None
    """Each literal that fired, and the hops at which it was first reached; by hops.
    None if the wave was imagined and comes with others: ask for it alone."""
    depth: int
    """The most of these hops."""
    pulses: int
    settled: bool
    """All of its credit came back: the hops are all there are."""
    action: int | None = None
    """The action, by number, whose consequences it says; None if it is about none."""
    imagined: bool = False
    """It starts in a state that was imagined."""


class PlanView(msgspec.Struct, frozen=True, kw_only=True):
    """The plan that a decision follows."""

    steps: list[int]
    """Actions by number: this one, and those to come."""
    more: int
    """Steps to come that are not named."""
    why: str
    """What it is for."""


class AnomalyView(msgspec.Struct, frozen=True, kw_only=True):
    """An observation that contradicts what was learned before."""

    culprits: list[int]
    """The likeliest of the smallest sets of sensors that can be wrong."""
    others: list[int]
    """Sensors of other such sets."""
    sentence: str
    """What was read against which rule, and how often that was so before."""
    rule: tuple[int, int] | None
    """That rule, the literal that implies and the one implied; None if none is told."""


class Frame(msgspec.Struct, frozen=True, kw_only=True):
    """All that is shown of one tick."""

    tick: int
    at: str
    """When it was observed, by the clock of the run; nothing, if that is not known."""
    bits: list[Bit]
    """What each sensor read."""
    numbers: dict[int, float]
    """Of sensors that compare one, the number that was read."""
    state: list[Bit]
    """The recorded state: which sensors it has on, off, or neither."""
    contradicted: list[int]
    """Sensors that are contradicted: the state has neither of their literals."""
    action: str | None
    """What was decided, by name, several joined by ``+``; None if nothing (yet)."""
    choice: int
    """The same as a number, -1 for nothing."""
    why: str
    begins: bool
    """The tick begins a trajectory."""
    intake: list[str]
    """What a live source had received, and when it did not listen, in words."""
    incoherent: bool
    depth: int
    longest: int
    height: int
    edges: int
    pulses: int
    graph: str
    """As in `Graph`."""
    place: int | None
    """Where in the world this is; None if that is not known."""
    image: int | None = None
    """The tick of the last image at this one or before; None if there is none near."""
    waves: list[WaveView]
    """Oldest first; the state's is the last of kind ``state``. Of imagined ones the
    oldest are here."""
    left_out: int
    """How many imagined waves there are besides."""
    sensors: int
    """How many sensors there are after the tick: those of higher numbers were not grown
    by then."""
    retired: list[int]
    """Those of them that are not read any more."""
    changed: list[Changed]
    """Which sensors the decision grew and retired."""
    plan: PlanView | None
    """None if the decision follows none."""
    anomaly: AnomalyView | None
    """None if nothing was contradicted that rests on as many occasions as the run asks
    for."""


class Frames(msgspec.Struct, frozen=True):
    """The frames asked for, as far as there are any."""

    frames: list[Frame]


class NodeView(msgspec.Struct, frozen=True, kw_only=True):
    """One sensor in the learned order."""

    sensor: int
    name: str
    layer: int
    """The height of its own literal: edges on the longest chain going up from it."""
    group: int = msgspec.field(name="class")
    """The literal that stands for all that its own literal is equivalent to: the same
    for `s` and `t` if they are equivalent, and with the lowest bit flipped (``^ 1``) if
    `s` is equivalent to the complement of `t`."""


class Arrow(msgspec.Struct, frozen=True, kw_only=True):
    """One covering implication, which stands for its contrapositive, too."""

    source: int
    target: int


class Graph(msgspec.Struct, frozen=True, kw_only=True):
    """The learned order after one tick."""

    id: str
    """The same if and only if all the rest is, but for the tick."""
    tick: int
    height: int
    nodes: list[NodeView]
    edges: list[Arrow]
    """Between those that stand for their classes; of an edge and its contrapositive the
    one with the smaller source."""
    classes: list[tuple[int, ...]]
    """Equivalent literals, two or more, each class once with its complement; the first
    stands for all."""


class Edge(msgspec.Struct, frozen=True, kw_only=True):
    """What speaks for and against an implication ``a -> b`` at one tick."""

    source: int
    target: int
    tick: int
    weights: tuple[float, float, float, float]
    """Of ``ab``, ``ab*``, ``a*b``, ``a*b*``; the second speaks against."""
    threshold: float
    """What the second has to be below: of a number, the threshold times all four."""
    holds: bool
    since: int
    """The tick since when it has held, or has not; 0: from the beginning."""


class Points(msgspec.Struct, frozen=True):
    """One column over time, thinned out so that its minima and maxima are kept."""

    ticks: list[int]
    values: list[float | None]
    """None where it is not known."""


class ReadSoFar(msgspec.Struct, frozen=True, kw_only=True):
    """The base of answers that depend on how far the recording has been read."""

    read_to: int = 0
    """The last tick that was read."""
    done: bool = False
    """All that was asked for has been read; if not, ask again."""


class Series(ReadSoFar, frozen=True, kw_only=True):
    """All columns over time."""

    columns: dict[Column, Points]


class GrownView(ReadSoFar, frozen=True, kw_only=True):
    """The sensors that a run has grown."""

    births: tuple[RecordedBirth, ...]
    room: int
    """How many more may be grown."""


class Tested(ReadSoFar, frozen=True, kw_only=True):
    """On how many occasions the relations of an order were tested, and held, by a tick.

    Of the two sides of a test, as for the support of an anomaly, the one that was made
    less often counts.
    """

    edges: list[int]
    """Of each edge of the order."""
    nodes: list[int]
    """Of each sensor of it: as equal to what stands for its class; of that itself, the
    most of the others. 0 where it is equal to none."""


FindingState: TypeAlias = Literal["now", "over", "learned as normal"]


class Finding(msgspec.Struct, frozen=True, kw_only=True):
    """A sensor that was at fault for some time: anomalies in a row, or an alarm."""

    sensors: list[int]
    """The first culprit; then the other sensor of the broken rule, if there is one."""
    tick: int
    """The first tick that told, which is the one to look at."""
    first: int
    """Where it began: of an alarm, the tick of the first evidence."""
    last: int | None
    """Where it ended, so far; None of an alarm that is in force."""
    what: str
    """What was read and what was expected, if a rule says so; or the kind of alarm."""
    sentence: str
    rule: tuple[int, int] | None = None
    """As in `AnomalyView`, at the last tick."""
    alarm: bool = False
    state: FindingState = "now"
    began: str = ""
    """By the clock of the run's zone; empty if the times are not known."""
    lasted: str = ""
    """In ticks, and in time if that is known; empty while it goes on."""
    around: list["RasterPart"] = []
    """The readings of each of `sensors` around its beginning."""


class FindingList(ReadSoFar, frozen=True, kw_only=True):
    """The findings of a run, the newest first."""

    findings: list[Finding]
    left_out: int
    """How many older ones there are besides."""
    looked: bool
    """Whether the run looked for any."""
    progress: str
    """How much is learned of a home's sensors, in a line; empty if none is judged."""


class Marks(ReadSoFar, frozen=True, kw_only=True):
    """The number of events in each of several equal stretches of ticks."""

    first: int
    last: int
    anomalies: list[int]
    """For each stretch, how many of its ticks have one that is told."""
    begins: list[int]
    """How many of its ticks begin a trajectory."""
    times: list[float | None]
    """When the first tick of each was observed, in seconds since 1970; None if
    not known yet, or not recorded."""
    resumed: list[int]
    """The ticks after which the run was taken up again."""
    reached: list[int]
    """How many of its ticks come to the target."""
    born: list[int]
    """How many sensors its ticks grow."""
    missing: list[int]
    """How many of its ticks have no state in the recording."""
    alarms: list[int]
    """How many alarms its ticks raise."""


class DepthCount(msgspec.Struct, frozen=True):
    """How many waves of a kind had a height and a depth; the first of them."""

    kind: WaveKind
    height: int
    depth: int
    count: int
    tick: int
    wave: int


class Depths(ReadSoFar, frozen=True, kw_only=True):
    """Depth against height, of all waves of a run."""

    beyond: int
    """Hops that a wave may take beyond the height, where sensors are equal."""
    counts: list[DepthCount]
    left_out: int
    """Waves that are in no count, as there are too many pairs."""


class Beside(ReadSoFar, frozen=True, kw_only=True):
    """Ticks to go to from one; None if there is none, or it was not read yet."""

    back: int | None
    """The nearest before it with an anomaly or an alarm."""
    on: int | None
    """The nearest after it."""
    day: int | None
    """The last that is 24 hours before it, or more."""
    week: int | None
    """The last that is seven days before it, or more."""


class RasterPart(ReadSoFar, frozen=True, kw_only=True):
    """The states of some sensors over time, one column per shown tick."""

    first: int
    """The tick of the first column."""
    step: int
    """Ticks from one column to the next."""
    columns: int
    sensor: int
    """The first sensor."""
    sensors: int
    values: bytes
    """A byte each, column by column; see the constants of `tick_messages`."""


class Event(msgspec.Struct, frozen=True, kw_only=True):
    """What is new in a growing recording; at most ten events are sent a second.

    The first of a stream has the newest frame, those after it the newest of the frames
    since; a page that wants all of them asks for the others. The frame that came last
    may come again, once more is known of it.
    """

    ticks: int
    """As in `Run`."""
    live: bool
    """As in `Run`; after an event without it the stream ends."""
    cut: str | None
    """As in `Run`."""
    reset: bool
    """It is another recording than before, of the same run: it went on after a part
    had died. What is known of it has to be asked for again."""
    frames: list[Frame]
    """Those that are new, or of which more is known."""


class Waiting(msgspec.Struct, frozen=True):
    """A wave that has not settled."""

    cells: list[tuple[int, int]]
    """The first and the last cell, by sensor, of each part that has not answered it."""
    seconds: float
    """How long ago it began."""


class Presence(msgspec.Struct, frozen=True):
    """Whether the recording is still there."""

    trouble: str | None
    """What has become of it; None if it is there."""
    waiting: Waiting | None = None
    """Of a run that goes on: its last wave, if it has not settled."""


class Wrong(msgspec.Struct, frozen=True):
    """An error: in the request, or of the recording."""

    error: str
