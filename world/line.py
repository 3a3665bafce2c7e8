"""Places in a line: steps along it, and threshold sensors that divide it."""

import numpy as np
from numpy.typing import NDArray


def steps(places: int) -> NDArray[np.intp]:
    """Return the moves ``(2, places)``: forward, then back; both stop at the ends."""
    here = np.arange(places)
    return np.stack([np.minimum(here + 1, places - 1), np.maximum(here - 1, 0)])


def thresholds(places: int) -> NDArray[np.bool_]:
    """Return the fields ``(places - 1, places)`` of the paper's ``a_1 < a_2 < …``.

    Row ``k - 1`` is ``a_k``: on iff the position is below `k`.
    """
    # Windows into one row: a path of 100,000 places takes as many bytes, not 10 GB.
    row = np.arange(2 * places) < places
    windows = np.lib.stride_tricks.sliding_window_view(row, places)
    return windows[places - 1 : 0 : -1]
