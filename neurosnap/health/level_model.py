"""What each sensor should read, by what all others read: a masked regression.

The *level* of a sensor in a step is the share of its time at which it was on. Each
sensor has three features: its level, the mean of its levels lately, and the share of
the step at which it was known. Means and covariances of all features are counted step
by step. They give the best linear guess of a signal's features from those of all other
signals (Besag 1975; Lauritzen, "Graphical models", 1996): with the inverse `P` of the
covariance and the deviations `d` from the mean, ``r = P d`` says how far signal `s` is
from that guess, ``inv(P_ss) r_s``, and ``r_s' inv(P_ss) r_s`` how unlikely that is. In
the mean it is the number of the signal's features, if all is as it was learned.

Features that are unknown, or not to be believed, are left out: the inverse of the
covariance of the others is a Schur complement of `P`.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
FEATURES = 3
"""Of each sensor: its level, the level lately, and how much of the step it is known."""
LATELY, KNOWN = 1, 2
_RIDGE = 0.05
"""By which share each variance is taken to be larger than it was seen to be."""
_SLACK = np.array([1e-3, 1e-3, 0.05])
"""And by how much: what never changed may change, and what was always known be late."""


class Mask(NamedTuple):
    """The regression that is left where some features are left out.

    ``D`` features of ``N`` sensors, which are ``S`` signals.
    """

    bounds: NDArray[np.int64]
    """``(S + 1,)``: of which sensor on each signal's sensors are."""
    mean: Floats
    """``(D,)``, of the features."""
    rows: Floats
    """``(D, D)``: ``rows @ d`` is `r`; of what is left out rows and columns are 0."""
    blocks: Floats
    """``(D, D)``: ``inv(P_ss)`` of each signal `s`, 0 beside these blocks."""
    sizes: Floats
    """``(S,)``: how many features of each signal are left, at least 1."""
    unsure: Flags
    """``(S,)``: the signals that are guessed much worse without what is left out."""


class LevelModel:
    """The regression of each signal on all others, as it was at one time.

    Args:
        mean: ``(D,)``, of the features, three a sensor.
        covariance: ``(D, D)``.
        bounds: ``(S + 1,)``: of which sensor on each signal's sensors are.

    Cost:
        O(D³) time, O(D²) space; a mask costs the same, and is kept.
    """

    def __init__(
        self, mean: Floats, covariance: Floats, bounds: NDArray[np.int64]
    ) -> None:
        self.mean = mean
        self._spread = spread = covariance.diagonal()
        slack = np.tile(_SLACK, len(mean) // FEATURES)
        self._inverse = np.linalg.inv(covariance + np.diag(_RIDGE * spread + slack))
        self._bounds = bounds * FEATURES
        self._masks: dict[bytes, Mask] = {}

    def mask(self, known: Flags, bad: Sequence[int] = ()) -> Mask:
        """Return the regression on what is known.

        Args:
            known: ``(N,)``, which sensors are. Of others the share of time at which
                they are known is the only feature.
            bad: The signals that no other is judged by. Each of them is judged by
                those that are not bad.
        """
        key = known.tobytes() + bytes(repr(sorted(bad)), "ascii")
        if key not in self._masks:
            if len(self._masks) >= _MASKS:
                self._masks.clear()
            self._masks[key] = self._made(known, bad)
        return self._masks[key]

    def leaned_on(self, signal: int, without: Sequence[int] = ()) -> tuple[int, ...]:
        """Return the sensors that the guess of a signal rests on, the most first.

        Args:
            signal: Its number.
            without: Signals that are left out.
        """
        mask = self.mask(np.ones(len(self.mean) // FEATURES, np.bool_), without)
        part = self._part(signal)
        slopes = mask.blocks[part, part] @ mask.rows[part]
        moves = np.abs(slopes * np.sqrt(self._spread)).sum(0)
        for each in (signal, *without):
            moves[self._part(each)] = 0
        weights = moves.reshape(-1, FEATURES).sum(1)
        order = np.argsort(-weights, kind="stable")
        return tuple(order[weights[order] > weights.max() / 2].tolist())

    def _made(self, known: Flags, bad: Sequence[int]) -> Mask:
        left = np.repeat(known, FEATURES)
        left[KNOWN::FEATURES] = True
        without = left.copy()
        for signal in bad:
            without[self._part(signal)] = False
        made = Mask(
            self._bounds // FEATURES,
            self.mean,
            np.zeros_like(self._inverse),
            np.zeros_like(self._inverse),
            np.ones(len(self._bounds) - 1),
            np.zeros(len(self._bounds) - 1, np.bool_),
        )
        others = self._without(without)
        for signal in range(len(made.sizes)):
            part = self._part(signal)
            used, own = others, left[part].nonzero()[0] + part.start
            if signal in bad:
                alone = without.copy()
                alone[part] = left[part]
                used = self._without(alone)
            made.rows[part] = used[part]
            block = np.ix_(own, own)
            made.blocks[block] = np.linalg.inv(used[block])
            made.sizes[signal] = len(own)
            if own[0] == part.start:
                full = self._inverse[part, part]
                variance = made.blocks[part, part].diagonal()[::FEATURES]
                best = np.linalg.inv(full).diagonal()[::FEATURES]
                made.unsure[signal] = (variance > _WORSE * best).any()
        return made

    def _part(self, signal: int) -> slice:
        return slice(int(self._bounds[signal]), int(self._bounds[signal + 1]))

    def _without(self, left: Flags) -> Floats:
        """Return the inverse of the covariance of the features that are left."""
        made = np.zeros_like(self._inverse)
        kept, gone = left.nonzero()[0], (~left).nonzero()[0]
        inner = self._inverse[np.ix_(kept, kept)]
        if len(gone):
            across = self._inverse[np.ix_(kept, gone)]
            own = self._inverse[np.ix_(gone, gone)]
            inner = inner - across @ np.linalg.solve(own, across.T)
        made[np.ix_(kept, kept)] = inner
        return made


_WORSE = 2.0
"""How many times as large the variance is of a guess that is much worse."""
_MASKS = 8
"""Regressions that are kept; more patterns of what is known than that are rare."""
