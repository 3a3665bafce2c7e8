"""Numbers the pairs of sensors, and stores what is known of each.

Pairs of sensors ``j < i`` are packed row by row: pair ``(i, j)`` is entry
``i (i - 1) / 2 + j``. A pair's *code* is the set of its implications, one bit each,
every bit standing for an edge and its contrapositive:

==== ================ ==================
bit  edge             contrapositive
==== ================ ==================
1    ``i -> j``       ``j* -> i*``
2    ``j -> i``       ``i* -> j*``
4    ``i -> j*``      ``j -> i*``
8    ``i* -> j``      ``j* -> i``
==== ================ ==================

Implications exclude each other, so two bits together mean an equivalence: 3 is
``i <-> j`` and 12 is ``i <-> j*``.

The codes are frozen: they are on the wire, in key-frames and in saved snapshots.
Weights are kept in the narrowest type that fits.

Where every reading is known, a square has one free number besides the marginals and
the total, which all squares share: one joint weight a pair is all that is stored, the
*narrow* form. Once a reading was unknown that is over: from then on the four weights
of every pair are stored, the *wide* form, with four times the room.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.archive import Arrays, entry
from neurosnap.poc.learning.graph_kernels import draw
from neurosnap.poc.order.literal_sets import Words

_EQUAL, _OPPOSITE = 3, 12
_BITS = {(0, 0): 1, (1, 1): 2, (0, 1): 4, (1, 0): 8}
"""The bit of an edge from the latter sensor, by which of its literals are stars."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """The evidence for and against an implication ``a -> b``, as it stands now.

    Weights are whole numbers of observations in an empirical snapshot, and shares of
    1 in a discounted one ([GK] eqn:virtual implication).
    """

    total: float
    """What the four weights add up to: how often both sensors were known; or 1."""
    both: float
    """``w_ab``: for it."""
    neither: float
    """``w_a*b*``: for it."""
    other: float
    """``w_a*b``: neither for nor against it; what it leaves open."""
    against: float
    """``w_ab*``: against it."""
    limit: float
    """``tau total``: what the weight against it must be less than."""
    holds: bool
    """Whether ``a -> b`` is an edge of the derived graph, equivalences included."""
    since: int
    """The observation at which what relates the two sensors last changed, from 1; 0 if
    it never did.

    That is when it began to hold, or no longer did, unless an implication became an
    equivalence or the other way round, which is a change too.
    """


class Weights:
    """The weights of the pairs of `N` sensors, ``P = N (N - 1) / 2`` of them.

    What the weights of a narrow square add up to is for its caller to know: `total`.

    Args:
        count: ``N``.
        joint: What each ``w_ij`` is at first.
        marginal: What each ``w_i`` is at first; of the same type.
        share: The sensors whose pairs with those before them are stored; others are
            not.

    Attributes:
        joints: ``(P,)``: ``w_ij``; empty when wide.
        marginals: ``(N,)``: ``w_i``; empty when wide.
        share: As given.
        squares: ``(4, P)``: ``w_ij, w_ij*, w_i*j, w_i*j*``; None when narrow.
    """

    def __init__(
        self, count: int, joint: np.generic, marginal: np.generic, share: range
    ) -> None:
        self.joints: NDArray[Any] = np.full(len(pairs_of(share)), joint)
        self.marginals: NDArray[Any] = np.full(count, marginal)
        self.share = share
        self.squares: NDArray[Any] | None = None

    def widen(self, total: float) -> None:
        """Store the four weights of each pair from now on; none changes."""
        squares = np.empty((4, self.joints.size), self.joints.dtype)
        for pairs, some in self.blocks(total):
            squares[:, pairs] = some
        self.squares = squares
        self.joints, self.marginals = self.joints[:0], self.marginals[:0]

    @property
    def start(self) -> float:
        """Each of the four weights of a pair before all learning, in the wide form."""
        return 0 if self.joints.dtype.kind == "u" else 0.25

    def set(self, pairs: NDArray[np.intp], squares: NDArray[Any] | float) -> None:
        """Set some pairs of a wide store to ``(4, pairs)`` weights, or all to one."""
        if self.squares is None:
            raise RuntimeError("weights: must be wide where sensors come or go")
        self.squares[:, pairs] = squares

    def blocks(self, total: float) -> Iterator[tuple[slice, NDArray[Any]]]:
        """Yield the four weights of each pair, those of one latter sensor at a time.

        All at once they would take eight times the room of what is stored.

        Yields:
            Which of the stored pairs they are, and ``(4, pairs)``, int64 or float64:
            their weights.
        """
        wide = np.int64 if self.joints.dtype.kind == "u" else np.float64
        marginals, stop = self.marginals.astype(wide), 0
        for i in self.share:
            pairs = slice(stop, stop := stop + i)
            if self.squares is not None:
                yield pairs, self.squares[:, pairs].astype(wide)
                continue
            both, mine, yours = self.joints[pairs], marginals[i], marginals[:i]
            rest = total - mine - yours + both
            yield pairs, np.stack([both, mine - both, yours - both, rest])

    def square(self, a: int, b: int, total: float) -> list[float]:
        """Return ``w_ab, w_ab*, w_a*b, w_a*b*`` of literals of different sensors.

        Of twins, which have one row, they may be of the same one.
        """
        high, low = max(a, b), min(a, b)
        pair = pair_of(high, low) - pairs_of(self.share).start
        if self.squares is not None:
            own = self.squares[:, pair].tolist()
        else:
            mine, yours = (self.marginals[each >> 1].item() for each in (high, low))
            both = mine if high >> 1 == low >> 1 else self.joints[pair].item()
            own = [both, mine - both, yours - both, total - mine - yours + both]
        first, second = (1, 2) if high == b else (2, 1)  # which place is of a, and of b
        place = first * (a & 1) + second * (b & 1)
        return [own[place ^ k] for k in (0, second, first, first + second)]

    def arrays(self) -> Arrays:
        """Return what is stored, by name."""
        if self.squares is not None:
            return {"squares": self.squares}
        return {"joints": self.joints, "marginals": self.marginals}

    def restore(self, arrays: Arrays) -> None:
        """Take over what was stored, in the form it was stored in.

        Raises:
            ValueError: An array is not there, or has another shape or type.
        """
        kind = self.joints.dtype
        if "squares" in arrays:
            shape = (4, self.joints.size)
            self.squares = entry(arrays, "squares", shape, kind).copy()
            self.joints, self.marginals = self.joints[:0], self.marginals[:0]
            return
        self.joints[:] = entry(arrays, "joints", self.joints.shape, kind)
        self.marginals[:] = entry(arrays, "marginals", self.marginals.shape, kind)


def pair_of(a: int, b: int) -> int:
    """Return the number of the pair of the sensors of two literals."""
    i, j = max(a, b) >> 1, min(a, b) >> 1
    return i * (i - 1) // 2 + j


def pairs_of(share: range) -> range:
    """Return the numbers of the pairs of some sensors with those before them."""
    return range(*(k * (k - 1) // 2 for k in (share.start, share.stop)))


def strict(codes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the codes without their equivalences."""
    both = (codes == _EQUAL) | (codes == _OPPOSITE)
    return np.where(both, np.uint8(0), codes)


def leads(code: int, a: int, b: int) -> bool:
    """Return whether a pair's code says that `a` implies `b`, two of its literals."""
    if a >> 1 < b >> 1:
        a, b = b ^ 1, a ^ 1
    return bool(code & _BITS[a & 1, b & 1])


def codes_of(edges: Iterable[tuple[int, int]], pairs: int) -> NDArray[np.uint8]:
    """Return the codes, ``(P,)``, of edges ``a -> b`` between literals of sensors."""
    codes = np.zeros(pairs, np.uint8)
    for a, b in edges:
        if a >> 1 < b >> 1:
            a, b = b ^ 1, a ^ 1
        codes[pair_of(a, b)] |= _BITS[a & 1, b & 1]
    return codes


def rows_of(codes: NDArray[np.uint8], sensors: int) -> Words:
    """Return the edges that the codes of all pairs stand for, packed: ``(2N, w)``."""
    rows: Words = np.zeros((2 * sensors, (2 * sensors + 63) // 64), np.uint64)
    draw(codes, rows, 0)
    return rows


def excluded(
    codes: NDArray[np.uint8], squares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the weight that each code says is 0; infinite where it is no code.

    Args:
        codes: ``(P,)``.
        squares: ``(4, P)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*`` of each pair.
    """
    both, only_i, only_j, neither = squares
    return np.select(
        [codes == code for code in (0, 1, 2, _EQUAL, 4, 8, _OPPOSITE)],
        [
            np.zeros(codes.shape),
            only_i,
            only_j,
            np.maximum(only_i, only_j),
            both,
            neither,
            np.maximum(both, neither),
        ],
        np.inf,
    )
