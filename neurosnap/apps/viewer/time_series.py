"""Time series of a run, computed once in the background.

A recording is opened without reading it all, and a plot shows all of it. So the plot
fills up while one looks at something else, and what is not there yet is said to be so.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.viewer.api import COLUMNS, COUNTED, STATED, Column, Grown, Series
from neurosnap.apps.viewer.conditions import (
    CONTRADICTED,
    NOT_RECORDED,
    OFF_PREDICTED,
    ON,
    ON_PREDICTED,
    UNKNOWN,
    conditions,
)
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import Ticks
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.recording.read.births import Births

_BATCH = 64
"""Ticks read at a time, at most: others wait for as long."""
_STARTS_WITH = 1024
_KINDS: dict[Column, tuple[int, ...]] = {
    "on": (ON, ON_PREDICTED),
    "predicted": (OFF_PREDICTED, ON_PREDICTED),
    "contradicted": (CONTRADICTED,),
    "unknown": (UNKNOWN,),
}
"""What each of `COUNTED` counts."""


class TimeSeries:
    """The columns of a run, as far as they have been read.

    Reading is for one thread at a time and may go on while others look.

    Args:
        run_view: A view of its own: it is read from one end to the other.
    """

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self.columns: tuple[Column, ...] = (*COLUMNS, *run_view.scene.columns)
        self._births = Births(run_view.options.body)
        self._first = run_view.first
        self._filled = 0
        self.ended = False
        """Nobody reads on: there is no more, or it cannot be read."""
        self._values = np.full((len(self.columns), _STARTS_WITH), np.nan, np.float32)

    @property
    def read_to(self) -> int:
        """The last tick that was read; one before the first if none was."""
        return self._first + self._filled - 1

    @property
    def done(self) -> bool:
        """All there is has been read."""
        return self.ended or self._run_view.last <= self.read_to

    def read_on(self) -> bool:
        """Read some ticks more; return whether there were any.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        run_view = self._run_view
        run_view.grow()
        if not self._filled:
            self._first = run_view.first
        first = self.read_to + 1
        last = min(run_view.last, first + run_view.at_once(_BATCH) - 1)
        if first > last:
            return False
        found = np.full((len(self.columns), last - first + 1), np.nan, np.float32)
        self._read_states(first, last, found)
        if "err" in self.columns:
            self._read_errors(first, last, found)
        needed = self._filled + found.shape[1]
        if needed > self._values.shape[1]:
            room = np.full((len(self.columns), 2 * needed), np.nan, np.float32)
            room[:, : self._filled] = self._values[:, : self._filled]
            self._values = room
        self._values[:, self._filled : needed] = found
        self._filled = needed  # last: whoever looks meanwhile sees whole ticks
        self.ended = False
        return True

    def end(self) -> None:
        """Say that no more can be read."""
        self.ended = True

    def grown(self) -> Grown:
        """Return what the run has grown, as far as it was read."""
        births = self._births
        done = self.done or not births.body.room
        return Grown(
            births=births.listed,
            room=births.room,
            read_to=self.read_to,
            done=done,
        )

    def series(self, column: str, first: int, last: int, points: int) -> Series:
        """Return a column from one tick to another, thinned out.

        Args:
            column: One of `columns`.
            first: From 1 up.
            last: Not before `first`; beyond the last tick: up to that.
            points: How many to return, at most, from 4 up.

        Raises:
            InvalidValueError: There is no such column.
        """
        known = next((name for name in self.columns if name == column), None)
        if known is None:
            rule = f"must be one of {', '.join(self.columns)}"
            raise InvalidValueError("column", rule, column)
        number = self.columns.index(known)
        first = max(first, self._first)
        last = min(last, self._run_view.last)
        done = self.ended or last <= self.read_to
        row = self._values[number, : self._filled]
        values = row[first - self._first : max(0, last - self._first + 1)]
        places = thinned(values, points)
        return Series(
            column=known,
            ticks=(places + first).tolist(),
            values=[_finite(value) for value in values[places].tolist()],
            done=done,
        )

    def reached(self) -> list[int]:
        """Return the ticks that come to the target, as far as it was read."""
        if "distance" not in self.columns:
            return []
        row = self._values[self.columns.index("distance"), : self._filled]
        there = row == 0
        there[1:] &= row[:-1] != 0
        found: list[int] = (np.flatnonzero(there) + self._first).tolist()
        return found

    def missing(self) -> list[int]:
        """Return the ticks of which no state was recorded, as far as it was read."""
        gone = np.isnan(self._values[0, : self._filled])
        found: list[int] = (np.flatnonzero(gone) + self._first).tolist()
        return found

    def _read_states(self, first: int, last: int, found: NDArray[np.float32]) -> None:
        run_view = self._run_view
        try:
            ticks = Ticks(
                run_view.tick_index, run_view.options, first, last, with_waves=False
            )
        except RecordingError:
            return  # a message is not what it should be: not known, all of it
        if run_view.options.body.room:
            self._follow_births(ticks.decisions, last)
        for tick, state in ticks.states.items():
            found[: len(STATED), tick - first] = [
                getattr(state, name) for name in STATED
            ]
            found[len(STATED) : len(COLUMNS), tick - first] = self._counts(ticks, tick)
        if "distance" in self.columns:
            row = self.columns.index("distance")
            for tick in range(first, last + 1):
                place = run_view.scene.place(ticks.literals(tick))
                found[row, tick - first] = run_view.scene.distance(place)

    def _counts(self, ticks: Ticks, tick: int) -> list[float]:
        """Return how many sensors are what, in the order of `COUNTED`."""
        body = self._run_view.options.body
        what = conditions(self._run_view, ticks, tick)
        if (what == NOT_RECORDED).all():
            return [math.nan] * len(COUNTED)
        # Room for a sensor is none, and one that has retired says nothing.
        there = np.ones(body.count, np.bool_)
        if body.room:
            there[:] = False
            there[self._births.read_at(tick - 1)] = True
        return [float((np.isin(what, _KINDS[name]) & there).sum()) for name in COUNTED]

    def _follow_births(self, decisions: dict[int, wire.Decision], last: int) -> None:
        """Take in what decisions say, and the last key-frame, which knows the rest."""
        frame = self._run_view.tick_index.keyframe(last)
        taken: list[wire.Decision | wire.KeyFrame] = [*decisions.values()]
        if frame is not None:
            taken.append(frame)
        for message in sorted(taken, key=lambda each: each.tick):
            with suppress(ValueError):  # no agent's key-frame
                self._births.take(message)

    def _read_errors(self, first: int, last: int, found: NDArray[np.float32]) -> None:
        row, graph, error = self.columns.index("err"), None, math.nan
        try:
            for learned in self._run_view.recall.walk(first, last):
                if learned.snapshot.poc_graph() is not graph:
                    graph = learned.snapshot.poc_graph()
                    error = self._run_view.scene.errors(graph)
                found[row, learned.tick - first] = error
        except RecordingError:
            return  # an observation is missing: not known from there on


def thinned(values: NDArray[np.float32], points: int) -> NDArray[np.int64]:
    """Return which of many values to draw, so that least and most stay.

    Args:
        values: ``(n,)``; NaN where there is none.
        points: How many to return, at most, from 4 up.

    Returns:
        Ascending places; all of them if they are few enough. Otherwise the values are
        divided into runs as long as one another, and of each the first of the least and
        the first of the largest is there.
    """
    count = len(values)
    if count <= points:
        return np.arange(count)
    runs = points // 2
    edges = np.linspace(0, count, runs + 1).astype(np.int64)
    chosen = set()
    for start, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        run = values[start:stop]
        known = np.isfinite(run)
        if not known.any():
            chosen.add(start)
            continue
        chosen.add(start + int(np.where(known, run, np.inf).argmin()))
        chosen.add(start + int(np.where(known, run, -np.inf).argmax()))
    return np.array(sorted(chosen), np.int64)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
