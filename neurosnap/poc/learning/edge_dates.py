"""The tick at which the relation of two sensors last changed.

Codes are held against a copy of them as they were, rather than noted where they are
set: the loops that set them stay as they are, and most observations change none.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.system.compiled import njit

_BLOCK = 64


@njit()
def date_changes(
    codes: NDArray[np.uint8],
    noted: NDArray[np.uint8],
    since: NDArray[np.uint32],
    clock: int,
) -> None:
    """Note the clock for each pair whose code is no longer the one noted.

    Args:
        codes: One a pair.
        noted: One a pair, updated to `codes`.
        since: One a pair, updated; ticks.
        clock: Below ``2**32``.
    """
    now = np.uint32(clock)
    for start in range(0, codes.shape[0], _BLOCK):
        new, old = codes[start : start + _BLOCK], noted[start : start + _BLOCK]
        dates = since[start : start + _BLOCK]
        differ = np.uint8(0)
        for k in range(new.shape[0]):
            differ |= new[k] ^ old[k]
        if differ:
            for k in range(new.shape[0]):
                dates[k] = now if new[k] != old[k] else dates[k]
                old[k] = new[k]
