"""Learning error: one learner in one setting, at every step of every run."""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures.experiments import kernels, truth
from neurosnap.apps.figures.experiments.entry import key_of
from neurosnap.apps.figures.experiments.per_step import PerStepEntry
from neurosnap.apps.figures.experiments.walks import Walk, walks

TruthKind: TypeAlias = Literal["contained", "thresholded"]

_VERSION = 1
"""Raised whenever the same options come to give other errors."""


class LearningEntry(PerStepEntry, frozen=True, kw_only=True):
    """One learner in one setting: all its runs are one entry of the table."""

    setting: str
    """The setting's name."""
    threshold: float
    """``tau`` of every pair, in (0, 1/4]."""
    decay: float | None
    """``q`` of a discounted snapshot, in [0, 1); None: the snapshot is empirical."""
    truth: TruthKind
    """What its graph is compared with."""
    equivalences: bool
    """Whether its graph has its equivalences."""

    @property
    def name(self) -> str:
        """What people see of it in a listing of files."""
        kind = "empirical" if self.decay is None else "discounted"
        return f"{kind}-{self.setting}"

    @property
    def key(self) -> str:
        """All that its rows depend on, as JSON."""
        return key_of(self, "learning", _VERSION)

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return Err(t) at each step of a run, in edges: ``(steps,)``.

        A function of the cell and `run`, whichever thread asks.
        """
        walk = walks(self.setting, self.seed, self.runs, self.steps)[run]
        return errors(walk, self)


def errors(walk: Walk, learner: LearningEntry) -> NDArray[np.uint16]:
    """Return Err(t) of a learner that is shown a walk ([GK] empirical:performance).

    ``Err(t)`` is how many ordered pairs of literals of different sensors are an edge of
    the derived graph after observation ``t`` and not of the true one, or the reverse.

    Args:
        walk: What is observed.
        learner: Who learns; its setting, runs, steps and seed do not matter.

    Returns:
        ``(steps,)``, in edges, `steps` those of the walk.
    """
    if learner.truth == "contained":
        true = walk.contained
    else:
        true = truth.thresholded(
            walk.fields, walk.law, learner.threshold, learner.equivalences
        )
    seen = (walk.views, walk.places, learner.threshold)
    found: NDArray[np.uint16]
    if learner.decay is None:
        found = kernels.empirical_errors(*seen, true, learner.equivalences)
    else:
        found = kernels.discounted_errors(
            *seen, learner.decay, true, learner.equivalences
        )
    return found
