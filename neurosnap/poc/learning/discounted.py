"""Learning that forgets: the present weighs more than the past."""

from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.automatic_threshold import AUTO
from neurosnap.poc.learning.discounting_kernels import (
    discount_squares,
    learn_discounted,
    truncate_newborn,
)
from neurosnap.poc.learning.pairs import Weights, excluded
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium

_ROUNDING = 1e-9


class DiscountedSnapshot(Snapshot):
    """Weighs the present more than the past ([GK] defn:discounted update).

    Each observation takes a share ``1 - decay`` of the weight; the graph is derived
    from the new weights; then every square with an implication gives up the weight
    against it ([GK] snapshot truncation), which leaves the derived graph as it is.
    Starts with every weight at 1/4. Sensors that are alike tie all the time, so
    smaller means by more than 1e-12, and zero means at most that. With unknown
    readings, a pair forgets only when both its sensors are known.

    Args:
        sensors: A sensorium, or how many sensors there are.
        threshold: In (0, 1/4].
        decay: What is kept of a weight each time, in [0, 1).

    Raises:
        InvalidValueError: The threshold or the decay is out of range.

    Examples:
        >>> d = DiscountedSnapshot(Sensorium(["door", "motion"]), 0.25, decay=0.5)
        >>> for bits in [(0, 0), (0, 1), (1, 1)]:
        ...     state = d.observe(bits)
        >>> d.poc_graph().implications(d.sensorium)
        [('door', 'motion')]
        >>> d.weight(0, 2), d.weight(0, 3)
        (0.5625, 0.0)
    """

    THRESHOLD: ClassVar[float] = 1 / 8000
    """Where none is given."""
    DECAY: ClassVar[float] = 1 - 2**-6
    """Where none is given."""

    def __init__(
        self,
        sensors: int | Sensorium,
        threshold: float | str = THRESHOLD,
        decay: float = DECAY,
        share: range | None = None,
    ) -> None:
        if threshold == AUTO:
            rule = "must be a number for a discounted snapshot"
            raise InvalidValueError("threshold", rule, threshold)
        super().__init__(sensors, threshold, share)
        if isinstance(decay, bool) or not isinstance(decay, float | int | np.number):
            raise InvalidValueError("decay", "must be a number", decay)
        if not 0 <= decay < 1:
            raise InvalidValueError("decay", "must be in [0, 1)", decay)
        self._decay = float(decay)
        self._weights = Weights.starting(
            len(self.sensorium), np.float64(0.25), np.float64(0.5), self._share
        )

    @property
    def decay(self) -> float:
        """What is kept of a weight each time."""
        return self._decay

    def _update(self) -> bool:
        weights, pairs, tick = self._weights, tuple(self._pairs), self._clock + 1
        if (squares := weights.squares) is not None:
            bits, known = self._bits, self._known
            return discount_squares(bits, known, squares, self._decay, pairs, tick)
        joints, marginals = weights.joints, weights.marginals
        return learn_discounted(self._bits, joints, marginals, self._decay, pairs, tick)

    def _judge_newborn(
        self, counts: NDArray[np.uint32], ticks: int
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        total = counts.sum(axis=0)
        shares = np.where(total, counts / np.maximum(total, 1), self._weights.start)
        codes = np.zeros(len(total), np.uint8)
        truncate_newborn(shares, self._threshold, codes)
        return shares, codes

    def _total(self) -> float:
        return 1.0

    def _whole(self, *_: float) -> float:
        return 1.0

    def arrays(self) -> Arrays:
        """Return its whole state as arrays, by name."""
        # Truncation rounds, and a difference at the very edge of the tolerance may
        # fall on its other side: so the codes are kept and not derived again.
        decay = np.array(self._decay)
        return super().arrays() | {"decay": decay, "codes": self._pairs.codes}

    @classmethod
    def _blank(cls, sensorium: Sensorium, arrays: Arrays, share: range | None) -> Self:
        decay = entry(arrays, "decay", (), np.float64).item()
        threshold = entry(arrays, "threshold", (), np.float64).item()
        return cls(sensorium, threshold, decay, share)

    def _derive(self, arrays: Arrays) -> None:
        marginals = self._weights.marginals
        codes = entry(arrays, "codes", self._pairs.codes.shape, np.uint8)
        if not ((marginals >= 0) & (marginals <= 1)).all():
            raise ValueError("weights: must be consistent")
        for pairs, squares in self._weights.blocks(1.0):
            # Rounding adds up over as many ticks as are remembered. NaN is out of
            # range.
            whole = abs(squares.sum(axis=0) - 1) <= _ROUNDING / (1 - self._decay)
            if not (whole.all() and (squares >= -_ROUNDING).all()):
                raise ValueError("weights: must be consistent")
            if not (excluded(codes[pairs], squares) <= _ROUNDING).all():
                raise ValueError("codes: must go with the weights")
        if not self._clock and codes.any():
            raise ValueError("codes: must go with the weights")
        self._pairs.codes[:] = codes
        self._redraw()
