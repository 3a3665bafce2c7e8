"""Reads a recording once from its first tick to its last, in the background.

A recording is opened without reading it all, and plots, raster, marks and health show
all of it. So they fill up while one looks at something else, and what is not there yet
is said to be so. One reader hands each stretch of ticks to all of them.
"""

import msgspec
import numpy as np

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.marks import Found, HealthView, RunMarks
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import NOT_RECORDED, Ticks, conditions
from neurosnap.apps.viewer.time_series import RASTER_ROOM, Raster, TimeSeries
from neurosnap.errors import RecordingError

_BATCH = 64
"""Ticks read at a time, at most: others wait for as long."""


class RunHistory:
    """What a run was over time, as far as it was read.

    Reading is for one thread at a time and may go on while others look. So an answer
    says how far was read before it looks at what was: later, it would call itself whole
    and lack the last ticks.

    Args:
        run_view: A view that nothing else uses: it is read from one end to the other.
        room: Bytes that the values of the raster may take.
    """

    def __init__(self, run_view: RunView, room: int = RASTER_ROOM) -> None:
        self._run_view = run_view
        self._series = TimeSeries(run_view)
        self._raster = Raster(run_view, room)
        self._marks = RunMarks(run_view)
        self._health = HealthView(run_view)
        self._first = run_view.first
        self.read_to = self._first - 1
        """The last tick that was read; one before the first if none was."""
        self.ended = False
        """There is no more to read, or it cannot be read."""

    @property
    def health(self) -> api.HomeHealth:
        """Which sensors seem broken."""
        return self._health.health

    def series(self, first: int, last: int, points: int) -> api.Series:
        """Return all columns; arguments as of `TimeSeries.curves`."""
        done = self._is_done(last)
        curves = self._series.curves(first, last, points)
        return api.Series(columns=curves, done=done)

    def grown(self) -> api.GrownView:
        """Return what the run has grown."""
        done, read_to = self._is_done(self._run_view.last), self.read_to
        births = self._series.births
        return api.GrownView(
            births=births.listed,
            room=births.room,
            read_to=read_to,
            done=done or not births.body.room,
        )

    def raster(
        self, first: int, last: int, columns: int, sensor: int, sensors: int
    ) -> api.RasterPart:
        """Return what some sensors were; arguments as of `Raster.part`.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        done, read_to = self._is_done(last), self.read_to
        part = self._raster.part(first, last, columns, sensor, sensors)
        return msgspec.structs.replace(part, read_to=read_to, done=done)

    def marks(self, first: int, last: int, bins: int) -> api.Marks:
        """Return what happened; arguments as of `RunMarks.marks`."""
        done, read_to = self._is_done(last), self.read_to
        found = Found(
            alarms=tuple(self._health.raised),
            born=[birth.tick for birth in self._series.births.listed],
            missing=self._series.missing(),
            read_to=read_to,
            done=done,
        )
        return self._marks.marks(first, last, bins, found)

    def beside(self, tick: int, way: int) -> api.Beside:
        """Return the nearest anomaly or alarm before (-1) or after (1) a tick."""
        return self._marks.beside(tick, way, tuple(self._health.raised))

    def _is_done(self, last: int) -> bool:
        """Return whether all there is up to a tick has been read."""
        return self.ended or min(last, self._run_view.last) <= self.read_to

    def read_on(self) -> bool:
        """Read some ticks more; return whether there were any.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        view = self._run_view
        view.grow()
        if self.read_to < self._first:
            self._first = view.first
            self.read_to = self._first - 1
        first = self.read_to + 1
        last = min(view.last, first + view.at_once(_BATCH) - 1)
        if first > last:
            self._health.settle()
            return False
        self._read(first, last)
        self.read_to = last  # last: a reader in between sees whole ticks
        self.ended = False
        return True

    def end(self) -> None:
        """Say that no more can be read."""
        self.ended = True
        self._health.settle()

    def _read(self, first: int, last: int) -> None:
        view = self._run_view
        what = np.full((last - first + 1, view.options.body.count), NOT_RECORDED)
        what = what.astype(np.uint8)
        ticks = None
        try:
            ticks = Ticks(view.tick_index, view.options, first, last, with_waves=False)
        except RecordingError:
            pass  # a message is not what it should be: not known, all of it
        else:
            for tick in range(first, last + 1):
                what[tick - first] = conditions(view.tick_index, ticks, tick)
            self._marks.read(ticks, first, last)
            self._health.read(ticks, first, last)
        self._series.read(ticks, what, first, last)
        self._raster.read(what, first)
