"""One byte per pair of sensors that encodes all derived relations of the pair.

Pairs of sensors ``j < i`` are packed row by row: pair ``(i, j)`` is entry
``i (i - 1) / 2 + j``. A pair's *code* is the set of its implications, one bit each,
every bit standing for an edge and its contrapositive:

==== ================ ==================
bit  edge             contrapositive
==== ================ ==================
1    ``i -> j``       ``j* -> i*``
2    ``j -> i``       ``i* -> j*``
4    ``i -> j*``      ``j -> i*``
8    ``i* -> j``      ``j* -> i``
==== ================ ==================

Implications exclude each other, so two bits together mean an equivalence: 3 is
``i <-> j`` and 12 is ``i <-> j*``.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.update_kernels import draw
from neurosnap.poc.order.literals import Words

_EQUAL, _OPPOSITE = 3, 12


def strict(codes: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the codes without their equivalences."""
    both = (codes == _EQUAL) | (codes == _OPPOSITE)
    return np.where(both, np.uint8(0), codes)


def leads(code: int, a: int, b: int) -> bool:
    """Return whether a pair's code says that `a` implies `b`, two of its literals."""
    if a >> 1 < b >> 1:
        a, b = b ^ 1, a ^ 1
    bit = {(0, 0): 1, (1, 1): 2, (0, 1): 4, (1, 0): 8}[a & 1, b & 1]
    return bool(code & bit)


def rows_of(codes: NDArray[np.uint8], sensors: int) -> Words:
    """Return the packed edges that codes stand for.

    Args:
        codes: ``(N (N - 1) / 2,)``.
        sensors: ``N``.

    Returns:
        ``(2N, w)``, the out-edges of every literal.
    """
    rows: Words = np.zeros((2 * sensors, (2 * sensors + 63) // 64), np.uint64)
    draw(codes, rows, 0)
    return rows


def excluded(
    codes: NDArray[np.uint8], squares: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the weight that each code says is 0; infinite where it is no code.

    Args:
        codes: ``(P,)``.
        squares: ``(4, P)``: the weights ``w_ij, w_ij*, w_i*j, w_i*j*`` of each pair.
    """
    both, only_i, only_j, neither = squares
    return np.select(
        [codes == code for code in (0, 1, 2, _EQUAL, 4, 8, _OPPOSITE)],
        [
            np.zeros(codes.shape),
            only_i,
            only_j,
            np.maximum(only_i, only_j),
            both,
            neither,
            np.maximum(both, neither),
        ],
        np.inf,
    )
