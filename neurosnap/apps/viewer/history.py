"""Reads a recording once from its first tick to its last, in the background.

A recording is opened without reading it all, and plots, raster, marks and health show
all of it. So they fill up while one looks at something else, and what is not there yet
is said to be so. One reader hands each stretch of ticks to all of them.
"""

from typing import TypeVar

import numpy as np
from msgspec.structs import replace

from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.marks import HealthView, RunMarks
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import NOT_RECORDED, Ticks, conditions
from neurosnap.apps.viewer.time_series import Raster, TimeSeries
from neurosnap.errors import RecordingError

T = TypeVar("T", bound=api.ReadSoFar)

_BATCH = 64
"""Ticks read at a time, at most: others wait for as long."""


class RunHistory:
    """What a run was over time, as far as it was read.

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
        """Return what the run has grown."""
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
            self._marks.read(ticks, first, last)
            self._health.read(ticks, first, last)
        self._series.read(ticks, what, first, last)
        self._raster.read(what, first)


def _with(so_far: api.ReadSoFar, part: T) -> T:
    """Return an answer that says how far was read; one may be done before all was."""
    done = part.done or so_far.done
    return replace(part, read_to=so_far.read_to, done=done)
