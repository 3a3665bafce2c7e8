"""The row on learning: an update with its error, against plain numpy.

The plain version is what one writes first: dense weights of all pairs of literals, the
test on whole matrices, and the error by comparing them.
"""

import time

import numpy as np
from numpy.typing import NDArray

from neurosnap.apps.figures import learners
from neurosnap.apps.figures.experiments.learning_error import LearningEntry, errors
from neurosnap.apps.figures.experiments.walks import Walk, walks
from neurosnap.apps.figures.figure import FigureOptions
from neurosnap.errors import NeurosnapError
from neurosnap.poc.order.fields import inclusions
from tools.bench.report import Line, Sizes

_SLACK = 1e-12


def learn(sizes: Sizes) -> list[Line]:
    """Time one update with ``Err``, as the learning figures take it at every step."""
    options = FigureOptions(runs=sizes.batches, steps=2000)
    return [
        _line(learners.learner(options, "grid", learners.LEAST, decay))
        for decay in (None, learners.DECAYS[4])
    ]


def _line(learner: LearningEntry) -> Line:
    ours, plain = pace(learner)
    kind = "empirical" if learner.decay is None else "discounted"
    return Line(
        f"update and Err, {kind}, {learners.SENSORS} sensors (figures 1-3)",
        f"{ours * 1e6:.2f} µs (1/{plain / ours:.0f} of numpy)",
        f"plain numpy {plain * 1e6:.0f} µs",
        "≤ 3.75 µs",  # 32 million updates in 60 s on two cores
        ours <= 3.75e-6,
        {"seconds": ours, "numpy_seconds": plain, "times_numpy": plain / ours},
    )


def pace(learner: LearningEntry, few: int = 500) -> tuple[float, float]:
    """Time both on the learner's first walk; the best of its runs counts for ours.

    Args:
        learner: Its truth must be the containments, without equivalences.
        few: Steps the plain side takes of it.

    Raises:
        NeurosnapError: They disagree about an error.
    """
    chosen = walks(learner.setting, learner.seed, learner.runs, learner.steps)
    found = errors(chosen[0], learner)  # compiled when the clock starts
    times = []
    for walk in chosen:
        began = time.perf_counter()
        errors(walk, learner)
        times.append((time.perf_counter() - began) / learner.steps)
    few = min(few, learner.steps)
    began = time.perf_counter()
    expected = plain_errors(chosen[0], few, learner.threshold, learner.decay)
    plain = (time.perf_counter() - began) / few
    if not np.array_equal(found[:few], expected):
        raise NeurosnapError("errors: must be those of plain numpy, got others")
    return min(times), plain


def plain_errors(
    walk: Walk, steps: int, threshold: float, decay: float | None
) -> NDArray[np.int64]:
    """Return Err(t) against the true containments, without equivalences.

    Args:
        walk: What is observed.
        steps: How much of it.
        threshold: ``tau`` of every pair.
        decay: ``q``; None: the snapshot is empirical.

    Returns:
        ``(steps,)``, in edges. O(steps N²) time, a dozen passes over matrices each.
    """
    literals = np.arange(2 * len(walk.fields))
    star = literals ^ 1
    other = literals[:, None] >> 1 != literals >> 1
    true = inclusions(walk.fields) & other
    weights = np.full(other.shape, 0.0 if decay is None else 0.25)
    np.fill_diagonal(weights, 0.0 if decay is None else 0.5)
    found = np.empty(steps, np.int64)
    for step, place in enumerate(walk.places[:steps].tolist()):
        on = np.repeat(walk.fields[:, place], 2)
        on[1::2] ^= True
        both = on[:, None] & on
        if decay is None:
            weights += both
            edges = _edges(weights, threshold * (step + 1), 0.0, star, other)
        else:
            weights = decay * weights + (1 - decay) * both
            edges = _edges(weights, threshold, _SLACK, star, other)
            weights = _truncated(weights, edges, star)
        found[step] = (edges != true).sum()
    return found


def _edges(
    weights: NDArray[np.float64],
    limit: float,
    slack: float,
    star: NDArray[np.int64],
    other: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    against, converse = weights[:, star], weights[star]
    least = np.minimum(np.minimum(weights, converse), converse[:, star])
    edges: NDArray[np.bool_] = (against < np.minimum(least, limit) - slack) & other
    return edges


def _truncated(
    weights: NDArray[np.float64], edges: NDArray[np.bool_], star: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Move the weight against every implication ([GK] snapshot truncation)."""
    excess = np.where(edges, weights[:, star], 0.0)  # at [a, b]: w_ab* of a -> b
    # The contrapositive b* -> a* has the same at [b*, a*]: so w_ab and w_a*b* gain what
    # w_ab* and w_a*b lose, and the transpose does the same for pairs the other way.
    both = excess + excess.T
    new: NDArray[np.float64] = weights + both - both[:, star]
    return new
