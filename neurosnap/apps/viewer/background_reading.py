"""Reads a recording in the background, for plots, marks and findings of the page.

A recording is opened without reading it all, and plots, raster, marks and findings show
all of it. So they fill up while one looks at something else, and what is not there yet
is said to be so. One reader hands each stretch of ticks to all of them.
"""

import math
import time
from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.findings import RunFindings
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import NOT_RECORDED, Ticks, conditions
from neurosnap.apps.viewer.time_series import Occasions, Raster, TimeSeries
from neurosnap.errors import RecordingError
from neurosnap.poc.order.graph import BEYOND_HEIGHT

_MOST_PLACES = 2000
"""Pairs of a height and a depth: there may be as many heights as sensors."""
T = TypeVar("T", bound=api.ReadSoFar)

_BATCH = 16
"""Ticks read at a time, at most."""
_TURN = 0.1
"""Seconds that this takes, about: what is asked waits for as long."""
_DAY = 86_400.0
"""Seconds."""


class RunHistory:
    """The course of a run over time, as far as its recording has been read.

    Reading is for one thread at a time and may go on while others look. So an answer
    says how far was read before it looks at what was: later, it would call itself whole
    and lack the last ticks.

    Args:
        run_view: A view that nothing else uses: it is read from one end to the other.
    """

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._series = TimeSeries(run_view)
        self._raster = Raster(run_view)
        self._occasions = Occasions(run_view)
        self._depths = DepthCounts()
        self._findings = RunFindings(run_view.options, self._series, self._raster)
        self._marks = RunMarks(run_view, self._series, self._findings)
        self.read_to = run_view.first - 1
        """The last tick that was read; one before the first if none was."""
        self.ended = False
        """No more can be read."""
        self._batch = run_view.at_once(_BATCH)
        """Ticks to read next."""

    def series(self, first: int, last: int, points: int) -> api.Series:
        """Return all columns; arguments as of `TimeSeries.curves`."""
        so_far = self._so_far(last)
        curves = self._series.curves(first, last, points)
        return _with(so_far, api.Series(columns=curves))

    def grown(self) -> api.GrownView:
        """Return the sensors that the run has grown."""
        so_far, births = self._so_far(self._run_view.last), self._series.births
        grows = births.body.room > 0
        grown = api.GrownView(births=births.listed, room=births.room, done=not grows)
        return _with(so_far, grown)

    def findings(self) -> api.FindingList:
        """Return which sensors were at fault, and when."""
        so_far = self._so_far(self._run_view.last)
        return _with(so_far, self._findings.listed())

    def raster(
        self, first: int, last: int, columns: int, sensor: int, sensors: int
    ) -> api.RasterPart:
        """Return what some sensors were; arguments as of `Raster.part`.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        so_far = self._so_far(last)
        part = self._raster.part(first, last, columns, sensor, sensors)
        return _with(so_far, part)

    def marks(self, first: int, last: int, bins: int) -> api.Marks:
        """Return what happened; arguments as of `RunMarks.marks`."""
        so_far = self._so_far(last)
        return _with(so_far, self._marks.marks(first, last, bins))

    def depths(self) -> api.Depths:
        """Return how many waves had which height and depth."""
        so_far = self._so_far(self._run_view.last)
        return _with(so_far, self._depths.depths())

    def tested(self, tick: int, graph: api.Graph) -> api.Tested:
        """Return how often an order was tested, as `Occasions.tested`."""
        so_far = self._so_far(tick)
        return _with(so_far, self._occasions.tested(tick, graph))

    def beside(self, tick: int) -> api.Beside:
        """Return the ticks to go to from one."""
        return _with(self._so_far(tick), self._marks.beside(tick))

    def _so_far(self, last: int) -> api.ReadSoFar:
        """Return how far was read, and whether that is all there is up to a tick."""
        done = self.ended or min(last, self._run_view.last) <= self.read_to
        return api.ReadSoFar(read_to=self.read_to, done=done)

    def read_on(self) -> bool:
        """Read some ticks more; return whether there were any.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        view = self._run_view
        view.grow()
        first = max(self.read_to + 1, view.first)
        last = min(view.last, first + self._batch - 1)
        if first > last:
            return False
        began = time.perf_counter()
        self._read(first, last)
        pace = self._batch / (time.perf_counter() - began)
        self._batch = max(1, min(view.at_once(_BATCH), int(pace * _TURN)))
        self.read_to = last  # last: a reader in between sees whole ticks
        self.ended = False
        return True

    def _read(self, first: int, last: int) -> None:
        view = self._run_view
        shape = last - first + 1, view.options.body.count
        what = np.full(shape, NOT_RECORDED, np.uint8)
        ticks = None
        try:
            ticks = Ticks(view.tick_index, view.options, first, last, with_waves=False)
        except RecordingError:
            pass  # a message is not what it should be: not known, all of it
        else:
            for tick in range(first, last + 1):
                what[tick - first] = conditions(view.tick_index, ticks, tick)
            self._depths.read(ticks)
            self._marks.read(ticks, first, last)
        self._series.read(ticks, what, first, last)
        self._raster.read(what, first)
        self._occasions.read(ticks, first, last)
        if ticks is not None:
            self._findings.read(ticks, first, last)


def _with(so_far: api.ReadSoFar, part: T) -> T:
    """Return an answer that says how far was read; one may be done before all was."""
    done = part.done or so_far.done
    return replace(part, read_to=so_far.read_to, done=done)


class DepthCounts:
    """How many waves had which height and depth, as far as they have been read."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, int, int], api.DepthCount] = {}
        self._left_out = 0

    def read(self, ticks: Ticks) -> None:
        """Take in the waves of ticks that follow those read before."""
        for state in ticks.states.values():
            self._add("state", state)
        for reached in ticks.reached.values():
            self._add("signal", reached)

    def _add(self, kind: api.WaveKind, wave: wire.State | wire.Reached) -> None:
        place = kind, wave.height, wave.depth
        if place not in self._found and len(self._found) == _MOST_PLACES:
            self._left_out += 1
            return
        first = api.DepthCount(*place, count=0, tick=wave.tick, wave=wave.wave)
        first = self._found.get(place, first)
        self._found[place] = replace(first, count=first.count + 1)

    def depths(self) -> api.Depths:
        """Return the counts."""
        counts, left_out = list(self._found.values()), self._left_out
        return api.Depths(beyond=BEYOND_HEIGHT, counts=counts, left_out=left_out)


class RunMarks:
    """The events of a run, as far as its recording has been read.

    Args:
        run_view: The view that is read.
        series: Says which sensors were grown, and which states are not recorded.
        findings: Says which anomalies and alarms there were, and when.
    """

    def __init__(
        self, run_view: RunView, series: TimeSeries, findings: RunFindings
    ) -> None:
        self._run_view = run_view
        self._series = series
        self._findings = findings
        self._begins: list[int] = []  # ticks, ascending
        self._reached: list[int] = []  # ticks that come to the target
        self._is_there = False  # at the last tick that was read

    def read(self, ticks: Ticks, first: int, last: int) -> None:
        """Take in the messages of the ticks that follow those read before."""
        for tick, observation in sorted(ticks.observations.items()):
            if observation.begins:
                self._begins.append(tick)
        for tick in range(first, last + 1):
            was_there = self._is_there
            self._is_there = self._run_view.scene.is_at_target(ticks.literals(tick))
            if self._is_there and not was_there:
                self._reached.append(tick)

    def marks(self, first: int, last: int, bins: int) -> api.Marks:
        """Return what happened from one tick to another, in as many stretches.

        Args:
            first: From 1 up.
            last: Not before `first`; beyond the last tick: up to that.
            bins: How many stretches, from 1 up; fewer where there are fewer ticks.
        """
        first = max(first, self._run_view.first)
        last = min(last, self._run_view.last)
        ticks = max(0, last - first + 1)
        edges = np.linspace(first, first + ticks, min(bins, ticks) + 1)
        found = self._findings
        resumed = self._run_view.recording.resumed
        born = [birth.tick for birth in self._series.births.listed]
        return api.Marks(
            first=first,
            last=last,
            anomalies=_counted(found.anomalies, edges),
            begins=_counted(self._begins, edges),
            times=[found.times.get(math.ceil(edge)) for edge in edges[:-1].tolist()],
            resumed=[tick for tick in resumed if first <= tick <= last],
            reached=_counted(self._reached, edges),
            born=_counted(born, edges),
            missing=_counted(self._series.missing(), edges),
            alarms=_counted([alarm.tick for alarm in found.alarms], edges),
        )

    def beside(self, tick: int) -> api.Beside:
        """Return the nearest anomalies or alarms, and the ticks of some time before."""
        found = self._findings
        told = {*found.anomalies, *(alarm.tick for alarm in found.alarms)}
        times = list(found.times.items())  # at once: there may soon be more
        now = found.times.get(tick, -math.inf)
        day, week = (
            max((t for t, at in times if t < tick and at <= now - ago), default=None)
            for ago in (_DAY, 7 * _DAY)
        )
        return api.Beside(
            back=max((one for one in told if one < tick), default=None),
            on=min((one for one in told if one > tick), default=None),
            day=day,
            week=week,
        )


def _counted(ticks: Sequence[int], edges: NDArray[np.float64]) -> list[int]:
    """Return how many ticks lie in each stretch; the edges are one more."""
    counted: list[int] = np.diff(np.searchsorted(np.array(ticks), edges)).tolist()
    return counted
