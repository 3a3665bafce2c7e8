"""Learning error: one learner in one setting, at every step of every run."""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.discounted import DiscountedSnapshot
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pairs import strict
from neurosnap.poc.learning.snapshot import Snapshot
from tools.paper.figure import TruthKind
from tools.paper.table import Entry
from tools.paper.walks import Walk, thresholded, walk


class LearningEntry(Entry, frozen=True, kw_only=True):
    """One learner in one setting: all its runs are one entry of the table."""

    steps: int
    """Observations in each run."""
    setting: str
    """The setting's name."""
    threshold: float
    """``tau`` of every pair, in (0, 1/4]."""
    decay: float | None
    """``q`` of a discounted snapshot, in [0, 1); None: the snapshot is empirical."""
    truth: TruthKind
    """What its graph is compared with."""

    def row(self, run: int) -> NDArray[np.uint16]:
        """Return Err(t) at each step of a run, in edges: ``(steps,)``."""
        seen = walk(self.setting, self.seed, run, self.steps)
        true = seen.contained
        if self.truth == "thresholded":
            true = thresholded(seen.fields, seen.law, self.threshold)
        return errors(seen, new_snapshot(self.threshold, self.decay, 20), true)


def new_snapshot(threshold: float, decay: float | None, sensors: int) -> Snapshot:
    """Return a snapshot that has seen nothing; empirical if there is no decay."""
    if decay is None:
        return EmpiricalSnapshot(sensors, threshold)
    return DiscountedSnapshot(sensors, threshold, decay)


def errors(
    seen: Walk, snapshot: Snapshot, true: NDArray[np.uint8]
) -> NDArray[np.uint16]:
    """Return Err(t) of a learner that is shown a walk ([GK] empirical:performance).

    ``Err(t)`` is how many ordered pairs of literals of different sensors are an edge of
    the derived graph, without its equivalences, after observation ``t`` and not of the
    true one, or the reverse.

    Args:
        seen: What is observed.
        snapshot: Who learns.
        true: ``(N (N - 1) / 2,)``, the codes of what is true.

    Returns:
        ``(steps,)``, in edges, `steps` those of the walk.
    """
    views = np.ascontiguousarray(seen.fields.T)
    found = np.empty(len(seen.places), np.uint16)
    error = _distance(snapshot, true)
    for step, place in enumerate(seen.places.tolist()):
        if snapshot.learn(views[place]):
            error = _distance(snapshot, true)
        found[step] = error
    return found


def _distance(snapshot: Snapshot, true: NDArray[np.uint8]) -> int:
    """Return in how many edges codes differ: a bit stands for two."""
    return 2 * int(np.bitwise_count(strict(snapshot.codes) ^ true).sum())
