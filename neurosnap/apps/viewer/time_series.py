"""Time series of a run: the state of every sensor at every tick, and other columns.

Both are filled by `neurosnap.apps.viewer.background_reading`, and thinned out where
there are more ticks than can be drawn.
"""

import math
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.viewer.api import (
    COLUMNS,
    COUNTED,
    STATED,
    Column,
    Graph,
    Points,
    RasterPart,
    Tested,
)
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.apps.viewer.tick_messages import (
    CONTRADICTED,
    NOT_RECORDED,
    OFF_PREDICTED,
    ON,
    ON_PREDICTED,
    UNKNOWN,
    Ticks,
)
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.reading_history import History
from neurosnap.recording.replay.grown_sensors import Births

MOST_SENSORS = 500
_MOST_READINGS = 2**28
"""Readings of which occasions are counted, at most: the first, in 64 MB."""
MOST_COLUMNS = 2000
_BLOCK = 4096
"""Ticks for which there is room at first."""
_RASTER_ROOM = 64 * 2**20
"""Bytes of values, at most: of a longer run only every so many ticks are kept."""
_KINDS: dict[Column, tuple[int, ...]] = {
    "on": (ON, ON_PREDICTED),
    "predicted": (OFF_PREDICTED, ON_PREDICTED),
    "contradicted": (CONTRADICTED,),
    "unknown": (UNKNOWN,),
}
"""What each of `COUNTED` counts."""


class TimeSeries:
    """The columns of a run, as far as they have been read."""

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self.births = Births(run_view.options.body)
        """The sensors that were grown."""
        self._first = run_view.first
        self._values: list[NDArray[np.float32]] = []  # of the stretches read

    def read(
        self, ticks: Ticks | None, what: NDArray[np.uint8], first: int, last: int
    ) -> None:
        """Take in the ticks that follow those read before.

        Args:
            ticks: Their messages; None if they cannot be read.
            what: ``(ticks, N)``, what each sensor was; see `conditions`.
            first: The first of them.
            last: The last.
        """
        if not self._values:
            self._first = first
        found = np.full((len(COLUMNS), last - first + 1), np.nan, np.float32)
        if ticks is not None:
            if self._run_view.options.body.room:
                self._follow_births(ticks.decisions, last)
            for tick, state in ticks.states.items():
                stated = [getattr(state, name) for name in STATED]
                counted = self._counts(what[tick - first], tick)
                found[:, tick - first] = [*stated, *counted]
        self._values.append(found)  # last: a reader in between sees whole ticks

    def curves(self, first: int, last: int, points: int) -> dict[Column, Points]:
        """Return all columns from one tick to another, thinned out.

        Args:
            first: From 1 up.
            last: Not before `first`; beyond the last tick: up to that.
            points: How many to return of each, at most, from 4 up.
        """
        first = max(first, self._first)
        last = min(last, self._run_view.last)
        curves = {}
        for row, column in zip(self._all(), COLUMNS, strict=True):
            values = row[first - self._first : max(0, last - self._first + 1)]
            places = thinned(values, points)
            known = [
                value if math.isfinite(value) else None
                for value in values[places].tolist()
            ]
            curves[column] = Points((places + first).tolist(), known)
        return curves

    def missing(self) -> list[int]:
        """Return the ticks of which no state was recorded, as far as it was read."""
        gone = np.isnan(self._all()[0])
        found: list[int] = (np.flatnonzero(gone) + self._first).tolist()
        return found

    def _all(self) -> NDArray[np.float32]:
        """Return a row a column, as far as they have been read."""
        none = np.zeros((len(COLUMNS), 0), np.float32)
        return np.concatenate([none, *self._values], axis=1)

    def _counts(self, what: NDArray[np.uint8], tick: int) -> list[float]:
        """Return how many sensors are what, in the order of `COUNTED`."""
        body = self._run_view.options.body
        if (what == NOT_RECORDED).all():
            return [math.nan] * len(COUNTED)
        # Room for a sensor is none, and one that has retired says nothing.
        there = np.ones(body.count, np.bool_)
        if body.room:
            there[:] = False
            there[self.births.read_at(tick - 1)] = True
        return [float((np.isin(what, _KINDS[name]) & there).sum()) for name in COUNTED]

    def _follow_births(self, decisions: dict[int, wire.Decision], last: int) -> None:
        """Take in what decisions say, and the last key-frame, which knows the rest."""
        found = self._run_view.tick_index.keyframe(last)
        taken: list[wire.Decision | wire.KeyFrame] = [*decisions.values()]
        if found is not None:
            taken.append(found[0])
        for message in sorted(taken, key=lambda each: each.tick):
            with suppress(ValueError):  # no agent's key-frame
                self.births.follow(message)


class Raster:
    """The state of every sensor at every tick, as far as it has been read."""

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._sensors = run_view.options.body.count
        self._most = max(2, _RASTER_ROOM // max(1, self._sensors))
        self._first = run_view.first
        self._step = 1
        self._rows: list[NDArray[np.uint8]] = []

    def read(self, what: NDArray[np.uint8], first: int) -> None:
        """Take in the ticks that follow those read before; arguments as above."""
        if not self._rows:
            self._first = first
        for tick, row in enumerate(what, start=first):
            if (tick - self._first) % self._step == 0:
                self._rows.append(row)
                if len(self._rows) > self._most:
                    self._rows = self._rows[::2]
                    self._step *= 2

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
        )


class Occasions:
    """The readings of a run, as far as they were read, which test its relations."""

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._sensors = run_view.options.body.count
        self._first = run_view.first
        self._history = History(self._sensors, _BLOCK)

    def read(self, ticks: Ticks | None, first: int, last: int) -> None:
        """Take in the ticks that follow those read before; None if they cannot be."""
        history, none = self._history, np.zeros(2 * self._sensors, np.bool_)
        if not history.tick:
            self._first = first
        for tick in range(first, last + 1):
            if history.tick * self._sensors >= _MOST_READINGS:
                return
            if history.tick + 1 == history.length:  # it is never to come round
                history.double()
            on, off = (none if ticks is None else ticks.literals(tick)).reshape(-1, 2).T
            history.record(on, on | off)

    def tested(self, tick: int, graph: Graph) -> Tested:
        """Return how often the relations of the order after a tick were tested."""
        edges = [(edge.source, edge.target) for edge in graph.edges]
        same = [(2 * n.sensor, n.group) for n in graph.nodes if n.group != 2 * n.sensor]
        ends = np.array(edges + same, np.int64).reshape(-1, 2).T
        held = self._until(tick).occasions_held(*ends).tolist()
        nodes = dict.fromkeys((node.sensor for node in graph.nodes), 0)
        for (own, group), tested in zip(same, held[len(edges) :], strict=True):
            nodes[own >> 1] = tested
            nodes[group >> 1] = max(nodes[group >> 1], tested)
        return Tested(edges=held[: len(edges)], nodes=[*nodes.values()])

    def _until(self, tick: int) -> History:
        """Return the readings up to a tick, as far as they were read."""
        ticks = max(0, min(tick - self._first + 1, self._history.tick))
        words, bit = divmod(ticks, 64)
        then = History(self._sensors, 64 * words + 64)
        for ring, whole in (then.on, self._history.on), (then.off, self._history.off):
            ring[:] = whole[: words + 1]
            ring[-1] &= np.uint64((1 << bit) - 1)
        then.tick = ticks
        return then


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
