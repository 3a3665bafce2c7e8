"""The walk that draws its actions uniformly, as a Markov chain on the places.

How often it is at a place in the long run is what the normalised weights of an
empirical snapshot converge to, so this is the truth that its thresholds cut. A chain
may be periodic, as on a cycle with an even number of places, and its distribution at a
time need not converge: what is given here is the limit of the averages over time,
which always exists.

References:
    [GK] section "Performance of Empirical Agents".
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from world.places import is_whole


def transitions(moves: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the probability of each step.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.

    Returns:
        ``(places, places)``; at ``[p, q]`` the share of actions that lead from `p` to
        `q`. Rows sum to 1.
    """
    return _counts(moves) / len(moves)


def stationary(moves: NDArray[np.intp], start: int) -> NDArray[np.float64]:
    """Return the share of time that the walk spends at each place in the long run.

    Where chance decides which of several parts of the world the walk ends up in, it is
    the expected share. A part where as many actions lead into each place as out of it
    is visited uniformly, and comes out so exactly: thresholds decide between equals
    there. ([GK] asks for a way back from each place to the last; that there are as many
    ways back is needed too, and holds in all worlds of the paper.)

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        start: The place that the walk starts at.

    Returns:
        ``(places,)``, summing to 1; the limit of the averages over time, to rounding.
        O(places³ log places) time.

    Raises:
        InvalidValueError: `start` is not a place.
    """
    places = moves.shape[1]
    if not is_whole(start) or not 0 <= start < places:
        raise InvalidValueError("start", f"must be a place in 0..{places - 1}", start)
    counts = _counts(moves)
    reaches = _reaches(counts)
    returns = np.array((~reaches | reaches.T).all(axis=1))
    shares = np.zeros(places)
    for part in np.unique(reaches[returns & reaches[start]], axis=0):
        inner = _share_of_each(counts[np.ix_(part, part)])
        shares[part] = _chance_to_enter(counts, ~returns, part, start) * inner
    return shares


def _counts(moves: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return how many actions lead from each place to each: ``(places, places)``."""
    places = moves.shape[1]
    counts = np.zeros((places, places), dtype=np.intp)
    np.add.at(counts, (np.arange(places), moves), 1)
    return counts


def _reaches(counts: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which places each leads to, in any number of steps or none."""
    reaches = (counts > 0) | np.eye(len(counts), dtype=np.bool_)
    while True:
        # Twice as many steps each time. A sum that is not 0 cannot round to 0.
        longer = reaches.astype(np.float32) @ reaches.astype(np.float32) > 0
        if (longer == reaches).all():
            return reaches
        reaches = longer


def _chance_to_enter(
    counts: NDArray[np.intp],
    passing: NDArray[np.bool_],
    part: NDArray[np.bool_],
    start: int,
) -> float:
    """Return the probability that a walk from `start` ends up in `part`.

    Args:
        counts: ``(places, places)``; how many actions lead from each place to each.
        passing: ``(places,)``; those that are left for good some day.
        part: ``(places,)``; some that are never left, and lead to each other.
        start: The place that the walk starts at.
    """
    if not passing[start]:
        return float(part[start])
    # Chances at the places passed: those of entering at once and of entering later.
    steps = counts / counts[0].sum()
    later = np.eye(passing.sum()) - steps[np.ix_(passing, passing)]
    chances = np.linalg.solve(later, steps[np.ix_(passing, part)].sum(axis=1))
    return float(chances[passing[:start].sum()])


def _share_of_each(counts: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the stationary distribution where all places lead to each other."""
    places, actions = len(counts), counts[0].sum()
    if (counts.sum(axis=0) == actions).all():
        return np.full(places, 1 / places)
    # What flows in is what flows out. One of these equations follows from the others,
    # and gives way to the one that all shares sum to 1.
    balance = counts.T / actions - np.eye(places)
    balance[-1] = 1.0
    total = np.zeros(places)
    total[-1] = 1.0
    return np.linalg.solve(balance, total)
