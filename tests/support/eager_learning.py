"""Learning as the kernels have it that judge every pair at every observation."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.learning.persistence import Persistence
from neurosnap.poc.learning.thresholds import by_pair, checked_threshold, is_auto
from neurosnap.poc.learning.update_kernels import learn_counts
from neurosnap.poc.learning.update_kernels_auto import SHARE
from neurosnap.poc.order.literals import from_words


class EagerCounts:
    """What an empirical snapshot is, all of whose readings are known."""

    def __init__(self, sensors: int, threshold: ArrayLike) -> None:
        pairs, auto = sensors * (sensors - 1) // 2, is_auto(threshold)
        share = checked_threshold(SHARE if auto else threshold, sensors)
        self.threshold = by_pair(share, range(pairs))
        self.clock = self.skipped = 0
        self.joints = np.zeros(pairs, np.uint32)
        self.marginals = np.zeros(sensors, np.uint32)
        self.codes = np.zeros(pairs, np.uint8)
        self.since = np.zeros(pairs, np.uint32)
        self.rows = np.zeros((2 * sensors, (2 * sensors + 63) // 64), np.uint64)
        self.persistence = Persistence(sensors) if auto else None

    def learn(self, bits: NDArray[np.uint8]) -> bool:
        """Observe; return whether any code changed."""
        spells = turns = None
        if self.persistence is not None:
            self.persistence.note(bits, np.ones_like(bits))
            spells, turns = self.persistence.spells, self.persistence.turns
        self.clock += 1
        before = self.codes.copy()
        changed = learn_counts(
            bits,
            self.joints,
            self.marginals,
            self.clock,
            self.threshold,
            self.codes,
            self.rows,
            spells,
            turns,
        )
        self.since[self.codes != before] = self.clock + self.skipped
        return changed

    def assert_same(self, snapshot: EmpiricalSnapshot) -> None:
        """Assert that a snapshot has the same weights, codes, dates and graph."""
        arrays = snapshot.arrays()
        assert arrays["clock"] == self.clock
        np.testing.assert_array_equal(arrays["joints"], self.joints)
        np.testing.assert_array_equal(arrays["marginals"], self.marginals)
        np.testing.assert_array_equal(arrays["since"], self.since)
        np.testing.assert_array_equal(snapshot.codes, self.codes)
        edges = from_words(self.rows, len(self.rows))
        np.testing.assert_array_equal(snapshot.poc_graph().edges, edges)
        if self.persistence is not None:
            for name, array in self.persistence.arrays().items():
                np.testing.assert_array_equal(arrays[name], array)
