"""Compiled loops: learn a whole walk and measure the error at every step.

Each drives a kernel of `neurosnap.poc.learning.update_kernels`. They give up the
interpreter's lock, so threads run them side by side.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.update_kernels import learn_counts, learn_discounted
from neurosnap.system.compiled import njit


@njit(nogil=True)
def follow(
    moves: NDArray[np.intp], start: int, actions: NDArray[np.int64]
) -> NDArray[np.intp]:
    """Return the places of a walk: ``(1 + len(actions),)``, `start` first.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        start: A place.
        actions: Which move is made, one after the other.
    """
    places = np.empty(len(actions) + 1, np.intp)
    places[0] = start
    for step in range(len(actions)):
        places[step + 1] = moves[actions[step], places[step]]
    return places


@njit(nogil=True)
def empirical_errors(
    views: NDArray[np.uint8],
    places: NDArray[np.intp],
    threshold: float,
    truth: NDArray[np.uint8],
    equivalences: bool,
) -> NDArray[np.uint16]:
    """Return Err(t) of an empirical snapshot at each step ([GK] empirical:performance).

    Args:
        views: ``(places, N)``, 0 or 1: the observation at each place; N at most 128,
            or an error may not fit.
        places: ``(steps,)``: where the walk is.
        threshold: ``tau`` of every pair.
        truth: ``(N (N - 1) / 2,)``, the codes of what is true.
        equivalences: Whether the derived graph has its equivalences.

    Returns:
        ``(steps,)``, in edges. O(steps N²/2) time.
    """
    count = views.shape[1]
    joints = np.zeros(len(truth), np.uint32)
    marginals = np.zeros(count, np.uint32)
    limit = np.full(1, threshold)
    codes = np.zeros(len(truth), np.uint8)
    rows = np.zeros((2 * count, (2 * count + 63) // 64), np.uint64)
    errors = np.empty(len(places), np.uint16)
    error = _distance(codes, truth, equivalences)
    for step in range(len(places)):
        bits = views[places[step]]
        if learn_counts(bits, joints, marginals, step + 1, limit, codes, rows):
            error = _distance(codes, truth, equivalences)
        errors[step] = error
    return errors


@njit(nogil=True)
def discounted_errors(
    views: NDArray[np.uint8],
    places: NDArray[np.intp],
    threshold: float,
    decay: float,
    truth: NDArray[np.uint8],
    equivalences: bool,
) -> NDArray[np.uint16]:
    """Return Err(t) of a discounted snapshot a step ([GK] discounted:performance).

    Args:
        views: As in `empirical_errors`.
        places: ``(steps,)``: where the walk is.
        threshold: ``tau`` of every pair.
        decay: ``q`` in [0, 1).
        truth: ``(N (N - 1) / 2,)``, the codes of what is true.
        equivalences: Whether the derived graph has its equivalences.

    Returns:
        ``(steps,)``, in edges. O(steps N²/2) time.
    """
    count = views.shape[1]
    joints = np.full(len(truth), 0.25)
    marginals = np.full(count, 0.5)
    limit = np.full(1, threshold)
    codes = np.zeros(len(truth), np.uint8)
    rows = np.zeros((2 * count, (2 * count + 63) // 64), np.uint64)
    errors = np.empty(len(places), np.uint16)
    error = _distance(codes, truth, equivalences)
    for step in range(len(places)):
        bits = views[places[step]]
        if learn_discounted(bits, joints, marginals, decay, limit, codes, rows):
            error = _distance(codes, truth, equivalences)
        errors[step] = error
    return errors


@njit(nogil=True)
def _distance(
    codes: NDArray[np.uint8], truth: NDArray[np.uint8], equivalences: bool
) -> int:
    """Return how many ordered pairs of literals are an edge in one and not the other.

    Every bit that differs is two: an edge and its contrapositive.
    """
    differ = 0
    for pair in range(len(codes)):
        code = codes[pair]
        if not equivalences and (code == 3 or code == 12):
            code = np.uint8(0)
        bits = code ^ truth[pair]
        differ += (bits & 1) + (bits >> 1 & 1) + (bits >> 2 & 1) + (bits >> 3 & 1)
    return 2 * differ
