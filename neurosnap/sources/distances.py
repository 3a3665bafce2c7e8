"""Distances between the places of a world, in actions."""

import numpy as np
from numpy.typing import NDArray


def distances_to(
    moves: NDArray[np.intp], aims: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Return the fewest actions that lead from each place to one that is wanted.

    Moves need no way back: what counts is the way there. A place from which no actions
    lead there is infinitely far, so a step to it from elsewhere is for the worse and a
    step between two of them is neither.

    Args:
        moves: ``(actions, places)``; where an action leads from a place.
        aims: ``(places,)``; which places are wanted.

    Returns:
        ``(places,)``, whole numbers from 0 up or ``inf``. Takes a pass over `moves` for
        each distance there is.
    """
    distances = np.where(aims, 0.0, np.inf)
    found = aims.copy()
    distance = 0
    while True:
        # Backwards, all at once: the places from which one action leads to a found one.
        nearest = found[moves].any(axis=0) & ~found
        if not nearest.any():
            return distances
        distance += 1
        distances[nearest] = distance
        found |= nearest
