"""Compiled loops for partial observations: four weights stored per pair.

What `neurosnap.poc.learning.update_kernels` does with one joint weight a pair takes
every reading at every tick. Here a reading may be unknown: the pairs it is in are not
touched then, and so each pair has a total of its own. Pairs and codes are as in
`neurosnap.poc.learning.pairs`; the squares are ``(4, N (N - 1) / 2)``: ``w_ij,
w_ij*, w_i*j, w_i*j*`` of each pair.

The loops over a row are written for vector instructions, as those in the other file.
"""

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.automatic_threshold import MARK, START, withstand
from neurosnap.poc.learning.one_pair import SLACK, TINY
from neurosnap.poc.learning.update_kernels import end_of, pair_code, place_of, rewire
from neurosnap.poc.order.literals import Words
from neurosnap.system.compiled import njit


@njit()
def count_squares(
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    squares: NDArray[np.uint32],
    clock: int,
    born: NDArray[np.uint32],
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32],
    latest: NDArray[np.uint32],
    tick: int,
    spells: NDArray[np.uint32] | None = None,
    turns: NDArray[np.uint8] | None = None,
    first: int = 0,
) -> bool:
    """Count what is known of one observation and derive the graph anew.

    ``w_ab += [a and b both on]`` where both sensors are known, then ``a -> b`` iff
    ``w_ab* < min(tau t, w_ab, w_a*b, w_a*b*)`` and ``a <-> b`` iff ``w_ab* = w_a*b = 0
    < t``, with ``t`` the sum of the four weights. With no bit known it only derives.

    A pair is judged once ``t >= age / 2`` or ``tau t >= 1``, with its age counted from
    the birth of the younger. A sensor that was read once would otherwise be equivalent
    to one literal of each that was read with it, and so make equivalent what is known
    to differ.

    Args:
        bits: ``(N,)``, 0 or 1; any where unknown.
        known: ``(N,)``, 0 or 1.
        squares: ``(4, N (N - 1) / 2)``, updated; each column adds up to less than
            ``2**32``. Or as many as some rows have.
        clock: Observations so far, this one included.
        born: ``(N,)``, the clock when each sensor began, ascending; 0 for those that
            were there from the start.
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: One a pair, updated.
        rows: As of `neurosnap.poc.learning.update_kernels.rewire`.
        since: One a pair, updated.
        latest: As of `neurosnap.poc.learning.update_kernels.rewire`.
        tick: As there.
        spells: ``(2, 2N)``, where thresholds choose themselves: as
            `neurosnap.poc.learning.automatic_threshold` has it, whose `SHARE` the
            threshold then is.
        turns: ``(N,)``, which sensors' pairs are tested now; goes with `spells`.
        first: The first of the rows that there are numbers of.

    Returns:
        Whether any code changed. O(N²/2) time.
    """
    count = bits.shape[0]
    on, off = bits & known, known & ~bits
    share = np.full(count, threshold[0])
    fresh = np.empty(count, np.uint8)
    changed, reads = False, known.any()
    for i in range(first, end_of(first, codes.shape[0])):
        start = place_of(i, first)
        stop = start + i
        now = codes[start:stop]
        # Of a sensor that is not read nothing new follows, but what grew too old.
        if reads and not known[i] and not now.any():
            continue
        both, only_i = squares[0][start:stop], squares[1][start:stop]
        only_j, neither = squares[2][start:stop], squares[3][start:stop]
        if known[i]:
            with_j, without_j = (both, only_i) if bits[i] else (only_j, neither)
            for j in range(i):
                with_j[j] = np.uint32(with_j[j] + np.uint32(on[j]))
                without_j[j] = np.uint32(without_j[j] + np.uint32(off[j]))
        if threshold.shape[0] > 1:
            share[:i] = threshold[start:stop]
        age = float(clock - int(born[i]))
        _judge(both, only_i, only_j, neither, age, share, spells, fresh)
        if spells is not None and turns is not None:
            withstand(i, turns[i], squares[:, start:stop], spells, now, fresh)
        changed |= rewire(i, fresh, now, rows, since[start:stop], latest, tick)
    return changed


@njit()
def _judge(
    both: NDArray[np.uint32],
    only_i: NDArray[np.uint32],
    only_j: NDArray[np.uint32],
    neither: NDArray[np.uint32],
    age: float,
    share: NDArray[np.float64],
    spells: NDArray[np.uint32] | None,
    fresh: NDArray[np.uint8],
) -> None:
    """Write what one row's counts say of its pairs.

    The four weights come as four arrays, each in one piece of memory: else the loop is
    not written for vector instructions, and takes four times as long.

    Args:
        both: ``(i,)``, of the pairs of sensor `i` with those before it, and so on.
        only_i: ``(i,)``.
        only_j: ``(i,)``.
        neither: ``(i,)``.
        age: Observations since it began.
        share: ``(i,)`` or longer, the threshold of each pair.
        spells: None: no code is marked.
        fresh: ``(i,)`` or longer, overwritten with their codes.
    """
    for j in range(both.shape[0]):
        w11, w10, w01, w00 = both[j], only_i[j], only_j[j], neither[j]
        total = np.uint32(np.uint32(w11 + w10) + np.uint32(w01 + w00))
        # The product is rounded once; a whole number is compared exactly with it.
        whole = float(total)
        limit = share[j] * whole
        if spells is not None:
            limit -= START
        bound = limit if spells is None else max(limit, 1.0)
        of_pair, up, down = pair_code(w11, w10, w01, w00, bound, None)
        code = np.uint8(of_pair)
        if spells is not None:
            # What is smallest is against what is implied.
            broken = (up | down) & (min(min(w10, w01), min(w11, w00)) > 0)
            code = np.uint8(code | MARK) if broken else code
        judged = (2.0 * whole >= age) | (limit >= 1.0)
        fresh[j] = code if judged & (total > 0) else np.uint8(0)


@njit()
def count_newborn(
    squares: NDArray[np.uint32],
    age: int,
    share: float,
    codes: NDArray[np.uint8],
    spells: NDArray[np.uint32] | None = None,
) -> None:
    """Write what the counts of a newborn sensor say of its pairs.

    Args:
        squares: ``(4, N)``, of its pairs with all others.
        age: Observations in them.
        share: The threshold.
        codes: ``(N,)``, overwritten.
        spells: As of `count_squares`: nothing that was broken stands before it is the
            sensor's turn to be tested.
    """
    shares = np.full(codes.shape[0], share)
    one, two, three, four = squares[0], squares[1], squares[2], squares[3]
    _judge(one, two, three, four, float(age), shares, spells, codes)
    for j in range(codes.shape[0]):
        codes[j] = codes[j] if codes[j] < MARK else np.uint8(0)


@njit()
def discount_squares(
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    squares: NDArray[np.float64],
    decay: float,
    threshold: NDArray[np.float64],
    codes: NDArray[np.uint8],
    rows: Words,
    since: NDArray[np.uint32],
    latest: NDArray[np.uint32],
    tick: int,
    first: int = 0,
) -> bool:
    """Weigh in what is known of one observation, derive, truncate.

    ``w_ab <- q w_ab + (1 - q) [a and b both on]`` where both sensors are known; codes
    and truncation as in `neurosnap.poc.learning.update_kernels.learn_discounted`, for
    these pairs alone: what is not touched keeps its code as well, which rounding might
    turn.

    Args:
        bits: ``(N,)``, 0 or 1; any where unknown.
        known: ``(N,)``, 0 or 1.
        squares: ``(4, N (N - 1) / 2)``, updated; each column adds up to 1. Or as many
            as some rows have.
        decay: ``q`` in [0, 1).
        threshold: ``(1,)`` for all pairs, or one a pair.
        codes: One a pair, updated.
        rows: As of `neurosnap.poc.learning.update_kernels.rewire`.
        since: One a pair, updated.
        latest: As of `neurosnap.poc.learning.update_kernels.rewire`.
        tick: As there.
        first: The first of the rows that there are numbers of.

    Returns:
        Whether any code changed. O(N k) time for ``k`` known sensors.
    """
    count = bits.shape[0]
    keep = np.where(known > 0, decay, 1.0)
    on = (bits & known).astype(np.float64) * (1.0 - decay)
    off = (known & ~bits).astype(np.float64) * (1.0 - decay)
    nothing = np.zeros(count, np.float64)
    limit = np.full(count, threshold[0])
    shift = np.empty(count, np.float64)
    fresh = np.empty(count, np.uint8)
    changed = False
    for i in range(first, end_of(first, codes.shape[0])):
        if not known[i]:
            continue
        start = place_of(i, first)
        stop = start + i
        now = codes[start:stop]
        if threshold.shape[0] > 1:
            limit[:i] = threshold[start:stop]
        row = squares[:, start:stop]
        _discount(bits[i], known, row, keep, on, off, nothing, limit, shift, now, fresh)
        changed |= rewire(i, fresh, now, rows, since[start:stop], latest, tick)
    return changed


@njit()
def _discount(
    bit: int,
    known: NDArray[np.uint8],
    squares: NDArray[np.float64],
    keep: NDArray[np.float64],
    on: NDArray[np.float64],
    off: NDArray[np.float64],
    nothing: NDArray[np.float64],
    limit: NDArray[np.float64],
    shift: NDArray[np.float64],
    now: NDArray[np.uint8],
    fresh: NDArray[np.uint8],
) -> None:
    """Weigh one observation into one row, whose sensor is known, and truncate it.

    Args:
        bit: The sensor's reading.
        known: Of the sensors before it, and so on for all that follow.
        squares: ``(4, i)``, updated.
        keep: What is kept of the weights.
        on: What is gained where the other reads on.
        off: Where it reads off.
        nothing: Zeros.
        limit: The thresholds.
        shift: Overwritten.
        now: ``(i,)``, the codes as they are.
        fresh: Overwritten with the codes as they are to be.
    """
    both, only_i, only_j, neither = squares[0], squares[1], squares[2], squares[3]
    _fade(both, keep, on if bit else nothing)
    _fade(only_i, keep, off if bit else nothing)
    _fade(only_j, keep, nothing if bit else on)
    _fade(neither, keep, nothing if bit else off)
    for j in range(both.shape[0]):
        w11, w10, w01, w00 = both[j], only_i[j], only_j[j], neither[j]
        code, up, down = pair_code(w11, w10, w01, w00, limit[j], SLACK)
        fresh[j] = np.uint8(code) if known[j] else now[j]
        # The weight against an implication is added to both of its sort's others
        # and taken from both of its own: of which itself becomes 0, exactly.
        up, down = up & (known[j] > 0), down & (known[j] > 0)
        shift[j] = min(w10, w01) if up else (-min(w11, w00) if down else 0.0)
    for j in range(both.shape[0]):
        both[j] += shift[j]
        neither[j] += shift[j]
    for j in range(both.shape[0]):
        only_i[j] -= shift[j]
        only_j[j] -= shift[j]


@njit()
def discount_newborn(
    readings: NDArray[np.uint8],
    reads: NDArray[np.uint8],
    bits: NDArray[np.uint8],
    known: NDArray[np.uint8],
    squares: NDArray[np.float64],
    decay: float,
    share: float,
    codes: NDArray[np.uint8],
) -> None:
    """Weigh in a newborn sensor's history, observation by observation.

    Args:
        readings: ``(T,)``, what it would have read, the oldest first.
        reads: ``(T,)``, whether that is known.
        bits: ``(T, N)``, what the others read.
        known: ``(T, N)``, whether that is known.
        squares: ``(4, N)``, of its pairs with all others; updated.
        decay: ``q`` in [0, 1).
        share: The threshold.
        codes: ``(N,)``, updated.
    """
    count = codes.shape[0]
    nothing = np.zeros(count, np.float64)
    limit = np.full(count, share)
    shift = np.empty(count, np.float64)
    fresh = np.empty(count, np.uint8)
    for t in range(readings.shape[0]):
        if reads[t]:
            keep = np.where(known[t] > 0, decay, 1.0)
            on = (bits[t] & known[t]).astype(np.float64) * (1.0 - decay)
            off = (known[t] & ~bits[t]).astype(np.float64) * (1.0 - decay)
            _discount(
                readings[t],
                known[t],
                squares,
                keep,
                on,
                off,
                nothing,
                limit,
                shift,
                codes,
                fresh,
            )
            codes[:] = fresh


@njit()
def _fade(
    weights: NDArray[np.float64],
    keep: NDArray[np.float64],
    gain: NDArray[np.float64],
) -> None:
    """Keep a share of each weight and add what is gained; the least become 0.

    What is kept whole is not touched.
    """
    for j in range(weights.shape[0]):
        weight = keep[j] * weights[j] + gain[j]
        weights[j] = weight if (weight > TINY) | (keep[j] == 1.0) else 0.0
