"""The snapshot that a run had learned by a given tick, and its order as it is drawn.

A recording has a key-frame every so many ticks; from there the observations that were
recorded are learned again, as the coordinator did. Snapshots that were come by on the
way are kept: from there a tick further on, or a little back, is not far.
"""

import functools
from collections import OrderedDict
from collections.abc import Iterator
from hashlib import blake2b

import numpy as np

from neurosnap.agent.body import Body
from neurosnap.apps.viewer.api import Arrow, Graph, NodeView
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.random_access_by_tick import TickIndex
from neurosnap.recording.replay.learn_again import Learning

_STRIDE = 100
"""Ticks between two snapshots that are kept on the way."""
_ROOM = 12 * 2**20
"""Bytes of snapshots that are kept, at most; the last few in any case."""
_A_PAIR = 12
"""Bytes a pair of sensors takes in a snapshot, about."""


class SnapshotCache:
    """What was learned, by tick. To be used by one thread at a time."""

    def __init__(self, tick_index: TickIndex, options: RunOptions) -> None:
        self.tick_index = tick_index
        self._options = options
        self._kept: OrderedDict[int, Learning] = OrderedDict()
        pairs = len(options.sensors) ** 2 // 2
        self._most = max(2, _ROOM // (_A_PAIR * pairs + 1024))
        self._most = min(self._most, 256)

    def at(self, tick: int) -> Learning:
        """Return what was learned by a tick; not to be changed.

        Cost: as `walk`; none if it was asked for before.

        Raises:
            RecordingError: As from `walk`.
        """
        return self._kept.get(tick) or next(self.walk(tick, tick))

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
        # Every observation must be there from that tick on.
        ahead = self.tick_index.observations(learning.tick + 1, first)
        if [each.tick for each in ahead] != [*range(learning.tick + 1, first + 1)]:
            learning = self._nearest(first, 0)
        if learning.tick >= first:
            yield learning
        ahead = self.tick_index.observations(learning.tick + 1, last)
        changes = (
            self.tick_index.changes(learning.tick + 1, last) if learning.grows else {}
        )
        for tick in learning.learn_to(last, ahead, changes):
            if tick % _STRIDE == 0 or tick == last:
                self._keep(learning)
            if tick >= first:
                yield learning

    def _nearest(self, tick: int, far: int) -> Learning:
        """Return a copy of what is known of the nearest tick up to one.

        Args:
            tick: The one asked for.
            far: How far from it what was kept may be, before a key-frame is looked for.
        """
        known = max((kept for kept in self._kept if kept <= tick), default=-1)
        if tick - known > far or known < 0:
            found = self.tick_index.keyframe(tick)
            if found is not None and found[0].tick > known:
                learning = self._blank()
                learning.restore(*found)
                return learning
        if known < 0:
            return self._blank()
        self._kept.move_to_end(known)
        return self._kept[known].copy()

    def _blank(self) -> Learning:
        return Learning(self.tick_index.recording.path, self._options)

    def _keep(self, learning: Learning) -> None:
        self._kept[learning.tick] = learning.copy()
        self._kept.move_to_end(learning.tick)
        while len(self._kept) > self._most:
            self._kept.popitem(last=False)


@functools.lru_cache(maxsize=4)
def graph_id(graph: PocGraph, body: Body) -> str:
    """Return the id of an order.

    The Hasse wiring says all there is to draw, classes included, but for which sensors
    are read. A row of ticks mostly has one order.
    """
    wires = blake2b(graph.wire_list("hasse").tobytes(), digest_size=8)
    wires.update(repr((body.grown, body.retired)).encode())
    return wires.hexdigest()


def covers(graph: PocGraph) -> list[tuple[int, int]]:
    """Return the covering edges of an order between those that stand for their classes.

    Of an edge and its contrapositive it is the one with the smaller source.
    """
    below, above = np.nonzero(graph.hasse())
    standing = graph.representative
    chosen = (below <= above ^ 1) & (standing[below] != standing[above])
    return list(zip(below[chosen].tolist(), above[chosen].tolist(), strict=True))


def classes(graph: PocGraph) -> list[tuple[int, ...]]:
    """Return the classes of equivalent literals, each once with its complement."""
    return [members for members in graph.classes() if members[0] % 2 == 0]


def drawn(tick: int, graph: PocGraph, body: Body) -> Graph:
    """Return the order of `graph` with its layers. O(N²) time.

    Sensors still to be grown are not drawn, and retired ones where they are still in
    the order.
    """
    names = body.sensors
    wired = np.argwhere(graph.hasse()) >> 1
    shown = sorted({*body.read, *wired.ravel().tolist()})
    standing = graph.representative
    heights = graph.heights()
    return Graph(
        id=graph_id(graph, body),
        tick=tick,
        height=graph.height(),
        nodes=[
            NodeView(
                sensor=sensor,
                name=names[sensor],
                layer=int(heights[2 * sensor]),
                group=int(standing[2 * sensor]),
            )
            for sensor in shown
        ],
        edges=[Arrow(source=a, target=b) for a, b in covers(graph)],
        classes=classes(graph),
    )
