"""Compiled loops of learning; each docstring gives the equivalent plain lines.

Pairs of sensors, and the code of each pair, are as in
`neurosnap.poc.learning.pairs`. Nothing here is compiled with fast-math: results
are the same bits on every run.

The loops over a row have no branch, store to two arrays at most and cast every result
of 32-bit arithmetic back (numba widens it): so the compiler makes vector instructions
of them.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import MARK
from neurosnap.poc.learning.one_pair import SLACK, code_of
from neurosnap.poc.order.kernels import spread
from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit

_ONE = np.uint64(1)
pair_code = njit()(code_of)
"""`code_of`, compiled."""


@njit()
def place_of(i: int, first: int) -> int:
    """Return where a row begins in numbers of pairs that begin with row `first`."""
    return i * (i - 1) // 2 - first * (first - 1) // 2


@njit()
def end_of(first: int, pairs: int) -> int:
    """Return the number after the last row that so many pairs from `first` on have."""
    end = first
    while place_of(end, first) < pairs:
        end += 1
    return end


@njit()
def judge(
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    mine: np.uint32,
    ticks: np.uint32,
    limit: NDArray[np.uint32],
    spells: NDArray[np.uint32] | None,
    fresh: NDArray[np.uint8],
) -> None:
    """Write what one row's counts say of its pairs.

    Args:
        joint: ``(i,)``, of the pairs of sensor `i` with those before it.
        marginals: ``(N,)``.
        mine: That of `i`.
        ticks: The clock.
        limit: ``(i,)`` or longer: what the weight against must be less than.
        spells: None: no code is marked.
        fresh: ``(i,)`` or longer, overwritten with the codes.
    """
    rest = np.uint32(ticks - mine)
    for j in range(joint.shape[0]):
        w11 = joint[j]
        w10 = np.uint32(mine - w11)
        w01 = np.uint32(marginals[j] - w11)
        w00 = np.uint32(rest - w01)
        of_pair, up, down = pair_code(w11, w10, w01, w00, limit[j], None)
        code = np.uint8(of_pair)
        if spells is not None:
            # What is smallest is against what is implied.
            broken = (up | down) & (min(min(w10, w01), min(w11, w00)) > 0)
            code = np.uint8(code | MARK) if broken else code
        fresh[j] = code


@njit()
def fill(
    joint: NDArray[np.uint32],
    marginals: NDArray[np.uint32],
    mine: np.uint32,
    ticks: np.uint32,
    squares: NDArray[np.uint32],
) -> None:
    """Write the four weights of one row's pairs: ``(4, i)`` or longer."""
    for j in range(joint.shape[0]):
        w11, yours = joint[j], marginals[j]
        squares[0, j], squares[1, j] = w11, np.uint32(mine - w11)
        squares[2, j] = np.uint32(yours - w11)
        squares[3, j] = np.uint32(np.uint32(ticks - mine) - squares[2, j])


@njit()
def learn_discounted(
    bits: NDArray[np.uint8],
    joints: NDArray[np.float64],
    marginals: NDArray[np.float64],
    decay: float,
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32] | None = None,
    latest: NDArray[np.uint32] | None = None,
    tick: int = 0,
    first: int = 0,
) -> bool:
    """Weigh in one observation, derive, truncate ([GK] defn:discounted update).

    ``n <- q n + (1 - q) x`` for marginals and joints; codes as
    `neurosnap.poc.learning.one_pair.code_of` has them, where ``<`` is smaller by more
    than `SLACK` and ``= 0`` at most `SLACK`; then every square with an implication
    loses the weight against it ([GK] snapshot truncation). Marginals keep.

    Args:
        bits: ``(N,)``, 0 or 1.
        joints: ``(N (N - 1) / 2,)``, updated; or as many as some rows have.
        marginals: ``(N,)``, updated.
        decay: ``q`` in [0, 1).
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: One a pair, updated.
        rows: ``(2N, w)``, the derived graph, updated where codes change; ``(0, 0)`` if
            it is not kept here.
        since: One a pair, updated; None: nobody asks.
        latest: As of `rewire`.
        tick: As of `rewire`.
        first: The first row that there are numbers of.

    Returns:
        Whether any code changed. O(N²/2) time.
    """
    count = bits.shape[0]
    gain = np.empty(count, np.float64)
    limit = np.full(count, threshold[0])
    fresh = np.empty(count, np.uint8)
    for j in range(count):
        gain[j] = (1.0 - decay) * bits[j]
        marginals[j] = decay * marginals[j] + gain[j]
    changed = False
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        joint, now = joints[start : start + i], codes[start : start + i]
        dates = None if since is None else since[start : start + i]
        on = float(bits[i])
        if threshold.shape[0] > 1:
            limit[:i] = threshold[start : start + i]
        mine = marginals[i]
        rest = 1.0 - mine
        for j in range(i):
            yours = marginals[j]
            # The same products and sums as for the marginals: with x_i = x_i x_j, a
            # joint that was equal to its marginal stays equal to it, bit for bit.
            w11 = decay * joint[j] + on * gain[j]
            w10 = mine - w11
            w01 = yours - w11
            w00 = rest - w01
            code, up, down = pair_code(w11, w10, w01, w00, limit[j], SLACK)
            fresh[j] = np.uint8(code)
            # Taking all weight from w_ij* or w_i*j, whichever is smaller, is the
            # largest joint that the marginals allow; from w_ij or w_i*j*, the least.
            w11 = min(mine, yours) if up else w11
            joint[j] = max(0.0, mine + yours - 1.0) if down else w11
        changed |= rewire(i, fresh, now, rows, dates, latest, tick)
    return changed


@njit()
def difference(fresh: NDArray[np.uint8], codes: NDArray[np.uint8]) -> np.uint8:
    """Return the bits in which any code is not what it is to be.

    Args:
        fresh: ``(i,)`` or longer, what the codes are to be; they may have a `MARK`.
        codes: ``(i,)``, without any.
    """
    differ = np.uint8(0)
    for j in range(codes.shape[0]):
        differ |= fresh[j] ^ codes[j]
    return differ


@njit()
def rewire(
    i: int,
    fresh: NDArray[np.uint8],
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32] | None,
    latest: NDArray[np.uint32] | None,
    tick: int,
) -> bool:
    """Bring one row of the codes, and the graph, up to date.

    Args:
        i: The row, a sensor.
        fresh: ``(N,)``; the first `i` are what the codes are to be.
        codes: ``(i,)``, of the pairs of `i` with those before it; updated.
        rows: ``(2N, w)``, updated where codes change; ``(0, 0)``: nobody keeps them.
        since: ``(i,)``, when each code last changed; updated. None: nobody asks.
        latest: ``(N,)``, when a code of each row last did; updated. None: likewise.
        tick: Now; below ``2**32``.

    Returns:
        Whether any code changed.
    """
    if difference(fresh, codes) == 0:
        return False
    for j in range(codes.shape[0]):
        flips = fresh[j] ^ codes[j]
        if flips:
            codes[j] = fresh[j]
            flip(i, j, flips, rows)
            if since is not None:
                since[j] = np.uint32(tick)
    if latest is not None:
        latest[i] = np.uint32(tick)
    return True


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
    """Let a graph without edges between some pairs have those that codes stand for.

    Args:
        codes: Of these pairs.
        rows: ``(2N, w)``, updated.
        first: The first row that there are numbers of.
    """
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        for j in range(i):
            if codes[start + j]:
                flip(i, j, codes[start + j], rows)


@njit()
def count_changes(
    since: NDArray[np.uint32], latest: NDArray[np.uint32], tick: int, first: int
) -> NDArray[np.int64]:
    """Return ``(N,)``: how many codes of each row changed at a tick.

    Args:
        since: As `rewire` has it, of all rows.
        latest: Likewise.
        tick: When.
        first: The first row that there are numbers of.
    """
    counts = np.zeros(latest.shape[0], np.int64)
    for i in range(first, end_of(first, since.shape[0])):
        start = place_of(i, first)
        for j in range(i if latest[i] == tick else 0):
            counts[i] += since[start + j] == tick
    return counts


@njit()
def pick_changes(
    rows: NDArray[np.intp],
    since: NDArray[np.uint32],
    codes: NDArray[np.uint8],
    tick: int,
    first: int,
    latter: NDArray[np.int32],
    former: NDArray[np.int32],
    picked: NDArray[np.uint8],
) -> None:
    """Write the pairs in some rows whose codes changed at a tick, and these.

    Args:
        rows: The rows.
        since: As `rewire` has it, of all rows.
        codes: Likewise.
        tick: When.
        first: The first row that there are numbers of.
        latter: ``(C,)``, overwritten.
        former: ``(C,)``, overwritten.
        picked: ``(C,)``, overwritten.
    """
    place = 0
    for i in rows:
        start = place_of(i, first)
        for j in range(i):
            if since[start + j] == tick:
                latter[place], former[place] = i, j
                picked[place] = codes[start + j]
                place += 1


@njit()
def pack_rows(
    rows: NDArray[np.intp], codes: NDArray[np.uint8], first: int
) -> NDArray[np.uint8]:
    """Return the codes of some rows, two a byte; each row begins a byte.

    Args:
        rows: The rows.
        codes: Of all pairs.
        first: The first row that there are numbers of.
    """
    size = 0
    for i in rows:
        size += (i + 1) // 2
    packed, begin = np.zeros(size, np.uint8), 0
    for i in rows:
        start = place_of(i, first)
        for j in range(i):
            half = np.uint8(codes[start + j] << np.uint8(4 * (j & 1)))
            packed[begin + j // 2] |= half
        begin += (i + 1) // 2
    return packed


@njit()
def relate(
    latter: NDArray[np.intp],
    former: NDArray[np.intp],
    codes: NDArray[np.uint8],
    rows: Words,
) -> None:
    """Let the edges of some pairs be what their codes say.

    Args:
        latter: ``(C,)``, the pairs' latter sensors.
        former: ``(C,)``, their former ones.
        codes: ``(C,)``.
        rows: ``(2N, w)``, updated.
    """
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
