"""Learning that forgets: the present weighs more than the past.

Where every reading is known a joint weight a pair is stored; where readings may be
unknown, four weights a pair, of which those of an unknown reading are not touched.

The compiled loops over a row are written for vector instructions, as those of
`neurosnap.poc.learning.graph_kernels`.
"""

from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.automatic_threshold import AUTO
from neurosnap.poc.learning.graph_kernels import (
    Pairs,
    Row,
    code_of,
    difference,
    end_of,
    place_of,
    rewire,
    row_of,
)
from neurosnap.poc.learning.pairs import Weights, excluded
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.sensorium import Sensorium
from neurosnap.system.compiled import njit

Floats = NDArray[np.float64]
SLACK = 1e-12
"""By how much a discounted weight must be smaller to count as smaller."""
TINY = 1e-300
"""Halving goes on below the least normal number, where arithmetic is a hundred times
slower; what is as small as this is 0 to every comparison already."""


@njit()
def learn_discounted(
    bits: NDArray[np.uint8],
    joints: Floats,
    marginals: Floats,
    decay: float,
    pairs: tuple[Any, ...],
    tick: int,
) -> bool:
    """Weigh in one observation, derive, truncate ([GK] defn:discounted update).

    ``n <- q n + (1 - q) x`` for marginals and joints; codes as `code_of` has them,
    where ``<`` is smaller by more than `SLACK` and ``= 0`` at most `SLACK`; then every
    square with an implication loses the weight against it ([GK] snapshot truncation).
    Marginals keep.

    Args:
        bits: ``(N,)``, 0 or 1.
        joints: ``(P,)``, updated.
        marginals: ``(N,)``, updated.
        decay: ``q`` in [0, 1).
        pairs: A `Pairs`; updated.
        tick: What changes are dated with.

    Returns:
        Whether any code changed. O(N²/2) time.
    """
    count, kept = bits.shape[0], Pairs(*pairs)
    limit, codes, first = kept.threshold, kept.codes, kept.first
    gain = np.empty(count, np.float64)
    fresh = np.empty(count, np.uint8)
    for j in range(count):
        gain[j] = (1.0 - decay) * bits[j]
        marginals[j] = decay * marginals[j] + gain[j]
    changed = False
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        joint, now = joints[start : start + i], codes[start : start + i]
        on = float(bits[i])
        mine = marginals[i]
        rest = 1.0 - mine
        for j in range(i):
            yours = marginals[j]
            # The same products and sums as for the marginals: with x_i = x_i x_j, a
            # joint that was equal to its marginal stays equal to it, bit for bit.
            w11 = decay * joint[j] + on * gain[j]
            w10 = mine - w11
            w01 = yours - w11
            w00 = rest - w01
            code, up, down = code_of(w11, w10, w01, w00, limit, SLACK)
            fresh[j] = code
            # Taking all weight from w_ij* or w_i*j, whichever is smaller, is the
            # largest joint that the marginals allow; from w_ij or w_i*j*, the least.
            w11 = min(mine, yours) if up else w11
            joint[j] = max(0.0, mine + yours - 1.0) if down else w11
        if difference(fresh, now):
            rewire(i, fresh, kept, tick)
            changed = True
    return changed


@njit()
def discount_squares(
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    squares: Floats,
    decay: float,
    pairs: tuple[Any, ...],
    tick: int,
) -> bool:
    """Weigh in what is known of one observation, derive, truncate.

    ``w_ab <- q w_ab + (1 - q) [a and b both on]`` where both sensors are known; codes
    and truncation as in `learn_discounted`, for these pairs alone: what is not touched
    keeps its code as well, which rounding might turn.

    Args:
        bits: ``(N,)``, 0 or 1; any where unknown.
        known: ``(N,)``, 0 or 1.
        squares: ``(4, P)``, updated; each column adds up to 1.
        decay: ``q`` in [0, 1).
        pairs: A `Pairs`; updated.
        tick: What changes are dated with.

    Returns:
        Whether any code changed. O(N k) time for ``k`` known sensors.
    """
    count, kept = bits.shape[0], Pairs(*pairs)
    limit, codes, first = kept.threshold, kept.codes, kept.first
    # By the other sensor of a pair: what is kept, and gained where it reads on, or off.
    keep = np.where(known > 0, decay, 1.0)
    on = (bits & known).astype(np.float64) * (1.0 - decay)
    off = (known & ~bits).astype(np.float64) * (1.0 - decay)
    none = np.zeros(count, np.float64)
    shift = np.empty(count, np.float64)
    fresh = np.empty(count, np.uint8)
    changed = False
    for i in range(first, end_of(first, codes.shape[0])):
        if not known[i]:
            continue
        start = place_of(i, first)
        row, now = row_of(squares, start, start + i), codes[start : start + i]
        _fade(row.both, keep, on if bits[i] else none)
        _fade(row.only_i, keep, off if bits[i] else none)
        _fade(row.only_j, keep, none if bits[i] else on)
        _fade(row.neither, keep, none if bits[i] else off)
        _truncate(row, known, limit, shift, now, fresh)
        if difference(fresh, now):
            rewire(i, fresh, kept, tick)
            changed = True
    return changed


@njit()
def _truncate(
    row: Row,
    known: NDArray[np.uint8],
    limit: float,
    shift: Floats,
    now: NDArray[np.uint8],
    fresh: NDArray[np.uint8],
) -> None:
    """Derive the codes of one row, and take away the weight against them.

    Args:
        row: The weights, updated.
        known: ``(N,)``: the pairs of other sensors keep code and weights.
        limit: The threshold.
        shift: Overwritten.
        now: ``(i,)``, the codes as they are.
        fresh: Overwritten with the codes as they are to be.
    """
    both, only_i, only_j, neither = row.both, row.only_i, row.only_j, row.neither
    for j in range(both.shape[0]):
        w11, w10, w01, w00 = both[j], only_i[j], only_j[j], neither[j]
        code, up, down = code_of(w11, w10, w01, w00, limit, SLACK)
        fresh[j] = code if known[j] else now[j]
        # The weight against an implication is added to both of its sort's others
        # and taken from both of its own: of which itself becomes 0, exactly.
        up, down = up & (known[j] > 0), down & (known[j] > 0)
        shift[j] = min(w10, w01) if up else (-min(w11, w00) if down else 0.0)
    for j in range(both.shape[0]):
        both[j] += shift[j]
        neither[j] += shift[j]
    for j in range(both.shape[0]):
        only_i[j] -= shift[j]
        only_j[j] -= shift[j]


@njit()
def _fade(weights: Floats, keep: Floats, gain: Floats) -> None:
    """Keep a share of each weight and add what is gained; the least become 0.

    What is kept whole is not touched.
    """
    for j in range(weights.shape[0]):
        weight = keep[j] * weights[j] + gain[j]
        weights[j] = weight if (weight > TINY) | (keep[j] == 1.0) else 0.0


_ROUNDING = 1e-9


class DiscountedSnapshot(Snapshot):
    """A snapshot that weighs the present more ([GK] defn:discounted update).

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
        if isinstance(decay, bool) or not isinstance(decay, float | int | np.number):
            raise InvalidValueError("decay", "must be a number", decay)
        if not 0 <= decay < 1:
            raise InvalidValueError("decay", "must be in [0, 1)", decay)
        self._decay = float(decay)
        super().__init__(sensors, threshold, share)

    @property
    def decay(self) -> float:
        """What is kept of a weight each time."""
        return self._decay

    def _begin_weights(self, count: int, rows: range) -> None:
        self._weights = Weights(count, np.float64(0.25), np.float64(0.5), rows)

    def _update(self) -> bool:
        weights, pairs, tick = self._weights, tuple(self._pairs), self._clock + 1
        if (squares := weights.squares) is not None:
            return discount_squares(*self._read(), squares, self._decay, pairs, tick)
        (bits, _), joints = self._read(), weights.joints
        marginals, decay = weights.marginals, self._decay
        return learn_discounted(bits, joints, marginals, decay, pairs, tick)

    def _judge_newborn(
        self, counts: NDArray[np.uint32], ticks: int
    ) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
        total = counts.sum(axis=0)
        shares = np.where(total, counts / np.maximum(total, 1), self._weights.start)
        codes, known = np.zeros((2, len(total)), np.uint8)
        known.fill(1)
        row, shift = row_of(shares, 0, len(total)), np.empty(len(total))
        _truncate(row, known, self._threshold, shift, codes, codes)
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
