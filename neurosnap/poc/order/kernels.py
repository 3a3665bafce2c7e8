"""The compiled loop of propagation; its docstring gives the equivalent plain lines."""

import numpy as np

from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit

_ONE = np.uint64(1)


@njit()
def spread(rows: Words, reached: Words) -> int:
    """Grow `reached` by everything above it; return the hops the last of it took.

    Breadth first: what hop ``k`` finds is what edges lead to from hop ``k - 1``.

    Args:
        rows: ``(n, w)``, the out-edges of every literal.
        reached: ``(w,)``, updated.

    Returns:
        The number of hops; 0 if nothing is added. O(n w) time.
    """
    width = reached.shape[0]
    frontier = reached.copy()
    found = np.empty(width, np.uint64)
    hops = 0
    while True:
        found[:] = 0
        for word in range(width):
            pending = frontier[word]
            literal = 64 * word
            while pending:
                if pending & _ONE:
                    for k in range(width):
                        found[k] |= rows[literal, k]
                pending >>= _ONE
                literal += 1
        more = False
        for k in range(width):
            frontier[k] = found[k] & ~reached[k]
            reached[k] |= found[k]
            more |= frontier[k] != 0
        if not more:
            return hops
        hops += 1
