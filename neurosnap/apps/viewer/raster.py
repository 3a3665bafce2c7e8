"""What sensors read and were believed to be at every tick, read in the background."""

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.viewer.conditions import NOT_RECORDED, conditions
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.errors import InvalidValueError, RecordingError

MOST_SENSORS = 500
MOST_COLUMNS = 2000
_BATCH = 64
"""Ticks read at a time, at most: others wait for as long."""
_ROOM = 64 * 2**20
"""Bytes of values, at most: of a longer run only every so many ticks are kept."""


class RasterPart(msgspec.Struct, frozen=True, kw_only=True):
    """Some sensors over time: a column a tick, of every so many ticks."""

    first: int
    """The tick of the first column."""
    step: int
    """Ticks from one column to the next."""
    columns: int
    sensor: int
    """The first sensor."""
    sensors: int
    values: bytes
    """A byte each, column by column; see the constants of `conditions`."""
    read_to: int
    done: bool
    """All that was asked for has been read; if not, ask again."""


class Raster:
    """The values of a run, as far as they were read.

    Reading is for one thread at a time and may go on while others look.

    Args:
        run_view: A view of its own: it is read from one end to the other.
        room: Bytes that the values may take.
    """

    def __init__(self, run_view: RunView, room: int = _ROOM) -> None:
        self._run_view = run_view
        self._sensors = run_view.options.body.count
        self._most = max(2, room // max(1, self._sensors))
        self._first = run_view.first
        self._read_to = self._first - 1
        self._step = 1
        self._rows: list[NDArray[np.uint8]] = []
        self._ended = False

    def read_on(self) -> bool:
        """Read some ticks more; return whether there were any.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        view = self._run_view
        view.grow()
        if not self._rows:
            self._first = view.first
            self._read_to = self._first - 1
        first = self._read_to + 1
        last = min(view.last, first + view.at_once(_BATCH) - 1)
        if first > last:
            return False
        try:
            ticks = Ticks(view.tick_index, view.options, first, last, with_waves=False)
        except RecordingError:
            ticks = None  # a message is not what it should be: not known, all of it
        for tick in range(first, last + 1):
            if (tick - self._first) % self._step == 0:
                self._rows.append(self._row(ticks, tick))
                if len(self._rows) > self._most:
                    self._rows = self._rows[::2]
                    self._step *= 2
        self._read_to = last
        return True

    def end(self) -> None:
        """Say that no more can be read."""
        self._ended = True

    def part(
        self, first: int, last: int, columns: int, sensor: int, sensors: int
    ) -> RasterPart:
        """Return the values of some ticks and sensors.

        Args:
            first: From 1 up.
            last: Not before `first`; beyond the last tick: up to that.
            columns: How many to return, at most.
            sensor: The first sensor.
            sensors: How many of them, at most.

        Raises:
            InvalidValueError: There is no such sensor.
        """
        if not 0 <= sensor < max(1, self._sensors):
            rule = f"must be in [0, {self._sensors - 1}]"
            raise InvalidValueError("sensor", rule, sensor)
        rows, step = self._rows, self._step  # as they are now
        last = min(last, self._run_view.last)
        start = max(0, -(-(first - self._first) // step))
        stop = max(start, (last - self._first) // step + 1)
        by = max(1, -(-(stop - start) // columns))
        chosen = rows[start:stop:by]
        count = min(sensors, self._sensors - sensor)
        return RasterPart(
            first=self._first + start * step,
            step=by * step,
            columns=len(chosen),
            sensor=sensor,
            sensors=count,
            values=b"".join(row[sensor : sensor + count].tobytes() for row in chosen),
            read_to=self._read_to,
            done=self._ended or last <= self._read_to,
        )

    def _row(self, ticks: Ticks | None, tick: int) -> NDArray[np.uint8]:
        if ticks is None:
            return np.full(self._sensors, NOT_RECORDED, np.uint8)
        return conditions(self._run_view, ticks, tick)
