"""How odd a reading is, by what all other sensors read: a masked regression.

Each sensor is guessed from the others of the last readings, by the best linear guess
(Besag 1975; Lauritzen, "Graphical models", 1996). With the inverse `P` of their
covariance and the deviations `d` from their means, ``P d / diag(P)`` is by how much
each reading misses its guess. Of a sensor that is wrong that is about 1, while the
others miss by a share of it: so it tells which of two that contradict each other is
wrong, where the rule that they break does not.

What is counted are whole numbers, and each sum is made in a fixed order, so that the
result is the same on every machine.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.reading_history import History
from neurosnap.poc.order.literal_sets import Words

MOST = 64
"""Sensors that a guess rests on, with those asked for: all, or what goes with them."""
_RIDGE = 0.1
"""By which share each variance is taken to be larger than it was seen to be."""
_SLACK = 1e-3
"""And by how much: what never changed may change."""
_SAMPLED = 8
"""Of so many ticks one is looked at to find what goes with a sensor."""
Floats = NDArray[np.float64]


def oddness(
    history: History, asked: NDArray[np.int64], seen: NDArray[np.bool_]
) -> Floats:
    """Return by how much readings miss what those of other sensors would have them be.

    Args:
        history: The readings before.
        asked: ``(n,)``: sensors that are read.
        seen: ``(2N,)``, the literals that are read.

    Returns:
        ``(n,)``, from 0 on; about 1 for the opposite of a sure guess. All 0 if `asked`
        are more than `MOST`.

    Cost:
        O(n W N) time for ``W`` words of history, and O(MOST³).
    """
    if not history.tick or not 0 < len(asked) <= MOST:
        return np.zeros(len(asked))
    used = _with_alike(history, asked, seen[::2] | seen[1::2])
    mean, covariance = _moments(history, used)
    inverse = _inverse(covariance + np.diag(_RIDGE * covariance.diagonal() + _SLACK))
    missed = (inverse * (seen[::2][used] - mean)).sum(1) / inverse.diagonal()
    odd: Floats = np.abs(missed[: len(asked)])
    return odd


def _with_alike(
    history: History, asked: NDArray[np.int64], known: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the sensors asked for, and those that go with them most, in some ticks."""
    others = np.setdiff1d(known.nonzero()[0], asked)
    room = MOST - len(asked)
    if len(others) > room:
        on = history.on[::_SAMPLED]
        share = np.bitwise_count(on).sum(0) / (64 * len(on))
        spread = np.maximum(share * (1 - share), _SLACK)
        alike = np.zeros(len(known))
        for sensor in asked.tolist():
            both = np.bitwise_count(on & on[:, [sensor]]).sum(0) / (64 * len(on))
            apart = (both - share * share[sensor]) ** 2 / spread[sensor]
            alike = np.maximum(alike, apart / spread)
        others = others[np.argsort(-alike[others], kind="stable")[:room]]
    return np.concatenate([asked, others])


def _moments(history: History, used: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return means and covariances; what is unknown counts as the mean."""
    on = history.on[:, used]
    known = on | history.off[:, used]
    both = _together(on, on)
    # As a rule all are known at the same ticks, and nothing else is to be counted.
    one = np.repeat(both.diagonal()[:, None], len(both), axis=1)
    every = np.full_like(both, np.bitwise_count(known[:, 0]).sum())
    if (known != known[:, :1]).any():
        one, every = _together(on, known), _together(known, known)
    mean = both.diagonal() / np.maximum(every.diagonal(), 1)
    sums = both - one * mean - one.T * mean[:, None] + every * np.outer(mean, mean)
    return mean, sums / history.ticks


def _together(some: Words, others: Words) -> NDArray[np.int64]:
    """Return at how many ticks each of some is so together with each other."""
    return np.array(
        [np.bitwise_count(others & ring[:, None]).sum(0) for ring in some.T], np.int64
    )


def _inverse(matrix: Floats) -> Floats:
    """Return the inverse of a positive definite matrix, pivot by pivot."""
    left = matrix.copy()
    for k in range(len(left)):
        pivot = left[k, k]
        row, column = left[k] / pivot, left[:, k].copy()
        left -= np.outer(column, row)
        left[k], left[:, k], left[k, k] = row, -column / pivot, 1 / pivot
    return left
