"""Anomalies: observations that contradict what was learned before them.

A run learns from an observation before it takes a state from it, and an implication
that an observation breaks may be gone by then. It always is where one exception is
enough: in an empirical snapshot as long as ``tau clock <= 1``, in a discounted one if
``1 - q >= tau``. There no complete observation is incoherent once it is learned
([GK] eqn:virtual implication). So a watcher is to be shown an observation with the
graph from before, and the snapshot learns it afterwards.

That alone tells when something begins, and not that it goes on: each implication breaks
once. A watcher may hold on to the order that was broken first, and go on judging by it
for a while. What lasts longer than that is learned like anything else: a sensor stuck
for good becomes a fact about the world, and its repair an anomaly.
"""

from collections.abc import Iterable
from itertools import chain, pairwise

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.odd_reading import oddness
from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.contradiction import Contradiction, contradiction
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.worn_links import Pair, WornLinks
from neurosnap.sensorium import selection

MOST = 64
"""Broken implications that one anomaly lists; a thousand sensors may break as many as
there are pairs of them."""
_CHUNK = 4096  # links whose occasions are counted at a time; 8 MB or so
_FADING = 0.02
_STILL = 0.001
_ODD = 4 * _STILL
"""Chosen on planted relations with flipped, stuck and inverted sensors, where it makes
no difference, and on one half of scikit-learn's digits; judged on two recordings."""


class AnomalyDetector:
    """Detects anomalies in a run, observation by observation.

    Which of several smallest sets of culprits is returned goes by what came before:
    the sensors that have been candidates most, each time for a share of the blame, lose
    2 % of it a tick. Among equals it is what misses its guess by all others most, and
    what did *not* change since the last coherent observation: as a rule the world moves
    and the sensor at fault does not.

    Args:
        sensors: How many there are.
        hold: For how many ticks after the first anomaly to go on judging by the order
            that it broke; 0: always by the order given.
        support: The occasions that what is told rests on. They are counted in the last
            readings of all sensors, and what is told breaks too often is retired. 0:
            nothing is counted.

    Examples:
        >>> from neurosnap.poc.learning.empirical import EmpiricalSnapshot
        >>> watcher, snapshot = AnomalyDetector(2), EmpiricalSnapshot(2, 0.25)
        >>> for tick, bits in enumerate([(0, 0), (0, 1), (1, 1), (1, 0)]):
        ...     found = watcher.watch(tick, snapshot.poc_graph(), np.array(bits) > 0)
        ...     state = snapshot.observe(bits)
        >>> [(one.source, one.target) for one in found.links], found.candidates
        ([(0, 2)], (0, 1))
    """

    def __init__(
        self,
        sensors: int,
        hold: int = 0,
        support: int = 0,
    ) -> None:
        self._sensors = sensors
        self._hold = hold
        self._support = support
        self._history = History(sensors, wire.HISTORY) if support else None
        self._worn = WornLinks()
        self._begin()

    def _begin(self) -> None:
        self._held: PocGraph | None = None
        self._until = 0
        self._since: int | None = None
        self._tick = -1
        self._blame = np.zeros(self._sensors)
        self._calm = np.zeros(2 * self._sensors, np.bool_)

    def watch(
        self,
        tick: int,
        graph: PocGraph,
        bits: NDArray[np.bool_],
        known: NDArray[np.bool_] | None = None,
        snapshot: Snapshot | None = None,
    ) -> wire.Anomaly | None:
        """Return the anomaly of an observation, if there is one.

        Args:
            tick: Of the observation; larger every time.
            graph: What was believed before it: it is not learned yet.
            bits: ``(N,)``, one bit a sensor.
            known: ``(N,)`` bool, which of them are known; None if all are.
            snapshot: Where to find evidence; it did not learn the observation yet.

        Cost:
            O(N²/64) time where nothing is wrong; otherwise as `contradiction`.
        """
        seen = selection(bits, known)
        self._blame *= (1 - _FADING) ** (tick - self._tick)
        self._tick = tick
        if self._held is not None and tick > self._until:
            self._held = self._since = None
        order = graph if self._held is None else self._held

        def suspicion(sensors: NDArray[np.int64]) -> NDArray[np.float64]:
            now = _STILL * ~(seen ^ self._calm)[::2][sensors]
            if self._history is not None:
                now += _ODD * oddness(self._history, sensors, seen)
            return np.asarray(self._blame[sensors] + now)

        found = contradiction(order, seen, suspicion)
        anomaly: wire.Anomaly | None = None
        if found.coherent:
            self._calm = seen
            if self._held is None:
                self._since = None
        else:
            if self._since is None:
                self._since = tick
            if self._hold and self._held is None:
                self._held, self._until = order, tick + self._hold
            anomaly = self._anomaly(found, snapshot, self._since)
        if self._history is not None:
            self._history.record(seen[::2], seen[::2] | seen[1::2])
        return anomaly

    def _anomaly(
        self,
        found: Contradiction,
        snapshot: Snapshot | None,
        since: int,
    ) -> wire.Anomaly:
        """Return an anomaly with what speaks for the implications it breaks."""
        chains = found.chains
        links = {way: [*pairwise(way)] for way in chains}
        held, worn = dict[Pair, int](), dict[Pair, tuple[int, int]]()
        rank = dict[tuple[int, ...], int]()
        if self._history is not None:
            held = _held({*chain.from_iterable(links.values())}, self._history)
            least = {way: min(held[pair] for pair in links[way]) for way in chains}
            # Of several links it is not known which broke.
            broken = {p for p in links if len(p) == 2 and least[p] >= self._support}
            worn = self._worn.follow(self._tick, held.keys(), broken, self._history)
            at = {p: 1 if 0 < out < self._tick else -1 for p, (_, out) in worn.items()}
            rank = {way: max(at.get(p, 0) for p in links[way]) for way in chains}
            chains = tuple(sorted(chains, key=lambda way: (rank[way], -least[way])))
        if min(rank.values(), default=0) <= 0:  # else all it breaks are retired
            self._blame[list(found.candidates)] += 1 / len(found.candidates)
        shown, first = chains[:MOST], found.culprits[0]
        about = [each for each in chains if first in (each[0] >> 1, each[-1] >> 1)]
        if about and about[0] not in shown:  # it is what the anomaly is told by
            shown = (*shown[:-1], about[0])
        return wire.Anomaly(
            tick=self._tick,
            since=since,
            culprits=found.culprits,
            candidates=found.candidates,
            exact=found.exact,
            implications=len(chains) + found.more,
            links=tuple(
                _weighed(
                    number, pair, snapshot, held.get(pair, -1), worn.get(pair, (0, 0))
                )
                for number, way in enumerate(shown)
                for pair in links[way]
            ),
        )

    def to_bytes(self) -> bytes:
        """Return the detector's state for a key-frame, and forget everything else."""
        self._begin()
        if self._history is None:
            return b""
        return pack_arrays(self._history.arrays() | self._worn.arrays())

    def restore(self, data: bytes) -> None:
        """Restore the detector's state from the bytes of `to_bytes`.

        Raises:
            ValueError: It is damaged, or of other sensors.
        """
        if self._history is not None:
            arrays = unpack_arrays(data)
            self._history = History.from_arrays(arrays, self._sensors, wire.HISTORY)
            self._worn.restore(arrays)


def _weighed(
    number: int,
    pair: Pair,
    snapshot: Snapshot | None,
    held: int,
    worn: tuple[int, int],
) -> wire.WeighedLink:
    """Return a broken link with what speaks for it, as far as a snapshot knows."""
    both, against, since = 0.0, 0.0, 0
    if snapshot is not None and pair[0] >> 1 != pair[1] >> 1:
        one = snapshot.evidence(*pair)
        both, against, since = float(one.both), float(one.against), one.since
    return wire.WeighedLink(number, *pair, both, against, since, held, *worn)


def _held(
    links: Iterable[tuple[int, int]], history: History
) -> dict[tuple[int, int], int]:
    """Return on how many occasions each link was tested and held."""
    held: dict[tuple[int, int], int] = {}
    every = sorted(links)
    for start in range(0, len(every), _CHUNK):
        some = every[start : start + _CHUNK]
        sources, targets = np.array(some, np.int64).T
        counted = history.occasions_held(sources, targets)
        held.update(zip(some, counted.tolist(), strict=True))
    return held
