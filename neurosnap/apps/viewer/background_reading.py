"""Reads a recording in the background, for plots, health and marks of the page.

A recording is opened without reading it all, and plots, raster, marks and health show
all of it. So they fill up while one looks at something else, and what is not there yet
is said to be so. One reader hands each stretch of ticks to all of them.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from contextlib import suppress
from typing import TypeVar

import msgspec
import numpy as np
from msgspec.structs import replace
from numpy.typing import NDArray

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.api import HomeHealth, RaisedAlarm
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import NOT_RECORDED, Ticks, conditions
from neurosnap.apps.viewer.time_series import DepthCounts, Raster, TimeSeries
from neurosnap.errors import MessageError, RecordingError, ShapeError
from neurosnap.health.alarm import News
from neurosnap.health.alarm_budget import NEVER
from neurosnap.health.monitor import Follower
from neurosnap.protocol.anomaly_report import with_support
from neurosnap.recording.read.recorded_readings import own_readings

T = TypeVar("T", bound=api.ReadSoFar)

_BATCH = 64
"""Ticks read at a time, at most: others wait for as long."""


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
        self._depths = DepthCounts()
        self._health = HealthView(run_view)
        self._marks = RunMarks(run_view, self._series, self._health)
        self.read_to = run_view.first - 1
        """The last tick that was read; one before the first if none was."""
        self.ended = False
        """No more can be read."""

    @property
    def health(self) -> api.HomeHealth:
        """Which sensors seem broken."""
        so_far = self._so_far(self._run_view.last)
        return _with(so_far, self._health.health)

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

    def beside(self, tick: int, way: int) -> api.Beside:
        """Return the nearest anomaly or alarm before (-1) or after (1) a tick."""
        return self._marks.beside(tick, way)

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
        last = min(view.last, first + view.at_once(_BATCH) - 1)
        if first > last:
            return False
        self._read(first, last)
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
            self._health.read(ticks, first, last)
        self._series.read(ticks, what, first, last)
        self._raster.read(what, first)


def _with(so_far: api.ReadSoFar, part: T) -> T:
    """Return an answer that says how far was read; one may be done before all was."""
    done = part.done or so_far.done
    return replace(part, read_to=so_far.read_to, done=done)


class HealthView:
    """The health of a run's sensors, as far as its readings were read."""

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._follower: Follower | None = None
        self.raised: list[RaisedAlarm] = []
        """The alarms there were, by tick."""
        self._in_force: dict[str, int] = {}  # sensors: the places of their alarms there
        options = run_view.options
        if options.alarms != NEVER:
            self._follower = Follower(options.body.own, options.alarms, options.zone)
        self.health = self._now()
        """How the sensors are now."""

    def read(self, ticks: Ticks, first: int, last: int) -> None:
        """Take in the readings of the ticks that follow those read before.

        To learn anew takes seconds, sometimes.
        """
        if self._follower is None:
            return
        body = self._run_view.options.body
        for tick in range(first, last + 1):
            observation = ticks.observations.get(tick)
            if observation is None:
                continue
            with suppress(ShapeError):  # it is of other sensors
                at, on, known, begins = own_readings(
                    observation, ticks.sent[tick], body
                )
                for news in self._follower.observe(on, known, at, begins=begins):
                    self._take(news, tick)
        self.health = self._now()

    def _take(self, news: News, tick: int) -> None:
        """Take in what an observation told."""
        place = self._in_force.pop(news.sensor, None)
        if place is not None:
            was = self.raised[place]
            self.raised[place] = msgspec.structs.replace(was, until=tick)
        if news.alarm is not None:
            number = self._run_view.options.body.own.index(news.sensor)
            self._in_force[news.sensor] = len(self.raised)
            self.raised.append(RaisedAlarm(tick, number, news.alarm.line()))

    def _now(self) -> HomeHealth:
        if self._follower is None:
            return HomeHealth(progress="", alarms=[], sensors=[], done=True)
        standing = self._follower.standing
        return HomeHealth(
            progress=standing.progress.line(),
            alarms=[alarm.line() for alarm in standing.alarms],
            sensors=self._follower.monitor.sensors,
        )


class RunMarks:
    """The events of a run, as far as its recording has been read.

    Args:
        run_view: The view that is read.
        series: Says which sensors were grown, and which states are not recorded.
        health: Says which alarms were raised.
    """

    def __init__(
        self, run_view: RunView, series: TimeSeries, health: HealthView
    ) -> None:
        self._run_view = run_view
        self._series = series
        self._health = health
        self._anomalies: list[int] = []  # ticks, ascending
        self._begins: list[int] = []
        self._times: dict[int, float] = {}  # tick -> seconds since 1970
        self._reached: list[int] = []  # ticks that come to the target
        self._is_there = False  # at the last tick that was read

    def read(self, ticks: Ticks, first: int, last: int) -> None:
        """Take in the messages of the ticks that follow those read before."""
        for tick, observation in sorted(ticks.observations.items()):
            self._times[tick] = ticks.sent[tick] / 1e9
            if observation.begins:
                self._begins.append(tick)
        for tick, anomaly in sorted(ticks.anomalies.items()):
            with suppress(MessageError):  # it is none
                if with_support(anomaly, self._run_view.options.support):
                    self._anomalies.append(tick)
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
        inside = [one for one in self._health.raised if first <= one.tick <= last]
        resumed = self._run_view.recording.resumed
        born = [birth.tick for birth in self._series.births.listed]
        return api.Marks(
            first=first,
            last=last,
            anomalies=_counted(self._anomalies, edges),
            begins=_counted(self._begins, edges),
            times=[self._times.get(math.ceil(edge)) for edge in edges[:-1].tolist()],
            resumed=[tick for tick in resumed if first <= tick <= last],
            reached=_counted(self._reached, edges),
            born=_counted(born, edges),
            missing=_counted(self._series.missing(), edges),
            alarms=inside[: api.MOST_ALARMS],
        )

    def beside(self, tick: int, way: int) -> api.Beside:
        """Return the nearest anomaly or alarm before (-1) or after (1) a tick."""
        alarms = (alarm.tick for alarm in self._health.raised)
        told = sorted({*self._anomalies, *alarms})
        place = bisect_right(told, tick) if way > 0 else bisect_left(told, tick) - 1
        there = 0 <= place < len(told)
        return api.Beside(told[place] if there else None)


def _counted(ticks: Sequence[int], edges: NDArray[np.float64]) -> list[int]:
    """Return how many ticks lie in each stretch; the edges are one more."""
    counted: list[int] = np.diff(np.searchsorted(np.array(ticks), edges)).tolist()
    return counted
