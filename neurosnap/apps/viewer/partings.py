"""Where two recordings part: readings, decisions, believed states, learned orders.

Both are read side by side from their first common tick on, some ticks with every
question, so that a long recording is answered for bit by bit and none is read that
nobody asks about. Compared are the sensors that both runs begin with, by their names.
"""

from collections.abc import Iterator
from time import monotonic

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.viewer.order_difference import is_same, literals_of, restricted
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.errors import RecordingError, ShapeError
from neurosnap.recording.read.learning import Learning
from neurosnap.sensorium import unpack

_BATCH = 32
"""Ticks read at a time."""


class Parted(msgspec.Struct, frozen=True, kw_only=True):
    """Where two recordings part in one thing."""

    tick: int | None
    """The first tick at which they differ; None: at none of those compared."""
    differing: int | None
    """At how many they do; None: it was looked for the first alone."""
    compared: int
    """At how many ticks both recordings have it."""


class Partings(msgspec.Struct, frozen=True, kw_only=True):
    """Where two recordings part."""

    sensors: int
    """How many sensors both have from the beginning, by name."""
    only_here: list[str]
    """Those that the other lacks."""
    only_there: list[str]
    readings: Parted
    decisions: Parted
    states: Parted
    orders: Parted
    first: int
    """The first tick that is compared."""
    last: int
    """The last one."""
    read_to: int
    done: bool
    """All of these have been compared; if not, ask again."""


class _Tally:
    """Counts at which ticks something differs."""

    def __init__(self) -> None:
        self.tick: int | None = None
        self.differing = self.compared = 0

    def take(self, tick: int, differs: bool) -> None:
        self.compared += 1
        if differs:
            self.differing += 1
            self.tick = self.tick or tick

    def told(self, *, counted: bool = True) -> Parted:
        return Parted(
            tick=self.tick,
            differing=self.differing if counted else None,
            compared=self.compared,
        )


class SideBySide:
    """Two recordings, compared as far as they were read. For one thread at a time.

    Args:
        here: A view of its own.
        there: Likewise.
    """

    def __init__(self, here: RunView, there: RunView) -> None:
        self._views = (here, there)
        bodies = [view.options.body for view in self._views]
        names = [body.sensors[: body.size] for body in bodies]
        places = [{name: place for place, name in enumerate(own)} for own in names]
        common = [name for name in names[0] if name in places[1]]
        self._literals = [literals_of([own[name] for name in common]) for own in places]
        self._only = [
            [name for name in names[k] if name not in places[1 - k]] for k in (0, 1)
        ]
        self._common = len(common)
        self._readings, self._decisions = _Tally(), _Tally()
        self._states, self._orders = _Tally(), _Tally()
        self._read_to = self._first - 1

    @property
    def _first(self) -> int:
        return max(view.first for view in self._views)

    @property
    def _last(self) -> int:
        return min(view.last for view in self._views)

    def read_on(self, seconds: float) -> Partings:
        """Compare for some seconds, at least some ticks; return what is known.

        Raises:
            RecordingError: A recording cannot be read any more.
        """
        until = monotonic() + seconds
        for view in self._views:
            view.grow()
        while self._read_to < self._last:
            first = self._read_to + 1
            last = min(self._last, first + _BATCH - 1)
            self._compare(first, last)
            if self._orders.tick is None:
                self._compare_orders(first, last)
            self._read_to = last
            if monotonic() >= until:
                break
        return Partings(
            sensors=self._common,
            only_here=self._only[0],
            only_there=self._only[1],
            readings=self._readings.told(),
            decisions=self._decisions.told(),
            states=self._states.told(),
            orders=self._orders.told(counted=False),
            first=self._first,
            last=self._last,
            read_to=self._read_to,
            done=self._read_to >= self._last,
        )

    def _compare(self, first: int, last: int) -> None:
        read = [
            Ticks(view.tick_index, view.options, first, last, with_waves=False)
            for view in self._views
        ]
        for tick in range(first, last + 1):
            if all(tick in ticks.observations for ticks in read):
                here, there = (
                    ticks.literals(tick)[own]
                    for ticks, own in zip(read, self._literals, strict=True)
                )
                self._readings.take(tick, not np.array_equal(here, there))
            if all(tick in ticks.decisions for ticks in read):
                one, other = (
                    view.named(ticks.decisions[tick].action)
                    for ticks, view in zip(read, self._views, strict=True)
                )
                self._decisions.take(tick, one != other)
            if all(tick in ticks.states for ticks in read):
                mine, its = (
                    self._believed(k, ticks, tick) for k, ticks in enumerate(read)
                )
                self._states.take(tick, not np.array_equal(mine, its))

    def _believed(self, k: int, ticks: Ticks, tick: int) -> NDArray[np.bool_]:
        view = self._views[k]
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
        walks = [self._walk(view, first, last) for view in self._views]
        before: tuple[object, ...] = ()
        for here, there in zip(*walks, strict=True):
            if here is None or there is None:
                continue
            graphs = here.snapshot.poc_graph(), there.snapshot.poc_graph()
            # The same objects as long as nothing is learned: nothing to work out again.
            differs = False
            if graphs != before and not self._learned_same(here, there):
                one, other = (
                    restricted(graph, own)
                    for graph, own in zip(graphs, self._literals, strict=True)
                )
                differs = not is_same(one, other)
            before = graphs
            self._orders.take(here.tick, differs)
            if differs:
                return

    def _learned_same(self, here: Learning, there: Learning) -> bool:
        """Return whether the same was learned, pair by pair: a quick answer."""
        whole = all(
            len(own) == 2 * view.options.body.count
            for own, view in zip(self._literals, self._views, strict=True)
        )
        here_own, there_own = self._literals
        same_order = np.array_equal(here_own, there_own)
        return (
            whole
            and same_order
            and np.array_equal(here.snapshot.codes, there.snapshot.codes)
        )

    @staticmethod
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
