"""The judge of a run: holds observations against what was learned before them."""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.poc.learning.archive import pack_arrays, unpack_arrays
from neurosnap.poc.learning.history import History
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.anomaly import AnomalyDetector
from neurosnap.protocol.anomaly_messages import announcement, with_support
from neurosnap.protocol.totals import Totals
from neurosnap.sensorium import Sensorium


class AnomalyJudge:
    """Announces the anomalies of a run, and counts the occasions they rest on.

    Args:
        sensorium: The names of the sensors.
        hold: As of `AnomalyDetector`.
        support: The occasions an anomaly must rest on to be told; 0: all are, and none
            are counted.
        remembers: Whether to keep the last readings of all sensors for that. A run
            whose sensors grow has them anyway, and gives them to `judge`.
    """

    def __init__(
        self,
        sensorium: Sensorium,
        hold: int,
        support: int,
        *,
        remembers: bool,
    ) -> None:
        self._support = support
        self._new_detector = partial(AnomalyDetector, hold=hold)
        self._detector = self._new_detector(sensorium)
        self._history: History | None = None
        if support and remembers:
            self._history = History(len(sensorium))

    def judge(
        self,
        observation: wire.Observation,
        snapshot: Snapshot,
        weighs: bool,
        bits: NDArray[np.bool_],
        known: NDArray[np.bool_] | None,
        history: History | None,
        totals: Totals,
    ) -> wire.Anomaly | None:
        """Return what is to be said of an observation that is not learned yet, if any.

        Args:
            observation: It; what is paused counts for no occasion.
            snapshot: What was learned before it.
            weighs: Whether it knows what spoke for and against implications; else
                that is left out.
            bits: ``(N,)``: its readings.
            known: ``(N,)``: which of them are known; None: all.
            history: The readings before it, in a run whose sensors grow.
            totals: An anomaly is counted there.
        """
        read = history if self._history is None else self._history
        found = self._detector.watch(
            observation.tick,
            snapshot.poc_graph(),
            bits,
            known,
            snapshot if weighs else None,
            read if self._support else None,
        )
        if self._history is not None:
            counted = np.zeros_like(bits) if observation.paused else known
            self._history.enter(bits, counted)
        if found is None:
            return None
        said = announcement(found, snapshot.sensorium)
        totals.anomalies += 1
        totals.told += with_support(said, self._support) is not None
        return said

    def rename(self, sensorium: Sensorium) -> None:
        """Go on with other names for the same sensors: one of them was grown."""
        self._detector.rename(sensorium)

    def to_bytes(self, sensorium: Sensorium) -> bytes:
        """Return what it remembers, for a key-frame, and forget everything else."""
        self._detector = self._new_detector(sensorium)
        return b"" if self._history is None else pack_arrays(self._history.arrays())

    def restore(self, data: bytes) -> None:
        """Be as what `to_bytes` returned says.

        Raises:
            ValueError: It is damaged, or of other sensors.
        """
        if self._history is not None:
            history = History.from_arrays(unpack_arrays(data))
            history.check(self._history.on.shape[1])
            self._history = history
