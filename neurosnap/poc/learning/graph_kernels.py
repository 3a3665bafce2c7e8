"""Compiled loops that write the implications found between sensors into the graph.

Pairs of sensors, and the code of each pair, are as in
`neurosnap.poc.learning.pairs`. Nothing here is compiled with fast-math: results
are the same bits on every run.

The loops over a row have no branch, store to two arrays at most and cast every result
of 32-bit arithmetic back (numba widens it): so the compiler makes vector instructions
of them.
"""

from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.order.literal_set_kernels import spread
from neurosnap.poc.order.literal_sets import Words
from neurosnap.system.compiled import njit

Weight: TypeAlias = Any
"""A float, or a whole number of 32 bits."""
_ONE = np.uint64(1)


class Pairs(NamedTuple):
    """Which implications hold in each pair of sensors, as codes, and when each changed.

    One entry a pair: of all pairs, or of those of some rows that lie side by side.

    Loops that are called at every observation take it as a plain tuple, which numba
    unpacks five times as fast; and they call no function with it a row, for that counts
    a reference to each of its arrays up and down again.
    """

    threshold: float
    """What the weight against an implication must be below, as a share."""
    codes: NDArray[np.uint8]
    """What relates the two sensors."""
    since: NDArray[np.uint32]
    """The tick at which the code last changed; 0 if it never did."""
    latest: NDArray[np.uint32]
    """``(N,)``: the tick at which a code of each row last changed."""
    rows: Words
    """``(2N, w)``: the out-edges of every literal; ``(0, 0)`` if no graph is kept."""
    first: int
    """The first row that there are entries of."""


class Row(NamedTuple):
    """The four weights of each pair that sensor ``i`` forms with the sensors before it.

    Each is in one piece of memory, else a loop over them takes four times as long.
    """

    both: NDArray[Any]
    only_i: NDArray[Any]
    only_j: NDArray[Any]
    neither: NDArray[Any]


@njit()
def row_of(squares: NDArray[Any], start: int, stop: int) -> Row:
    """Return the weights of some pairs; the array must be in one piece of memory."""
    return Row(
        squares[0][start:stop],
        squares[1][start:stop],
        squares[2][start:stop],
        squares[3][start:stop],
    )


@njit()
def code_of(
    w11: Weight,
    w10: Weight,
    w01: Weight,
    w00: Weight,
    limit: Weight,
    slack: float | None,
) -> tuple[np.uint8, bool, bool]:
    """Return the code of a pair, from its four weights ([GK] eqn:virtual implication).

    It is the one derivation of a code: all kernels of learning compile it into their
    loops. The codes are frozen: they are sent to the workers and the recorder, stand in
    key-frames and are compared bit for bit by a replay.

    ``a -> b`` iff ``w_ab* < min(limit, w_ab, w_a*b, w_a*b*)``, and ``a <-> b`` iff
    ``w_ab* = w_a*b = 0``. It has no branch, so that a loop over pairs becomes vector
    instructions.

    Args:
        w11: The weight of both on: ``w_ij``; whole numbers of 32 bits, or floats.
        w10: ``w_ij*``.
        w01: ``w_i*j``.
        w00: ``w_i*j*``.
        limit: What the weight against an implication must be less than.
        slack: By how much a float must be smaller to count as smaller, and above what
            it is not 0; None for whole numbers, which are compared exactly.

    Returns:
        The code, see `neurosnap.poc.learning.pairs`; whether it is an implication
        (and no equivalence) with the lesser of ``w_ij*`` and ``w_i*j`` against it; and
        whether one with the lesser of ``w_ij`` and ``w_i*j*`` against it.
    """
    mixed, like = min(w10, w01), min(w11, w00)
    more, most = max(w10, w01), max(w11, w00)
    if slack is None:
        equal, opposite = more == 0, most == 0
        up = (mixed < min(more, like)) & (mixed < limit)
        down = (like < min(most, mixed)) & (like < limit)
    else:
        # Rounding may take a weight below 0; an equivalence excludes the rest all the
        # same.
        equal, opposite = more <= slack, most <= slack
        loose = not (equal | opposite)
        up = loose & (mixed < min(min(more, like), limit) - slack)
        down = loose & (like < min(min(most, mixed), limit) - slack)
    # Wider whole numbers would cost a loop over pairs a tenth of its speed.
    code = np.uint8(0)
    code = (np.uint8(1) if w10 < w01 else np.uint8(2)) if up else code
    code = (np.uint8(4) if w11 < w00 else np.uint8(8)) if down else code
    code = np.uint8(3) if equal else code
    return (np.uint8(12) if opposite else code), up, down


@njit()
def place_of(i: int, first: int) -> int:
    """Return where a row begins in an array of the pairs from row `first` on."""
    return i * (i - 1) // 2 - first * (first - 1) // 2


@njit()
def end_of(first: int, pairs: int) -> int:
    """Return the row behind the last, if so many pairs begin with row `first`."""
    end = first
    while place_of(end, first) < pairs:
        end += 1
    return end


@njit()
def difference(fresh: NDArray[np.uint8], codes: NDArray[np.uint8]) -> np.uint8:
    """Return the bits in which any code, ``(i,)``, is not what it is to be.

    What it is to be may have a `MARK`, and be longer.
    """
    differ = np.uint8(0)
    for j in range(codes.shape[0]):
        differ |= fresh[j] ^ codes[j]
    return differ


@njit()
def rewire(i: int, fresh: NDArray[np.uint8], pairs: Pairs, tick: int) -> None:
    """Bring the codes of one row, some of which change, and the graph up to date.

    What they are to be is ``(i,)`` or longer; the tick is now, and below ``2**32``.
    """
    start = place_of(i, pairs.first)
    codes, since = pairs.codes[start : start + i], pairs.since[start : start + i]
    for j in range(i):
        flips = fresh[j] ^ codes[j]
        if flips:
            codes[j] = fresh[j]
            flip(i, j, flips, pairs.rows)
            since[j] = np.uint32(tick)
    pairs.latest[i] = np.uint32(tick)


@njit()
def flip(i: int, j: int, flips: np.uint8, rows: Words) -> None:
    """Set or clear the edges of some bits of the code of one pair."""
    if rows.shape[0] == 0:
        return
    for bit in range(4):
        if (flips >> bit) & 1:
            # Bits 1, 2, 4, 8: sources i, j, i, i*; targets j, i, j*, j.
            a = 2 * (j if bit == 1 else i) + (bit == 3)
            b = 2 * (i if bit == 1 else j) + (bit == 2)
            rows[a, b >> 6] ^= _ONE << np.uint64(b & 63)
            a, b = b ^ 1, a ^ 1
            rows[a, b >> 6] ^= _ONE << np.uint64(b & 63)


@njit()
def draw(codes: NDArray[np.uint8], rows: Words, first: int) -> None:
    """Add the edges of the codes from row `first` on to a graph without any there."""
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        for j in range(i):
            if codes[start + j]:
                flip(i, j, codes[start + j], rows)


@njit()
def relate(
    latter: NDArray[np.intp],
    former: NDArray[np.intp],
    codes: NDArray[np.uint8],
    rows: Words,
) -> None:
    """Make the edges of some pairs what their codes say; see `Snapshot.relate`."""
    for k in range(codes.shape[0]):
        i, j = latter[k], former[k]
        was = np.uint8(0)
        for bit, (a, b) in enumerate(
            ((2 * i, 2 * j), (2 * j, 2 * i), (2 * i, 2 * j + 1), (2 * i + 1, 2 * j))
        ):
            edge = rows[a, b >> 6] >> np.uint64(b & 63) & _ONE
            was = np.uint8(was | np.uint8(edge) << np.uint8(bit))
        flip(i, j, np.uint8(was ^ codes[k]), rows)


@njit()
def pick_changes(pairs: Pairs, tick: int, skip: int, upto: int) -> NDArray[np.int64]:
    """Return ``(C, 3)``: the pairs whose codes changed at a tick, and these codes.

    Columns from `skip` to `upto` are left out.
    """
    found, size = np.empty((0, 3), np.int64), 0
    for write in range(2):
        found, size = np.empty((size, 3), np.int64), 0
        for i in range(pairs.first, pairs.latest.shape[0]):
            start = place_of(i, pairs.first)
            for j in range(i if 0 < tick == pairs.latest[i] else 0):
                if pairs.since[start + j] == tick and not skip <= j < upto:
                    if write:
                        found[size, 0], found[size, 1] = i, j
                        found[size, 2] = pairs.codes[start + j]
                    size += 1
    return found


@njit()
def project(bits: NDArray[np.uint8], rows: Words, state: NDArray[np.bool_]) -> None:
    """Write the coherent projection of an observation ([GK] coherent projection).

    ``state = up(O) - up(O)*``, ``O`` the complete *-selection of `bits`.

    Args:
        bits: ``(N,)``, 0 or 1.
        rows: ``(2N, w)``, the out-edges of every literal.
        state: ``(2N,)``, overwritten.
    """
    reached = np.zeros(rows.shape[1], np.uint64)
    for i in range(bits.shape[0]):
        literal = np.uint64(2 * i + 1 - bits[i])
        reached[i >> 5] |= _ONE << (literal & np.uint64(63))
    spread(rows, reached)
    for i in range(bits.shape[0]):
        pair = reached[i >> 5] >> np.uint64(2 * (i & 31))
        state[2 * i] = (pair & np.uint64(3)) == 1
        state[2 * i + 1] = (pair & np.uint64(3)) == 2
