"""What happened at which ticks of a run, found in the background.

For the strip over the slider: anomalies, edges rewired and beginnings of trajectories,
and what others that read the run have found.
"""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.apps.viewer import api
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import MessageError
from neurosnap.protocol.anomaly_messages import with_support
from neurosnap.recording.read.tick_index import ChunkMessages

_BATCH = 256
"""Ticks read at a time, or a chunk of them: others wait for as long."""
_EDGE = 8
"""Bytes of an edge in a worker's wiring."""


class Found(NamedTuple):
    """What others have found, as far as they have read."""

    alarms: Sequence[api.RaisedAlarm] = ()
    """By tick."""
    reached: Sequence[int] = ()
    """The ticks that come to the target."""
    born: Sequence[int] = ()
    """The ticks that grow a sensor, each as often as it grows one."""
    missing: Sequence[int] = ()
    """The ticks of which no state was recorded."""
    done: bool = True
    """They have read all."""


NOTHING = Found()
"""Others have nothing to tell."""


class RunMarks:
    """What happened in a run, as far as it was read.

    Reading is for one thread at a time and may go on while others look.

    Args:
        run_view: A view of its own: it is read from one end to the other.
    """

    def __init__(self, run_view: RunView) -> None:
        self._run_view = run_view
        self._anomalies: list[int] = []  # ticks, ascending
        self._begins: list[int] = []
        self._times: dict[int, int] = {}  # tick -> ns since 1970
        self._rewired: list[tuple[int, int]] = []  # ticks, and edges changed
        self._rewiring = 0  # edges changed since the last state wave
        self._number = -1  # of the coordinator's messages, the last that was read
        self._read_to = 0  # the last tick
        self._done = False

    def read_on(self) -> bool:
        """Read some of the recording more; return whether there was any.

        Raises:
            RecordingError: The recording cannot be read any more.
        """
        self._run_view.grow()
        before, index = self._read_to, self._run_view.tick_index
        for _, chunk in index.readable(index.chunk_of(before + 1), len(index)):
            self._take(chunk)
            if self._read_to - before >= _BATCH:
                break
        self._done = self._read_to == before
        return not self._done

    def end(self) -> None:
        """Say that no more can be read."""
        self._done = True

    def marks(
        self, first: int, last: int, bins: int, found: Found = NOTHING
    ) -> api.Marks:
        """Return what happened from one tick to another, in as many stretches.

        Args:
            first: From 1 up.
            last: Not before `first`; beyond the last tick: up to that.
            bins: How many stretches, from 1 up; fewer where there are fewer ticks.
            found: What else there is to mark.
        """
        first = max(first, self._run_view.first)
        last = min(last, self._run_view.last)
        ticks = max(0, last - first + 1)
        edges = np.linspace(first, first + ticks, min(bins, ticks) + 1)
        inside = [one for one in found.alarms if first <= one.tick <= last]
        rewired = np.zeros(len(edges) - 1, np.int64)
        changes = np.array(self._rewired, np.int64).reshape(-1, 2)
        places = np.searchsorted(edges, changes[:, 0], side="right") - 1
        seen = (places >= 0) & (places < len(rewired))
        np.maximum.at(rewired, places[seen], changes[seen, 1])
        return api.Marks(
            first=first,
            last=last,
            anomalies=_counted(self._anomalies, edges),
            rewired=rewired.tolist(),
            begins=_counted(self._begins, edges),
            times=[self._time(math.ceil(edge)) for edge in edges[:-1].tolist()],
            resumed=[tick for tick in self._run_view.resumed if first <= tick <= last],
            reached=_counted(found.reached, edges),
            born=_counted(found.born, edges),
            missing=_counted(found.missing, edges),
            alarms=inside[: api.MOST_ALARMS],
            read_to=self._read_to,
            done=self._done and found.done,
        )

    def beside(self, tick: int, way: int, found: Found = NOTHING) -> api.Beside:
        """Return the nearest anomaly or alarm before (-1) or after (1) a tick."""
        told = sorted({*self._anomalies, *(alarm.tick for alarm in found.alarms)})
        place = bisect_right(told, tick) if way > 0 else bisect_left(told, tick) - 1
        there = 0 <= place < len(told)
        return api.Beside(told[place] if there else None)

    def _time(self, tick: int) -> float | None:
        sent = self._times.get(tick)
        return None if sent is None else sent / 1e9

    def _take(self, chunk: ChunkMessages) -> None:
        for observation, sent in chunk.observed():
            self._times.setdefault(observation.tick, sent)
            self._read_to = max(self._read_to, observation.tick)
            if observation.begins:
                _enter(self._begins, observation.tick)
        for anomaly in chunk.all("anomaly", wire.Anomaly):
            with suppress(MessageError):  # it is none
                if with_support(anomaly, self._run_view.options.support):
                    _enter(self._anomalies, anomaly.tick)
        self._take_rewirings(chunk)

    def _take_rewirings(self, chunk: ChunkMessages) -> None:
        """Count the edges that each tick changed: those told before its state wave.

        A wiring has no tick. What the coordinator says is recorded in its order.
        """
        said: list[tuple[int, int, int]] = []  # number, tick or 0, edges
        for topic in ("wiring", "loom"):
            wirings = chunk.all(topic, wire.TOPICS[topic])
            for wiring, number in zip(wirings, chunk.sequences(topic), strict=True):
                if isinstance(wiring, wire.Wiring | wire.WorkerWiring) and wiring.after:
                    said.append((number, 0, _edges(wiring)))
        starts = chunk.all("wave", wire.WaveStart)
        for start, number in zip(starts, chunk.sequences("wave"), strict=True):
            if start.kind == "state":
                said.append((number, start.tick, 0))
        for number, tick, edges in sorted(said):
            if number <= self._number:
                continue  # a chunk that was read before
            self._number = number
            self._rewiring += edges
            if tick and self._rewiring:
                # An edge and its contrapositive are one.
                self._rewired.append((tick, (self._rewiring + 1) // 2))
                self._rewiring = 0


def _edges(wiring: wire.Wiring | wire.WorkerWiring) -> int:
    """Return how many edges a wiring changes."""
    if isinstance(wiring, wire.WorkerWiring):
        return (len(wiring.add) + len(wiring.drop)) // _EDGE
    changes = (wiring.add, wiring.drop, wiring.add_complement, wiring.drop_complement)
    return sum(map(len, changes))


def _enter(ticks: list[int], tick: int) -> None:
    """Put a tick among others, ascending and once; mostly it is the last."""
    place = bisect_left(ticks, tick)
    if ticks[place : place + 1] != [tick]:
        ticks.insert(place, tick)


def _counted(ticks: Sequence[int], edges: NDArray[np.float64]) -> list[int]:
    """Return how many ticks lie in each stretch; the edges are one more."""
    counted: list[int] = np.diff(np.searchsorted(np.array(ticks), edges)).tolist()
    return counted
