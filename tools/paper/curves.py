"""Statistics of error curves: mean, spread, and rate of decay."""

from dataclasses import dataclass
from functools import cached_property

import msgspec
import numpy as np
from numpy.typing import NDArray

from tools.paper.learning_error import LearningEntry

_NEAR = 1.1
_ONE_EDGE = 1.0


class Rate(msgspec.Struct, frozen=True):
    """An exponential fitted to a falling mean: ``exp(-rate t)``."""

    rate: float
    """By how much the logarithm of the mean falls, a step."""
    half_life: float
    """Steps in which the mean halves."""
    r2: float
    """The share of the logarithm's variance it explains, in [0, 1]."""
    first: int
    """The step the fit begins with, counted from 1."""
    last: int
    """The step it ends with."""


@dataclass(frozen=True)
class Curve:
    """The errors of one learner in one setting, run by run and step by step.

    Entry ``t - 1`` belongs to step ``t``, which is after ``t`` observations.
    """

    cell: LearningEntry
    rows: NDArray[np.uint16]
    """``(runs, steps)``, in edges."""

    @cached_property
    def mean(self) -> NDArray[np.float64]:
        """The mean of the runs: ``(steps,)``."""
        return np.asarray(self.rows.mean(axis=0))

    @property
    def woken(self) -> int | None:
        """The first step at which a run's error differs from its first, if one does."""
        moved = np.flatnonzero((self.rows != self.rows[:, :1]).any(axis=0))
        return int(moved[0]) + 1 if moved.size else None

    @property
    def level(self) -> float:
        """The mean over the last tenth of the steps: where it has come to."""
        return float(self.mean[-max(1, len(self.mean) // 10) :].mean())

    @property
    def error(self) -> float:
        """The standard error of the last mean."""
        return float(self.rows[:, -1].std() / np.sqrt(self.cell.runs))

    @property
    def peak(self) -> int:
        """The last step at which the mean is at its largest, counted from 1."""
        return len(self.mean) - int(self.mean[::-1].argmax())

    @property
    def halved(self) -> int | None:
        """The first step after the peak with half of it or less; None: there is none.

        This is the waiting time until meaningful learning.
        """
        fallen = np.flatnonzero(self.mean[self.peak :] <= self.mean[self.peak - 1] / 2)
        return self.peak + int(fallen[0]) + 1 if fallen.size else None

    @property
    def reaches_zero(self) -> bool:
        """Whether no run is wrong about anything at the last step."""
        return not self.rows[:, -1].any()


def fitted(curve: Curve) -> Rate | None:
    """Fit ``ln(mean)`` over its decaying part by least squares.

    The decaying part begins at the peak (its last step) and ends at the first step
    after it at which the mean is at most 1 edge, or within a tenth of its `level`, or,
    where neither comes, with the walk. Steps at which the mean is 0 have no logarithm
    and do not count.

    Returns:
        The fit; None if the mean does not even halve in that part, or has fewer than
        three steps there.
    """
    from_peak = curve.mean[curve.peak - 1 :]
    low = from_peak <= max(_ONE_EDGE, _NEAR * curve.level)
    length = int(low.argmax()) + 1 if low.any() else len(from_peak)
    steps = curve.peak + np.flatnonzero(from_peak[:length] > 0)
    if len(steps) < 3 or from_peak[length - 1] > from_peak[0] / 2:
        return None
    logs = np.log(curve.mean[steps - 1])
    slope, intercept = np.polyfit(steps, logs, 1)
    if slope >= 0:
        return None
    left = float(((logs - slope * steps - intercept) ** 2).sum())
    spread = float(((logs - logs.mean()) ** 2).sum())
    return Rate(
        rate=-float(slope),
        half_life=-float(np.log(2) / slope),
        r2=1.0 - left / spread,
        first=int(steps[0]),
        last=int(steps[-1]),
    )
