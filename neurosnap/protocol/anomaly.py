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
from itertools import pairwise

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.errors import InvalidValueError, ShapeError
from neurosnap.poc.learning.evidence import Evidence
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.poc.order.contradiction import Contradiction, contradiction
from neurosnap.poc.order.graph import PocGraph
from neurosnap.sensorium import Sensorium, as_known, complete

MOST = 64
"""Broken implications that one anomaly lists; a thousand sensors may break as many as
there are pairs of them."""

_CHUNK = 4096  # links whose occasions are counted at a time; 8 MB or so
_FADING = 0.02
_STILL = 0.001


class BrokenLink(msgspec.Struct, frozen=True):
    """A learned implication; literals by name, a star for a complement."""

    source: str
    target: str
    evidence: Evidence | None
    """For and against it, before the observation. None: there is no snapshot to ask, or
    it is of one sensor, which none weighs."""
    occasions: int | None = None
    """On how many occasions it was put to the test before, and held, as
    `History.occasions_held` counts them. None: there is no history to ask."""


class Broken(msgspec.Struct, frozen=True):
    """A broken implication: its source was observed, and so was not its target."""

    source: str
    target: str
    links: tuple[BrokenLink, ...]
    """What it follows from; just itself wherever all sensors had readings."""


class FoundAnomaly(msgspec.Struct, frozen=True):
    """An observation that contradicts an order."""

    tick: int
    since: int
    """The tick it began at: all observations since, or those that were judged by the
    order held on to, belong to the same anomaly."""
    broken: tuple[Broken, ...]
    """The implications that were broken, without those that follow from others: the
    first `MOST` of them. Where occasions are counted, those come first that rest on
    most."""
    more: int
    """How many more were broken, at least, and are not listed."""
    culprits: tuple[str, ...]
    """The fewest sensors that can be wrong, and of such sets the likeliest."""
    candidates: tuple[str, ...]
    """All sensors that are in one of the smallest such sets."""
    exact: bool
    """Whether the search for them was complete."""


class AnomalyDetector:
    """Follows a run and tells its anomalies.

    Which of several smallest sets of culprits is returned goes by what came before:
    the sensors that have been candidates most, each time for a share of the blame, lose
    2 % of it a tick. Among equals it is who did *not* change since the last coherent
    observation: as a rule the world moves and the sensor at fault does not.

    Args:
        sensorium: The names of the sensors.
        hold: For how many ticks after the first anomaly to go on judging by the order
            that it broke; 0: always by the order given.

    Raises:
        InvalidValueError: `hold` is negative.

    Example:
        >>> from neurosnap.poc.learning.kinds import EmpiricalSnapshot
        >>> names = Sensorium(["door", "motion"])
        >>> watcher, snapshot = AnomalyDetector(names), EmpiricalSnapshot(names, 0.25)
        >>> for tick, bits in enumerate([(0, 0), (0, 1), (1, 1), (1, 0)]):
        ...     found = watcher.watch(tick, snapshot.poc_graph(), bits)
        ...     state = snapshot.observe(bits)
        >>> found.broken[0].source, found.broken[0].target, found.candidates
        ('door', 'motion', ('door', 'motion'))
    """

    def __init__(self, sensorium: Sensorium, hold: int = 0) -> None:
        if hold < 0:
            raise InvalidValueError("hold", "must be 0 or more", hold)
        self._sensorium = sensorium
        self._hold = hold
        self._held: PocGraph | None = None
        self._until = 0
        self._since: int | None = None
        self._tick = -1
        self._blame = np.zeros(len(sensorium))
        self._calm = np.zeros(2 * len(sensorium), np.bool_)

    def rename(self, sensorium: Sensorium) -> None:
        """Go on with other names for the same sensors: one of them was grown."""
        self._sensorium = sensorium

    def watch(
        self,
        tick: int,
        graph: PocGraph,
        bits: ArrayLike,
        known: NDArray[np.bool_] | None = None,
        snapshot: Snapshot | None = None,
        history: History | None = None,
    ) -> FoundAnomaly | None:
        """Return what is wrong with an observation, if anything is.

        Args:
            tick: Of the observation; larger every time.
            graph: What was believed before it: it is not learned yet.
            bits: ``(N,)``, one bit a sensor.
            known: ``(N,)`` bool, which of them are known; None: all.
            snapshot: Who believes, for evidence; it did not learn the observation yet.
            history: The readings before it, for occasions; None: none are counted.

        Raises:
            ShapeError: Something has another number of sensors.
            InvalidValueError: A bit is not 0 or 1, `known` is not bool, or `tick` is
                not larger than the one before.

        Cost:
            O(N²/64) time where nothing is wrong; otherwise as `contradiction`.
        """
        seen = self._observed(graph, bits, known)
        if tick <= self._tick:
            raise InvalidValueError("tick", f"must be above {self._tick}", tick)
        self._blame *= (1 - _FADING) ** (tick - self._tick)
        self._tick = tick
        if self._held is not None and tick > self._until:
            self._held = self._since = None
        order = graph if self._held is None else self._held
        found = contradiction(order, seen, self._suspicion(seen))
        if found.coherent:
            self._calm = seen
            if self._held is None:
                self._since = None
            return None
        if self._since is None:
            self._since = tick
        if self._hold and self._held is None:
            self._held, self._until = order, tick + self._hold
        self._blame[list(found.candidates)] += 1 / len(found.candidates)
        return self._told(found, snapshot, history, self._since)

    def _observed(
        self, graph: PocGraph, bits: ArrayLike, known: NDArray[np.bool_] | None
    ) -> NDArray[np.bool_]:
        """Return the literals that were observed."""
        count = len(self._sensorium)
        if graph.sensors != count:
            raise ShapeError("graph", f"must have {count} sensors", graph.sensors)
        seen = complete(self._sensorium.observation(bits))
        return seen if known is None else seen & as_known(known, count).repeat(2)

    def _suspicion(self, seen: NDArray[np.bool_]) -> NDArray[np.float64]:
        still = ~(seen ^ self._calm)[::2]
        return self._blame + _STILL * still

    def _told(
        self,
        found: Contradiction,
        snapshot: Snapshot | None,
        history: History | None,
        since: int,
    ) -> FoundAnomaly:
        """Return an anomaly in words."""
        name, names = self._sensorium.name, self._sensorium.names
        chains = found.chains
        held: dict[tuple[int, int], int] = {}
        if history is not None:
            held = _held(
                {link for chain in chains for link in pairwise(chain)}, history
            )
            weakest = [min(held[link] for link in pairwise(chain)) for chain in chains]
            order = sorted(range(len(chains)), key=lambda k: -weakest[k])
            chains = tuple(chains[k] for k in order)

        def link(a: int, b: int) -> BrokenLink:
            asked = None if a >> 1 == b >> 1 else snapshot
            evidence = None if asked is None else asked.evidence(a, b)
            return BrokenLink(name(a), name(b), evidence, held.get((a, b)))

        return FoundAnomaly(
            tick=self._tick,
            since=since,
            broken=tuple(
                Broken(
                    name(chain[0]),
                    name(chain[-1]),
                    tuple(link(*pair) for pair in pairwise(chain)),
                )
                for chain in chains[:MOST]
            ),
            more=max(0, len(chains) - MOST) + found.more,
            culprits=tuple(names[s] for s in found.culprits),
            candidates=tuple(names[s] for s in found.candidates),
            exact=found.exact,
        )


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
