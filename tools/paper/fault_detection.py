"""Fault detection: a learner with failing sensors, and anomaly detectors."""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.protocol.anomaly_detector import AnomalyDetector
from neurosnap.sensorium import complete
from tools.paper.learning_error import new_snapshot
from tools.paper.sensor_faults import PLACES, Fault, course, faults, seen
from tools.paper.table import Entry

Judge: TypeAlias = Literal["before", "held"]
"""Judges by the graph from before the observation; or by that too, and holds on to what
was broken."""

JUDGES: tuple[Judge, ...] = ("before", "held")

FAULTY, SHOWN, VISIBLE = 1, 2, 4
"""Flags of a step: a fault is on; a reading is wrong; it contradicts the truth."""

ALARM, RIGHT, AMONG = 8, 16, 32
"""Flags of the first judge: it found an anomaly; its culprits are the sensors that read
wrong; those are among its candidates. Each next judge has them three bits up."""

HOLD = 200
"""Ticks that the last judge holds on to an order."""


class DetectionEntry(Entry, frozen=True, kw_only=True):
    """A learner in a world with one kind of fault, and all anomaly detectors."""

    VERSION = 3
    steps: int
    """Observations in each run."""
    place: str
    """The world's name."""
    threshold: float
    """``tau`` of every pair."""
    decay: float | None
    """``q`` of a discounted snapshot; None: it is empirical."""
    fault: Fault

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return the flags of each step of a run: ``(steps,)``."""
        walk = course(self.place, self.seed, run, self.steps)
        count = walk.bits.shape[1]
        # Every kind of fault strikes at the same times, and where it can the same.
        key = (list(PLACES).index(self.place), run, 3)
        (drawn,) = np.random.SeedSequence(self.seed, spawn_key=key).generate_state(1)
        episodes = faults(self.fault, count, self.steps, int(drawn))
        read = seen(walk.bits, self.fault, episodes)
        wrong = read != walk.bits
        flags = np.zeros(self.steps, np.uint16)
        for episode in episodes:
            flags[episode.first : episode.end] |= FAULTY
        flags[wrong.any(axis=1)] |= SHOWN
        for step in np.flatnonzero(wrong.any(axis=1)).tolist():
            if not walk.truth.is_coherent(complete(read[step])):
                flags[step] |= VISIBLE
        self._watch(read, wrong, flags)
        return flags

    def _watch(
        self,
        read: NDArray[np.bool_],
        wrong: NDArray[np.bool_],
        flags: NDArray[np.uint16],
    ) -> None:
        """Let the learner learn, and each judge flag what it finds."""
        sensors = read.shape[1]
        snapshot = new_snapshot(self.threshold, self.decay, sensors)
        judges = [AnomalyDetector(sensors, hold) for hold in (0, HOLD)]
        for step, bits in enumerate(read):
            believed = snapshot.poc_graph()
            snapshot.learn(bits)
            found = [judge.watch(step, believed, bits) for judge in judges]
            at_fault = set(wrong[step].nonzero()[0].tolist())
            for judge, anomaly in enumerate(found):
                flags[step] |= _flags(anomaly, at_fault) << 3 * judge


def _flags(anomaly: wire.Anomaly | None, at_fault: set[int]) -> int:
    """Return the flags of the first judge for what it found."""
    if anomaly is None:
        return 0
    right = RIGHT if set(anomaly.culprits) == at_fault else 0
    return ALARM | right | (AMONG if at_fault <= set(anomaly.candidates) else 0)
