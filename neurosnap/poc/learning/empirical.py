"""Learning by counting: nothing is forgotten."""

import math
from bisect import bisect_left
from collections.abc import Iterable, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.automatic_threshold import (
    AUTO,
    MARK,
    SHARE,
    START,
    Persistence,
    is_tolerated,
    share_of_changes,
)
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.graph_kernels import row_of
from neurosnap.poc.learning.lazy_counting_kernels import (
    Due,
    count_squares,
    judge_squares,
    learn_lazily,
    settle_all,
    settle_copies,
)
from neurosnap.poc.learning.pair_occasions import OnProgress
from neurosnap.poc.learning.pairs import Weights, pairs_of
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.learning.twins import TURNED, Parted
from neurosnap.sensorium import Sensorium

_BATCH = 64
"""Rows that are observed between two reports of progress."""


class EmpiricalSnapshot(Snapshot):
    """A snapshot that counts and forgets nothing ([GK] defn:empirical snapshot).

    Its test is exact: weights are integers, compared with ``threshold * clock`` in
    double precision. Counts are 32 bits wide, which the clock must not outgrow. With
    unknown readings, the four weights of a pair add up to the observations in which
    both its sensors were known, and these stand for the clock. A pair that was known
    together in less than half of all observations is judged once it was so ``1 / tau``
    times: of fewer, not one could speak against an implication without undoing it.

    With the threshold ``"auto"`` each pair chooses its own, from what was observed of
    it: `neurosnap.poc.learning.automatic_threshold` says how, and why the graph is
    acyclic as with any other.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: In (0, 1/4], or ``"auto"``.
        share: As of `Snapshot`.

    Raises:
        InvalidValueError: The threshold is out of range.

    Examples:
        >>> e = EmpiricalSnapshot(Sensorium(["door", "motion"]), threshold=0.25)
        >>> for bits in [(0, 0), (0, 1), (1, 1)]:
        ...     state = e.observe(bits)
        >>> e.poc_graph().implications(e.sensorium)
        [('door', 'motion')]
        >>> e.weight(0, 2), e.weight(0, 3)
        (1, 0)
    """

    _MAKES_EQUAL = True
    THRESHOLD: ClassVar[float] = 0.01
    """Where none is given."""

    def __init__(
        self,
        sensors: int | Sensorium,
        threshold: float | str = THRESHOLD,
        share: range | None = None,
    ) -> None:
        self._is_auto = threshold == AUTO
        super().__init__(sensors, SHARE if self._is_auto else threshold, share)

    def _begin_weights(self, count: int, rows: range) -> None:
        zero = np.uint32(0)
        self._weights = Weights(count, zero, zero, rows)
        self._persistence = Persistence(count) if self._is_auto else None
        self._due: Due | None = None
        self._settled = 0  # the clock at which all counts were up to date

    def _copy_weights(self, parted: Parted) -> None:
        weights, size = self._weights, len(pairs_of(self._rows))
        before, clock = parted.before, self._clock
        due = self._due
        if due is None or parted.moved:
            self._settle()
            due = Due.starting(before, weights.joints.size, clock)
        marginals = weights.marginals
        weights.joints = parted.of_pairs(weights.joints, size, marginals)
        weights.marginals = parted.of_groups(marginals)
        weights.share = self._rows
        self._due = due.of_more(parted, size)
        if not parted.moved:
            args = weights.joints, clock, self._due
            settle_copies(parted.source, before, self._rows.start, *args)
        if self._persistence is not None:
            self._persistence.copy(parted)

    @property
    def threshold(self) -> float | str:
        """The threshold as it was given: a number, or ``"auto"``."""
        return super().threshold if self._persistence is None else AUTO

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        if self._persistence is None:
            return super().arrays()
        # What was broken stands from one test to the next: that is in the codes.
        codes = {
            "threshold": np.array(AUTO),
            "codes": self._ordered(self._pairs.codes, TURNED),
        }
        return super().arrays() | codes | self._persistence.arrays(self._twins)

    @classmethod
    def fit(
        cls,
        data: Any,  # noqa: ANN401 - an array, a data frame, or columns
        threshold: float | str = THRESHOLD,
        names: Iterable[str] | None = None,
        on_progress: OnProgress | None = None,
    ) -> Self:
        """Return the snapshot after observing all rows of a table, in order.

        Args:
            data: ``(T, N)``: an array of bool or numbers, 0, 1 or NaN for unknown; a
                data frame whose missing values are unknown; or `Columns`.
            threshold: As of the class.
            names: Of the sensors; if None, those of the data frame, or ``s0``, ``s1``
                and so on. `Columns` have their own.
            on_progress: Told how much is done, in pairs.

        Returns:
            A new snapshot. Up to O(N² T) time, as of `learn`.

        Raises:
            ShapeError: `data` has not two axes, or there is not one name a column.
            InvalidValueError: An entry is not 0, 1 or unknown; there are too many
                rows; or the threshold is out of range.

        Examples:
            >>> e = EmpiricalSnapshot.fit([[0, 0], [0, 1], [1, 1]], threshold=0.25)
            >>> e.poc_graph().implications(e.sensorium), e.clock
            ([('s0', 's1')], 3)
        """
        columns = data if isinstance(data, Columns) else Columns.of(data, names)
        snapshot = cls(columns.sensorium, threshold)
        pairs = len(pairs_of(range(len(columns.sensorium))))
        for tick in range(columns.ticks):
            snapshot.learn(*columns.row(tick))
            if on_progress is not None and tick % _BATCH == 0:
                on_progress(pairs * tick // columns.ticks, pairs)
        snapshot.project(snapshot._known > 0)
        if on_progress is not None:
            on_progress(pairs, pairs)
        return snapshot

    def _update(self) -> bool:
        if self._persistence is not None:
            self._persistence.count(*self._read())
        if self._due is None and self._weights.squares is None:
            count, pairs = len(self._twins), self._pairs.codes.size
            self._due = Due.starting(count, pairs, self._clock)
        return self._count(self._clock + 1, self._due)

    def _settle(self) -> None:
        if self._due is not None and self._settled != self._clock:
            first, self._settled = self._pairs.first, self._clock
            settle_all(self._weights.joints, self._clock, self._due, first)

    def _widen(self) -> None:
        super()._widen()
        self._due = None

    def _count(self, clock: int, due: Due | None = None) -> bool:
        """Count what is known of the bits at hand and derive the graph for `clock`.

        Args:
            clock: The number of observations, this one included.
            due: What is put off where all readings are known; if None, every pair is
                judged.
        """
        weights, pairs = self._weights, tuple(self._pairs)
        bits, known = self._read()
        spells = None if self._persistence is None else self._persistence.spells
        if weights.squares is not None:
            born, squares = self._born, weights.squares
            return count_squares(bits, known, squares, born, clock, pairs, spells)
        if due is None:
            due = Due.starting(len(self._twins), self._pairs.codes.size, clock)
        joints, marginals = weights.joints, weights.marginals
        return learn_lazily(bits, joints, marginals, clock, pairs, tuple(due), spells)

    def _limit(self, a: int, b: int, square: Sequence[float]) -> float:
        if self._persistence is None:
            return super()._limit(a, b, square)
        both, against, _, neither = square
        total, spells = float(sum(square)), self._persistence.spells
        from_a, from_b = float(both + against), float(neither + against)
        changes = share_of_changes(spells, a, b ^ 1)

        def is_too_many(exceptions: int) -> bool:
            of = float(exceptions)
            return not is_tolerated(of, from_a, from_b, total, changes)

        rare = range(1, max(1, math.ceil(SHARE * total - START)))
        return 1 + bisect_left(rare, True, key=is_too_many)

    def _judge_newborn(
        self, counts: NDArray[np.uint32], ticks: int
    ) -> tuple[NDArray[np.uint32], NDArray[np.uint8]]:
        codes = np.zeros(counts.shape[1], np.uint8)
        spells = None if self._persistence is None else self._persistence.spells
        row = row_of(counts, 0, len(codes))
        judge_squares(row, float(ticks), self._threshold, spells, codes)
        # What was broken does not stand before it is the sensor's turn to be tested.
        codes[codes >= MARK] = 0
        return counts, codes

    def _total(self) -> int:
        return self._clock

    def _whole(self, *square: float) -> float:
        return sum(square)

    @classmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays, share: range | None) -> Self:
        if str(arrays.get("threshold")) != AUTO:
            threshold = entry(arrays, "threshold", (), np.float64).item()
            return cls(sensorium, threshold, share)
        return cls(sensorium, AUTO, share)

    def _restore_weights(self, arrays: Arrays) -> None:
        super()._restore_weights(arrays)
        if self._persistence is not None:
            self._persistence.restore(arrays, self._twins)

    def _derive(self, arrays: Arrays) -> None:
        inside = (self._weights.marginals <= self._clock).all() and all(
            (squares >= 0).all() and (squares.sum(axis=0) <= self._clock).all()
            for _, squares in self._weights.blocks(self._clock)
        )
        if not inside:
            raise ValueError("weights: must be consistent with the clock")
        if self._persistence is not None:
            self._pairs.codes[:] = entry(
                arrays, "codes", self._pairs.codes.shape, np.uint8
            )
            self._redraw()
        before = self._pairs.codes.copy()
        # Neither bit nor reading at hand: nothing is counted.
        if self._clock:
            self._count(self._clock)
        if self._persistence is not None and (self._pairs.codes != before).any():
            raise ValueError("codes: must go with the weights")
