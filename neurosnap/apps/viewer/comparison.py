"""Compares recordings: where two runs part, and what differs between two ticks.

Compared are readings, decisions, believed states and learned orders, of the sensors
that both have, by their names.
"""

import asyncio
from collections.abc import Iterator, Sequence
from time import monotonic

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.viewer.api import Arrow, Bit, Frame
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.session import ViewSession
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.errors import RecordingError, ShapeError
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literals import from_words
from neurosnap.recording.replay.learning import Learning
from neurosnap.sensorium import unpack

_PATIENCE = 0.3
"""Seconds that an answer takes while there is more to read."""
_BATCH = 32
"""Ticks read at a time."""
_LISTED = 50
"""Edges and classes that are listed."""


class Parted(msgspec.Struct, frozen=True, kw_only=True):
    """Where two recordings part in one thing."""

    tick: int | None
    """The first tick at which they differ; None if they do at none."""
    differing: int | None
    """At how many they do; None if it was looked for the first alone."""
    compared: int
    """At how many ticks both recordings have it."""


class Partings(msgspec.Struct, frozen=True, kw_only=True):
    """Where two recordings part."""

    sensors: int
    """How many sensors both have from the beginning, by name."""
    only_here: list[str]
    """Those that the other lacks."""
    only_there: list[str]
    readings: Parted | None
    """None if they share no sensor; so for states and orders."""
    decisions: Parted | None
    """None if one of the two has no actions."""
    states: Parted | None
    orders: Parted | None
    first: int
    """The first tick that is compared."""
    last: int
    """The last one."""
    read_to: int
    done: bool
    """All of these have been compared; if not, ask again."""


class Felt(msgspec.Struct, frozen=True, kw_only=True):
    """A sensor that is not the same at two ticks; each pair is here and there."""

    sensor: int
    """Its number here."""
    name: str
    reads: tuple[Bit, Bit]
    state: tuple[Bit, Bit]
    contradicted: tuple[bool, bool]


class Only(msgspec.Struct, frozen=True, kw_only=True):
    """What one order implies and the other does not; literals are numbered as here."""

    edges: list[Arrow]
    """Covering edges, the first `_LISTED` of them."""
    classes: list[tuple[int, ...]]
    """Classes of equivalent literals, likewise."""
    count: int
    """How many edges and classes there are."""


class TickDifference(msgspec.Struct, frozen=True, kw_only=True):
    """What differs between a tick here and a tick there."""

    tick: int
    then: int
    """The tick there."""
    sensors: int
    """How many sensors both have, by name."""
    felt: list[Felt] | None
    """The sensors that differ; None if a state is not recorded."""
    actions: tuple[str | None, str | None]
    """What was decided."""
    height: tuple[int, int]
    edges: tuple[int, int]
    """The covering edges that are drawn, of all sensors."""
    here: Only
    there: Only


class Comparisons:
    """Compares the recordings of one server, on views that nothing else uses.

    One question at a time: the event loop does not wait.
    """

    def __init__(self) -> None:
        self._lock = asyncio.Lock()
        self._views: dict[ViewSession, tuple[RunView, RunView]] = {}
        self._side_by_side: SideBySide | None = None  # the pair asked about last

    async def partings(self, here: ViewSession, there: ViewSession) -> Partings:
        """Return where two recordings part, as far as that is known by now.

        Raises:
            RecordingError: One of them cannot be read.
        """

        def work() -> Partings:
            pair = self._view(here), self._view(there)
            known = self._side_by_side
            if known is None or known.views != pair:
                self._side_by_side = known = SideBySide(*pair)
            return known.read_on(_PATIENCE)

        async with self._lock:
            return await asyncio.to_thread(work)

    async def difference(
        self, here: ViewSession, tick: int, there: ViewSession, then: int
    ) -> TickDifference:
        """Return what differs between two ticks.

        Raises:
            InvalidValueError: There is no such tick.
            RecordingError: What is needed cannot be read.
        """

        def work() -> TickDifference:
            return difference(self._view(here), tick, self._view(there), then)

        async with self._lock:
            return await asyncio.to_thread(work)

    def _view(self, session: ViewSession) -> RunView:
        """Return a view of a recording: another one once that is another file."""
        shown, own = self._views.get(session, (None, None))
        if own is None or shown is not session.run_view:
            shown = session.run_view
            own = RunView(shown.path, shown.scene)
            self._views[session] = shown, own
        own.grow()
        return own


class _Tally:
    """Counts at which ticks something differs."""

    def __init__(self) -> None:
        self.tick: int | None = None
        self.differing = self.compared = 0

    def add(self, tick: int, differs: bool) -> None:
        self.compared += 1
        if differs:
            self.differing += 1
            self.tick = self.tick or tick


class SideBySide:
    """Two recordings, compared as far as they were read. For one thread at a time.

    Both are read from their first common tick on, some ticks with every question.

    Args:
        here: A view that nothing else uses.
        there: Likewise.
    """

    def __init__(self, here: RunView, there: RunView) -> None:
        self.views = (here, there)
        bodies = [view.options.body for view in self.views]
        names = [body.sensors[: body.size] for body in bodies]
        places = [{name: place for place, name in enumerate(own)} for own in names]
        common = [name for name in names[0] if name in places[1]]
        self._literals = [literals_of([own[name] for name in common]) for own in places]
        self._only = [
            [name for name in names[k] if name not in places[1 - k]] for k in (0, 1)
        ]
        self._common = len(common)
        self._acts = all(body.actions for body in bodies)
        self._readings, self._decisions = _Tally(), _Tally()
        self._states, self._orders = _Tally(), _Tally()
        self._read_to = self._first - 1

    @property
    def _first(self) -> int:
        return max(view.first for view in self.views)

    @property
    def _last(self) -> int:
        return min(view.last for view in self.views)

    def read_on(self, seconds: float) -> Partings:
        """Compare for some seconds, at least some ticks; return what is known.

        Raises:
            RecordingError: A recording cannot be read any more.
        """
        until = monotonic() + seconds
        for view in self.views:
            view.grow()
        while self._read_to < self._last:
            first = self._read_to + 1
            last = min(self._last, first + _BATCH - 1)
            self._compare(first, last)
            if self._common and self._orders.tick is None:
                self._compare_orders(first, last)
            self._read_to = last
            if monotonic() >= until:
                break
        return Partings(
            sensors=self._common,
            only_here=self._only[0],
            only_there=self._only[1],
            readings=self._told(self._readings, self._common > 0),
            decisions=self._told(self._decisions, self._acts),
            states=self._told(self._states, self._common > 0),
            orders=self._told(self._orders, self._common > 0),
            first=self._first,
            last=self._last,
            read_to=self._read_to,
            done=self._read_to >= self._last,
        )

    def _told(self, tally: _Tally, comparable: bool) -> Parted | None:
        if not comparable:
            return None
        counted = None if tally is self._orders else tally.differing
        return Parted(tick=tally.tick, differing=counted, compared=tally.compared)

    def _compare(self, first: int, last: int) -> None:
        read = [
            Ticks(view.tick_index, view.options, first, last, with_waves=False)
            for view in self.views
        ]
        for tick in range(first, last + 1):
            if all(tick in ticks.observations for ticks in read):
                here, there = (
                    ticks.literals(tick)[own]
                    for ticks, own in zip(read, self._literals, strict=True)
                )
                self._readings.add(tick, not np.array_equal(here, there))
            if all(tick in ticks.decisions for ticks in read):
                one, other = (
                    view.named(ticks.decisions[tick].action)
                    for ticks, view in zip(read, self.views, strict=True)
                )
                self._decisions.add(tick, one != other)
            if all(tick in ticks.states for ticks in read):
                mine, its = (
                    self._believed(k, ticks, tick) for k, ticks in enumerate(read)
                )
                self._states.add(tick, not np.array_equal(mine, its))

    def _believed(self, k: int, ticks: Ticks, tick: int) -> NDArray[np.bool_]:
        view = self.views[k]
        try:
            state = unpack(ticks.states[tick].literals, 2 * view.options.body.count)
        except ShapeError as error:
            place = f"{view.path}: tick {tick}: /state"
            raise RecordingError(f"{place}: {error}") from error
        return state[self._literals[k]]

    def _compare_orders(self, first: int, last: int) -> None:
        """Look for the first tick at which the orders differ.

        Where an observation is missing, orders are not known up to the next key-frame:
        these ticks are not compared.
        """
        walks = [_walk(view, first, last) for view in self.views]
        before: tuple[PocGraph, ...] = ()
        differs = False
        for here, there in zip(*walks, strict=True):
            if here is None or there is None:
                continue
            graphs = here.snapshot.poc_graph(), there.snapshot.poc_graph()
            # The same objects as long as nothing is learned: nothing to work out again.
            if not before or any(
                a is not b for a, b in zip(graphs, before, strict=True)
            ):
                one, other = map(restricted, graphs, self._literals)
                differs = not np.array_equal(one.closed, other.closed)
            before = graphs
            self._orders.add(here.tick, differs)
            if differs:
                return


def _walk(view: RunView, first: int, last: int) -> Iterator[Learning | None]:
    """Yield what was learned by each tick; None where that is not known."""
    tick = first
    while tick <= last:
        try:
            for learned in view.recall.walk(tick, last):
                tick = learned.tick + 1
                yield learned
        except RecordingError:
            known = min(view.tick_index.keyframe_after(tick), last + 1)
            yield from (None for _ in range(tick, known))
            tick = known


def difference(here: RunView, tick: int, there: RunView, then: int) -> TickDifference:
    """Return what differs between two ticks.

    Args:
        here: The one recording.
        tick: The tick in it.
        there: The other recording; may be the same.
        then: The tick in that.

    Raises:
        InvalidValueError: There is no such tick.
        RecordingError: An observation or a key-frame that is needed is not there.
    """
    one, other = here.learned(tick), there.learned(then)
    drawn, their_drawn = here.graph(tick), there.graph(then)
    own = one.body.sensors[: one.body.size]
    theirs = {name: k for k, name in enumerate(other.body.sensors[: other.body.size])}
    pairs = [(k, theirs[name], name) for k, name in enumerate(own) if name in theirs]
    places = literals_of([k for k, _, _ in pairs])
    mine = restricted(one.snapshot.poc_graph(), places)
    its = restricted(other.snapshot.poc_graph(), literals_of([k for _, k, _ in pairs]))
    frames = here.frames(tick, tick), there.frames(then, then)
    return TickDifference(
        tick=tick,
        then=then,
        sensors=len(pairs),
        felt=_felt(frames[0][0], frames[1][0], pairs) if all(frames) else None,
        actions=(_action(frames[0]), _action(frames[1])),
        height=(drawn.height, their_drawn.height),
        edges=(len(drawn.edges), len(their_drawn.edges)),
        here=_only(mine, its, places.tolist()),
        there=_only(its, mine, places.tolist()),
    )


def _action(frames: list[Frame]) -> str | None:
    return frames[0].action if frames else None


def _felt(frame: Frame, other: Frame, pairs: list[tuple[int, int, str]]) -> list[Felt]:
    """Return the sensors that differ; each with its numbers here and there."""
    against = set(frame.contradicted), set(other.contradicted)
    felt = (
        Felt(
            sensor=one,
            name=name,
            reads=(frame.bits[one], other.bits[its]),
            state=(frame.state[one], other.state[its]),
            contradicted=(one in against[0], its in against[1]),
        )
        for one, its, name in pairs
    )
    return [
        each
        for each in felt
        if any(a != b for a, b in (each.reads, each.state, each.contradicted))
    ]


def _only(graph: PocGraph, other: PocGraph, places: list[int]) -> Only:
    edges, classes = only_in(graph, other), only_equal(graph, other)
    return Only(
        edges=[
            Arrow(
                source=places[a],
                target=places[b],
                kind="inhibit" if b & 1 else "excite",
            )
            for a, b in edges[:_LISTED]
        ],
        classes=[tuple(places[a] for a in members) for members in classes[:_LISTED]],
        count=len(edges) + len(classes),
    )


def literals_of(sensors: Sequence[int]) -> NDArray[np.intp]:
    """Return the literals of some sensors: ``(2M,)``, each beside its complement."""
    own = 2 * np.asarray(sensors, np.intp)
    return np.stack([own, own + 1], axis=1).ravel()


def restricted(graph: PocGraph, literals: NDArray[np.intp]) -> PocGraph:
    """Return the order among some literals of a graph, in their order.

    Args:
        graph: Over ``2N`` literals.
        literals: ``(2M,)``, each literal beside its complement. O(N²) time.
    """
    if np.array_equal(literals, np.arange(len(graph))):
        return graph
    closed = from_words(graph.closed, len(graph))
    return PocGraph(closed[np.ix_(literals, literals)])


def only_in(graph: PocGraph, other: PocGraph) -> list[tuple[int, int]]:
    """Return the covering edges of one order that the other does not imply.

    Args:
        graph: The one.
        other: Over the same sensors.

    Returns:
        Pairs of literals, of an edge and its contrapositive the one with the smaller
        source. What is implied by way of others is no difference, and what equivalent
        literals share is in `only_equal`. O(N³/64) time where the orders are new.
    """
    below, above = np.nonzero(graph.hasse())
    standing = graph.representative
    chosen = (below <= above ^ 1) & (standing[below] != standing[above])
    below, above = below[chosen], above[chosen]
    bits = other.closed[below, above >> 6] >> (above & 63).astype(np.uint64)
    lacking = (bits & np.uint64(1)) == 0
    return list(zip(below[lacking].tolist(), above[lacking].tolist(), strict=True))


def only_equal(graph: PocGraph, other: PocGraph) -> list[tuple[int, ...]]:
    """Return the classes of one order that are not equivalent in the other.

    Args:
        graph: The one.
        other: Over the same sensors.

    Returns:
        Classes of two literals and more, each once with its complement.
    """
    standing = other.representative
    return [
        members
        for members in graph.classes()
        if members[0] % 2 == 0 and len(set(standing[list(members)].tolist())) > 1
    ]
