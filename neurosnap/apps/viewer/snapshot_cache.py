"""A cache of snapshots by tick: learning goes on from the nearest one.

A recording has a key-frame every so many ticks; from there the observations that were
recorded are learned again, as the coordinator did. Snapshots that were come by on the
way are kept: whoever goes on from a tick, or back a little, has not far to go.
"""

from collections import OrderedDict
from collections.abc import Iterator

from neurosnap import wire
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.learning import Learning, snapshot_in
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
        self._kept: OrderedDict[int, Learning] = OrderedDict()
        pairs = len(options.sensors) ** 2 // 2
        self._most = max(3, _ROOM // (_A_PAIR * pairs + 1024))
        self._most = min(self._most, 256)

    def at(self, tick: int) -> Learning:
        """Return what was learned by a tick; not to be changed.

        Cost: as `walk`.

        Raises:
            RecordingError: As from `walk`.
        """
        return next(self.walk(tick, tick))

    def walk(self, first: int, last: int) -> Iterator[Learning]:
        """Yield what was learned by each tick.

        It is the same object each time, and is only right until the next is asked for.
        Cost: O(N²/2) time for each tick since the nearest that is known, and the
        unpacking of the chunks they are in.

        Args:
            first: 0 for before the first tick.
            last: Not before `first`.

        Raises:
            RecordingError: While iterating: an observation that is needed is not
                recorded, or a key-frame that is needed cannot be read.
        """
        learning = self._nearest(first, _STRIDE)
        if not self._leads(learning.tick, first):
            learning = self._nearest(first, 0)
        if learning.tick >= first:
            yield learning
        ahead = self._tick_index.observations(learning.tick + 1, last)
        decisions = (
            self._tick_index.decisions(learning.tick + 1, last)
            if learning.grows
            else {}
        )
        for tick in learning.learn_to(last, ahead, decisions):
            if tick % _STRIDE == 0 or tick == last:
                self._keep(learning)
            if tick >= first:
                yield learning

    def weigh(self, frame: wire.KeyFrame) -> Snapshot:
        """Return the snapshot of a key-frame.

        Raises:
            RecordingError: It holds none, or one of other sensors.
        """
        path = self._tick_index.recording.path
        return snapshot_in(frame, self._tick_index.bands(frame), self._options, path)

    def _leads(self, known: int, tick: int) -> bool:
        """Return whether every observation is there from one tick to another."""
        there = [each.tick for each in self._tick_index.observations(known + 1, tick)]
        return there == list(range(known + 1, tick + 1))

    def _nearest(self, tick: int, far: int) -> Learning:
        """Return a copy of what is known of the nearest tick up to one.

        Args:
            tick: The one asked for.
            far: How far from it what was kept may be, before a key-frame is looked for.
        """
        known = max((kept for kept in self._kept if kept <= tick), default=-1)
        if tick - known > far or known < 0:
            frame = self._tick_index.keyframe(tick)
            if frame is not None and frame.tick > known:
                learning = self._blank()
                learning.restore(frame, self._tick_index.bands(frame))
                return learning
        if known < 0:
            return self._blank()
        self._kept.move_to_end(known)
        return self._kept[known].copy()

    def _blank(self) -> Learning:
        return Learning(self._tick_index.recording.path, self._options)

    def _keep(self, learning: Learning) -> None:
        self._kept[learning.tick] = learning.copy()
        self._kept.move_to_end(learning.tick)
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)
