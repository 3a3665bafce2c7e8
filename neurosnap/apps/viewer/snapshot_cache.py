"""A cache of snapshots by tick: learning goes on from the nearest one.

A recording has a key-frame every so many ticks; from there the observations that were
recorded are learned again, as the coordinator did. Snapshots that were come by on the
way are kept: whoever goes on from a tick, or back a little, has not far to go.
"""

import copy
from collections import OrderedDict
from collections.abc import Iterator

from neurosnap import wire
from neurosnap.errors import RecordingError, ShapeError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.observations import readings
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.tick_index import TickIndex

_STRIDE = 100
"""Ticks between two snapshots that are kept on the way."""
_ROOM = 64 * 2**20
"""Bytes of snapshots that are kept, at most; the last few in any case."""
_A_PAIR = 12
"""Bytes a pair of sensors takes in a snapshot, about."""


class SnapshotCache:
    """What was learned, by tick. To be used by one thread at a time.

    Args:
        tick_index: The recording.
        options: The run's.
    """

    def __init__(self, tick_index: TickIndex, options: RunOptions) -> None:
        self._tick_index = tick_index
        self._options = options
        self._kept: OrderedDict[int, Snapshot] = OrderedDict()
        pairs = len(options.sensors) ** 2 // 2
        self._most = max(3, _ROOM // (_A_PAIR * pairs + 1024))
        self._most = min(self._most, 256)

    def at(self, tick: int) -> Snapshot:
        """Return the snapshot after a tick; not to be changed.

        Cost: as `walk`.

        Raises:
            RecordingError: As from `walk`.
        """
        return next(self.walk(tick, tick))[1]

    def walk(self, first: int, last: int) -> Iterator[tuple[int, Snapshot]]:
        """Yield each tick and the snapshot after it.

        The snapshot is the same each time, and is only right until the next is asked
        for. Cost: O(N²/2) time for each tick since the nearest that is known, and the
        unpacking of the chunks they are in.

        Args:
            first: 0 for before the first tick.
            last: Not before `first`.

        Raises:
            RecordingError: While iterating: an observation that is needed is not
                recorded, or a key-frame that is needed cannot be read.
        """
        tick, snapshot = self._nearest(first, _STRIDE)
        if not self._leads(tick, first):
            tick, snapshot = self._nearest(first, 0)
        if tick >= first:
            yield tick, snapshot
        for observation in self._observations(tick + 1, last):
            if observation.tick != tick + 1:
                break
            tick += 1
            self._learn(snapshot, observation)
            if tick % _STRIDE == 0 or tick == last:
                self._keep(tick, snapshot)
            if tick >= first:
                yield tick, snapshot
            if tick == last:
                return
        if tick < last:
            rule = f"must hold the observation of tick {tick + 1}"
            raise RecordingError(
                f"{self._tick_index.files.first.path}: {rule}, got none"
            )

    def weigh(self, frame: wire.KeyFrame) -> Snapshot:
        """Return the snapshot of a key-frame.

        Raises:
            RecordingError: It holds none, or one of other sensors.
        """
        rule = f"{self._tick_index.files.first.path}: key-frame of tick {frame.tick}"
        try:
            snapshot = Snapshot.from_bytes(frame.snapshot)
        except ValueError as error:
            raise RecordingError(f"{rule}: must hold a snapshot, {error}") from error
        if tuple(snapshot.sensorium) != self._options.sensors:
            found = len(snapshot.sensorium)
            raise RecordingError(f"{rule}: must be of the run's sensors, got {found}")
        return snapshot

    def _learn(self, snapshot: Snapshot, observation: wire.Observation) -> None:
        try:
            bits, known = readings(observation, len(self._options.sensors))
        except ShapeError as error:
            place = f"{self._tick_index.files.first.path}: tick {observation.tick}"
            raise RecordingError(f"{place}: /observe: {error}") from error
        snapshot.learn(bits, known)

    def _observations(self, first: int, last: int) -> Iterator[wire.Observation]:
        """Yield the recorded observations of some ticks, each once."""
        due = first
        start = self._tick_index.chunk_of(first)
        for number in range(start, len(self._tick_index)):
            for observation in self._tick_index.observed(number):
                if due <= observation.tick <= last:
                    yield observation
                due = max(due, observation.tick + 1)
            if due > last:
                return

    def _leads(self, known: int, tick: int) -> bool:
        """Return whether every observation is there from one tick to another."""
        there = [each.tick for each in self._observations(known + 1, tick)]
        return there == list(range(known + 1, tick + 1))

    def _nearest(self, tick: int, far: int) -> tuple[int, Snapshot]:
        """Return the nearest tick up to one whose snapshot is known, and a copy of it.

        Args:
            tick: The one asked for.
            far: How far from it what was kept may be, before a key-frame is looked for.
        """
        known = max((kept for kept in self._kept if kept <= tick), default=-1)
        if tick - known > far or known < 0:
            frame = self._tick_index.keyframe(tick)
            if frame is not None and frame.tick > known:
                return frame.tick, self.weigh(frame)
        if known < 0:
            return 0, self._options.new_snapshot()
        self._kept.move_to_end(known)
        return known, copy.deepcopy(self._kept[known])

    def _keep(self, tick: int, snapshot: Snapshot) -> None:
        self._kept[tick] = copy.deepcopy(snapshot)
        self._kept.move_to_end(tick)
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)
