"""Distances in actions by definition."""

from collections import deque

import numpy as np
from numpy.typing import NDArray


def fewest_actions(moves: NDArray[np.intp], target: int) -> list[float]:
    """One breadth-first search forwards from each place, as slowly as can be."""
    found = []
    for start in range(moves.shape[1]):
        depth = {start: 0}
        queue = deque([start])
        while queue:
            here = queue.popleft()
            for there in moves[:, here].tolist():
                if there not in depth:
                    depth[there] = depth[here] + 1
                    queue.append(there)
        found.append(depth.get(target, float("inf")))
    return found
