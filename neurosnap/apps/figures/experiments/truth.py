"""Ground truth: true containments, or the long-run weights of a walk.

A truth is given as a code a pair of sensors, with the bits of
`neurosnap.poc.learning.pair_codes`. As a truth may hold any of the four bits at once
(an empty field lies within everything), its codes are sets of implications and nothing
more.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.fields import inclusions

_SLACK = 1e-12
"""By how much a probability must be smaller: sums of equal shares tie, and round."""


def stationary(moves: NDArray[np.intp], start: int) -> NDArray[np.float64]:
    """Return the stationary law of the walk that draws its moves uniformly.

    ``pi P = pi`` is solved as it stands, so a walk that is periodic has its law too.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        start: Where the walk begins; places it cannot reach have probability 0.

    Returns:
        ``(places,)``, adds up to 1. O(places³) time.

    Raises:
        InvalidValueError: From `start` the walk may be caught in more than one part of
            the space, so that it has no one law.
    """
    actions, places = moves.shape
    chances = np.zeros((places, places))
    for leads in moves:
        chances[np.arange(places), leads] += 1 / actions
    reached = np.flatnonzero(_reached(moves, start))
    closed = chances[np.ix_(reached, reached)]
    equations = np.vstack([closed.T - np.eye(len(reached)), np.ones(len(reached))])
    right = np.append(np.zeros(len(reached)), 1.0)
    law, _, rank, _ = np.linalg.lstsq(equations, right)
    if rank < len(reached):
        rule = "must lead to one recurrent part of the space"
        raise InvalidValueError("start", rule, start)
    pi = np.zeros(places)
    pi[reached] = np.maximum(law, 0.0)  # a place left for good may come out at -1e-17
    return np.asarray(pi / pi.sum(), np.float64)


def contained(fields: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the true containments ([GK] eqn:true dir matrix).

    ``a -> b`` iff the field of `a` lies within the field of `b`.

    Args:
        fields: ``(N, places)``; where each sensor is on.

    Returns:
        ``(N (N - 1) / 2,)``, a code a pair.
    """
    return codes_of(inclusions(fields))


def thresholded(
    fields: NDArray[np.bool_],
    law: NDArray[np.float64],
    threshold: float,
    equivalences: bool,
) -> NDArray[np.uint8]:
    """Return what is derived of the walk's weights ([GK] eqn:thresholded dir matrix).

    ``a -> b`` iff ``pi(ab*) < min(tau, pi(ab), pi(a*b*), pi(a*b))``.

    Args:
        fields: ``(N, places)``; where each sensor is on.
        law: ``(places,)``, as `stationary` gives it.
        threshold: ``tau``, in (0, 1/4].
        equivalences: Whether ``pi(ab*) = pi(a*b) = 0`` adds ``a <-> b``.

    Returns:
        ``(N (N - 1) / 2,)``, a code a pair.
    """
    sensors, places = fields.shape
    literals = np.stack([fields, ~fields], axis=1).reshape(2 * sensors, places)
    both = (literals * law) @ literals.T.astype(np.float64)
    star = np.arange(2 * sensors) ^ 1
    against, converse, rest = both[:, star], both[star], both[star][:, star]
    least = np.minimum(np.minimum(both, converse), np.minimum(rest, threshold))
    edges = against < least - _SLACK
    if equivalences:
        edges |= (against <= _SLACK) & (converse <= _SLACK)
    return codes_of(edges)


def codes_of(edges: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the codes of edges that are closed under contraposition.

    Args:
        edges: ``(2N, 2N)``; those between literals of one sensor do not count.

    Returns:
        ``(N (N - 1) / 2,)``; any of the four bits may be on.
    """
    i, j = np.tril_indices(len(edges) // 2, -1)
    bits = (
        edges[2 * i, 2 * j],
        edges[2 * j, 2 * i],
        edges[2 * i, 2 * j + 1],
        edges[2 * i + 1, 2 * j],
    )
    codes = sum(on.astype(np.uint8) << bit for bit, on in enumerate(bits))
    return np.asarray(codes, np.uint8)


def _reached(moves: NDArray[np.intp], start: int) -> NDArray[np.bool_]:
    """Return which places the walk can get to."""
    reached = np.zeros(moves.shape[1], np.bool_)
    reached[start] = True
    fresh = reached
    while fresh.any():
        there = np.zeros_like(reached)
        there[moves[:, fresh]] = True
        fresh = there & ~reached
        reached |= fresh
    return reached
