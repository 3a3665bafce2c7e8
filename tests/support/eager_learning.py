"""Empirical learning in plain numpy that judges every pair at every observation."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from neurosnap.poc.learning.automatic_threshold import (
    SHARE,
    START,
    Persistence,
    is_tolerated,
    share_of_changes,
)
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import rows_of
from neurosnap.poc.learning.thresholds import by_pair, checked_threshold, is_auto
from neurosnap.poc.order.literals import from_words

_CELLS = ((0, 0, 4), (0, 1, 1), (1, 0, 2), (1, 1, 8))
"""The joint readings, 0 for on; and the code of the implication each is against."""


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
        self.persistence = Persistence(sensors) if auto else None
        self._latter, self._former = np.tril_indices(sensors, -1)

    def learn(self, bits: NDArray[np.uint8]) -> bool:
        """Observe; return whether any code changed."""
        if self.persistence is not None:
            self.persistence.count(bits, np.ones_like(bits))
        self.clock += 1
        self.marginals += bits
        self.joints += bits[self._latter] & bits[self._former]
        fresh = self._judged()
        changed = fresh != self.codes
        self.codes = fresh
        self.since[changed] = self.clock + self.skipped
        return bool(changed.any())

    def squares(self) -> NDArray[np.int64]:
        """Return ``(4, P)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*``."""
        both = self.joints.astype(np.int64)
        mine = self.marginals[self._latter] - both
        yours = self.marginals[self._former] - both
        return np.stack([both, mine, yours, self.clock - both - mine - yours])

    def _judged(self) -> NDArray[np.uint8]:
        squares = self.squares()
        # One number for all pairs, or one a pair and one of no meaning.
        each = self.threshold[:-1] if len(self.threshold) > 1 else self.threshold
        limit = each * self.clock
        if self.persistence is not None:
            limit = np.maximum(limit - START, 1.0)
        second, least = np.sort(squares, axis=0)[1], squares.min(axis=0)
        holds = (least < second) & (least < limit)
        fresh = np.zeros(len(self.joints), np.uint8)
        for cell, (_, _, code) in enumerate(_CELLS):
            fresh[holds & (squares[cell] == least)] = code
        if self.persistence is not None:
            for pair in np.flatnonzero(holds & (least > 0)):
                if not self._stands(int(pair), squares[:, pair], int(fresh[pair])):
                    fresh[pair] = 0
        fresh[(squares[1] == 0) & (squares[2] == 0)] = 3
        fresh[(squares[0] == 0) & (squares[3] == 0)] = 12
        return fresh

    def _stands(self, pair: int, square: NDArray[np.int64], code: int) -> bool:
        """Return whether an implication stands that was broken."""
        assert self.persistence is not None
        i, j = int(self._latter[pair]), int(self._former[pair])
        if not self.persistence.spells[1][i]:
            return bool(code == self.codes[pair])
        cell = int(square.argmin())
        a, b, _ = _CELLS[cell]
        changes = share_of_changes(self.persistence.spells, 2 * i + a, 2 * j + b)
        against = float(square[cell])
        from_a, from_b = against + square[cell ^ 1], against + square[cell ^ 2]
        total = float(square.sum())
        return is_tolerated(against, float(from_a), float(from_b), total, changes)

    def assert_same(self, snapshot: EmpiricalSnapshot) -> None:
        """Assert that a snapshot has the same weights, codes, dates and graph."""
        arrays = snapshot.arrays()
        assert arrays["clock"] == self.clock
        np.testing.assert_array_equal(arrays["joints"], self.joints)
        np.testing.assert_array_equal(arrays["marginals"], self.marginals)
        np.testing.assert_array_equal(arrays["since"], self.since)
        np.testing.assert_array_equal(snapshot.codes, self.codes)
        rows = rows_of(self.codes, len(self.marginals))
        edges = from_words(rows, len(rows))
        np.testing.assert_array_equal(snapshot.poc_graph().edges, edges)
        if self.persistence is not None:
            for name, array in self.persistence.arrays().items():
                np.testing.assert_array_equal(arrays[name], array)
