"""Finds what implies another literal some ticks later: ``a -> b within k``.

Three things are told, each of them as two literals that exclude each other, one of them
read throughout a window of ``k + 1`` ticks, the other at one end of it:

- ``a -> b within k``: ``a`` at the first tick of a window throughout which ``b*``;
- ``a for k -> b``: ``b*`` at the last tick of a window throughout which ``a``;
- ``b only within k after a``: ``b`` at the last tick of one throughout which ``a*``.

They are judged by the rule for two literals (`neurosnap.poc.learning.relation_rule`),
at the ticks at which windows end. All windows that could be asked about count against
them.

A wider window always has fewer exceptions, also where a reading is flipped now and
then. So a lag is told only where it explains exceptions: of the ticks at which both
literals are read at once, fewer are left than of its mirror image, with the other end,
and that is no accident. Its ``k`` is the one that chance would give least, widened
up to the longest wait that was seen, as long as that is hardly less sure.
"""

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.relation_rule import (
    LEAST_H,
    ONE_SIDED,
    WORK,
    Floats,
    divergence,
    evidence_for,
    exclusions,
    ticks_for_one,
)
from neurosnap.poc.order.literal_set_kernels import population
from neurosnap.poc.order.literal_sets import Words, from_words
from neurosnap.system.compiled import njit

LONGEST = 63
"""The longest lag that can be asked for, in ticks."""
USUAL = 32
"""The longest that is looked for, unless another is asked for."""
_AS_SURE = 0.97
"""The share of the evidence that a wider window keeps at least; and it must not be less
sure by more than `ONE_SIDED`. Chosen on planted lags with up to 2 % of flipped bits."""
_NEVER_FAILED = 0.85
"""The same of the narrowest one that never failed, if that is to be told instead of one
that did. Chosen on copies that come up to four ticks late, of sensors that often
change (`tests/unit/agent/test_windows.py`)."""
_FEW = 3
"""The fewest exceptions that a lag explains."""
_ONE = np.uint64(1)


class Lag(NamedTuple):
    """Two literals that exclude each other, one of them throughout a window."""

    throughout: int
    """The literal that is read throughout."""
    end: int
    """The one at one end."""
    ticks: int
    """``k``: those of the window besides its first."""
    first: bool
    """Whether `end` is read at its first tick, and not at its last."""

    @property
    def implication(self) -> tuple[int, int]:
        """The implication that does not hold at once."""
        a, b = self.end, self.throughout
        return (a, b ^ 1) if self.first else (b, a ^ 1)


def longest_lag(columns: Columns, asked: int, work: int = WORK) -> int:
    """Return the longest lag that can be looked for: less than asked of many sensors.

    A search looks at some words only.
    """
    words = int(columns.on.shape[1])
    literals = 2 * len(columns.on)
    return min(asked, work // max(1, 2 * literals * (literals - 2) * words))


def find_lags(columns: Columns, longest: int, shares: int = 1) -> list[Lag]:
    """Return what holds late and not at once, at most one lag of each two literals.

    Args:
        columns: The readings.
        longest: The longest lag that is looked for, as `longest_lag` returns it.
        shares: It has one share of so many of the accidents that are allowed.

    Returns:
        O(N² T) time.
    """
    literals = 2 * len(columns.on)
    needed = evidence_for(2 * shares * longest * literals * (literals - 2))
    best = proposed(columns, longest, needed, ticks_for_one(columns))
    found = zip(np.argwhere(best).tolist(), best[best > 0].tolist(), strict=True)
    every = (Lag(u, x, ticks, not last) for (last, u, x), ticks in found)
    candidates = [lag for lag in every if explains(columns, lag, longest)]
    judged = exclusions(bits_of(columns, lag) for lag in candidates)
    chosen: dict[frozenset[int], tuple[bool, int, bool, float, Lag]] = {}
    for place in np.flatnonzero(judged.holds(needed)).tolist():
        lag, both = candidates[place], frozenset(candidates[place][:2])
        failed, most = bool(judged.counts.ticks[0, place]), float(judged.most[place])
        rank = failed, lag.ticks, not lag.first, most, lag
        chosen[both] = min(rank, chosen.get(both, rank))
    return sorted(lag for *_, lag in chosen.values())


def proposed(
    columns: Columns, longest: int, needed: float, for_one: NDArray[np.float32]
) -> NDArray[np.int8]:
    """Return the lags that are worth to be judged.

    Args:
        columns: The readings.
        longest: The longest lag.
        needed: The evidence, in nats.
        for_one: ``(N, N)``: how many ticks of two sensors are worth one.

    Returns:
        ``(2, 2N, 2N)``: the ticks of the window throughout which the former literal is
        read, with the latter at its first tick, or its last; 0 for none.
    """
    literals, words = 2 * len(columns.on), columns.on.shape[1]
    best = np.zeros((2, literals, literals), np.int8)
    if longest and words:
        every = np.stack([columns.on, columns.off], axis=1).reshape(literals, words)
        _search((every, for_one), columns.ticks, needed, longest, best)
    return best


def explains(columns: Columns, lag: Lag, longest: int) -> bool:
    """Return whether it is the lag that explains exceptions, and no flipped readings.

    Flipped readings are left out by a window and by its mirror image alike: as likely
    by the one as by the other, or most of them by both. A tick of latency explains
    a few exceptions, too: all, if the mirror image explains none, and readings hardly
    ever end at a next tick.
    """
    at_once, now, back = (
        bits_of(columns, one)
        for one in (lag._replace(ticks=0), lag, lag._replace(first=not lag.first))
    )
    before, failed, left = (
        runs(end & whole) for end, _, whole, _ in (at_once, now, back)
    )
    if failed >= left:
        return False
    tested = failed + left
    odd = tested * divergence(failed / tested, 0.5)
    # It was chosen of four windows for each lag.
    if odd >= np.log(4 * longest / ONE_SIDED):
        return True
    if lag.ticks > 1 or failed or not _FEW <= before <= left:
        return False
    last = np.bitwise_count(now[2]).sum() / np.bitwise_count(at_once[2]).sum()
    return bool(before * divergence(0.0, last) >= -np.log(ONE_SIDED))


def bits_of(columns: Columns, lag: Lag) -> tuple[Words, Words, Words, Words]:
    """Return where windows end, ``(W,)`` each.

    Returns:
        Those with the literal at their end, and with its opposite; those throughout
        which the other was read, and those with its opposite somewhere.
    """
    bits = np.array([columns.ticks_of(lag.end ^ k) for k in (0, 1)])
    other = [columns.ticks_of(lag.throughout), ~columns.ticks_of(lag.throughout ^ 1)]
    kept, wide = np.array(other), 1
    while left := min(wide, lag.ticks + 1 - wide):
        kept &= later(kept, left)
        wide += left
    if lag.first:
        bits = later(bits, lag.ticks)
    # A window that begins before the table is none.
    inside = np.full_like(kept[0], ~np.uint64(0))
    inside[:1] <<= np.uint64(lag.ticks)
    yes, no = bits & inside
    return yes, no, kept[0] & inside, ~kept[1] & inside


def runs(ticks: Words) -> int:
    """Return how many runs of consecutive ticks there are."""
    return int(np.bitwise_count(ticks & ~later(ticks)).sum())


def later(ticks: Words, by: int = 1) -> Words:
    """Return sets of ticks, ``(..., W)``, each tick later by some, at most 63."""
    moved: Words = ticks << np.uint64(by)
    moved[..., 1:] |= ticks[..., :-1] >> np.uint64(64 - by)
    return moved


@njit()
def _search(
    table: tuple[Words, NDArray[np.float32]],
    ticks: int,
    needed: float,
    longest: int,
    best: NDArray[np.int8],
) -> None:
    """Fill the windows that are worth to be judged.

    Args:
        table: ``(2N, W)``, the ticks of all literals; and how many ticks of two sensors
            are worth one, ``(N, N)``.
        ticks: How many there are.
        needed: The evidence.
        longest: The longest lag.
        best: ``(2, 2N, 2N)``, filled: the ticks of the window throughout which the
            former literal is read, with the latter at its first tick, or its last.
    """
    every, for_one = table
    literals, words = every.shape
    windows = np.empty((longest + 1, words), np.uint64)
    wide = np.empty(longest + 1)
    failed = np.zeros((2, longest + 1))
    for u in range(literals):
        _widen(every[u], windows, wide)
        for x in range(literals):
            here = every[x]
            times = np.uint64(0)
            for w in range(words):
                times += population(here[w])
            if x >> 1 == u >> 1 or times == ticks:
                continue
            least = needed * for_one[u >> 1, x >> 1]
            for every_one in (False, True):
                at_first = at_last = np.uint64(0)
                for k in range(longest, 0, -1):
                    # A shorter window fails as often, at least.
                    if every_one or k < 8 or (longest - k) % 4 == 0:
                        at_first, at_last = _failed(windows, here, k)
                    failed[0, k], failed[1, k] = at_first, at_last
                for side in range(2):
                    mirrored = failed[1 - side] if every_one else wide
                    best[side, u, x] = _chosen(
                        failed[side], mirrored, float(times), wide, ticks, least
                    )
                if not best[:, u, x].any():
                    break


@njit()
def _failed(windows: Words, here: Words, k: int) -> tuple[np.uint64, np.uint64]:
    """Return at how many windows a literal is at their first tick, and at the last."""
    up, down = np.uint64(k), np.uint64(64 - k)
    at_first = population(windows[k, 0] & here[0] << up)
    at_last = population(windows[k, 0] & here[0])
    for w in range(1, windows.shape[1]):
        moved = here[w] << up | here[w - 1] >> down
        at_first += population(windows[k, w] & moved)
        at_last += population(windows[k, w] & here[w])
    return at_first, at_last


@njit()
def _widen(ticks: Words, windows: Words, wide: Floats) -> None:
    """Fill the ends of the windows throughout which a literal is read, by length."""
    windows[0] = ticks
    moved = ticks.copy()
    for k in range(len(windows)):
        if k:
            for w in range(len(moved) - 1, 0, -1):
                moved[w] = moved[w] << _ONE | moved[w - 1] >> np.uint64(63)
            moved[0] <<= _ONE
            windows[k] = windows[k - 1] & moved
        count = np.uint64(0)
        for w in range(len(moved)):
            count += population(windows[k, w])
        wide[k] = count


@njit()
def _chosen(
    failed: Floats,
    mirrored: Floats,
    times: float,
    wide: Floats,
    ticks: int,
    needed: float,
) -> int:
    """Return the lag that is told of two literals, if any; else 0.

    Args:
        failed: ``(K + 1,)``: at how many windows of each length both were read.
        mirrored: ``(K + 1,)``: at how many of those with the other end.
        times: The ticks of the literal at the end.
        wide: ``(K + 1,)``: the windows throughout which the other is read.
        ticks: The ticks of the table.
        needed: The evidence.
    """
    evidence = np.zeros(len(failed))
    for k in range(1, len(failed)):
        few = failed[k] * ticks < (1 - LEAST_H) * times * wide[k]
        if few and failed[k] < mirrored[k]:
            evidence[k] = max(
                times * divergence(failed[k] / times, wide[k] / ticks),
                wide[k] * divergence(failed[k] / wide[k], times / ticks),
            )
    most = evidence.max()
    least = max(needed, _AS_SURE * most, most + math.log(ONE_SIDED))
    chosen = 0
    for k in range(len(failed) - 1, 0, -1):
        fewest = not chosen or failed[k] <= failed[chosen]
        if evidence[k] >= least and fewest:
            chosen = k
    least = max(needed, _NEVER_FAILED * most)
    for k in range(1, len(failed) if failed[chosen] else 0):
        if failed[k] == 0 and evidence[k] >= least:
            return k
    return chosen


def shortest(
    lags: Iterable[Lag], reach: NDArray[np.bool_], longest: int
) -> Iterator[Lag]:
    """Yield the lags that do not follow from shorter ones and what holds at once.

    Args:
        lags: Some.
        reach: ``(2N, 2N)``: what implies what at once, reflexive.
        longest: The longest of them.
    """
    after = np.where(reach, 0, longest + 1).astype(np.int16)
    for lag in sorted(lags, key=lambda one: (one.ticks, one)):
        a, b = lag.implication
        if after[a, b] <= lag.ticks:
            continue
        yield lag
        for low, high in ((a, b), (b ^ 1, a ^ 1)):
            through = after[:, low, np.newaxis] + lag.ticks + after[high]
            np.minimum(after, through, out=after)


def waits(columns: Columns, lag: Lag) -> tuple[int, int, int]:
    """Return the shortest, the median and the longest wait that was seen, in ticks.

    They are counted from each tick at which the first literal of the implication comes
    while the second is not read, until that is; zeros if there is none.
    """
    a, b = (columns.ticks_of(literal) for literal in lag.implication)
    other = columns.ticks_of(lag.implication[0] ^ 1)
    begun = np.flatnonzero(from_words(a & later(other) & ~b, columns.ticks))
    answers = np.flatnonzero(from_words(b, columns.ticks))
    places = np.searchsorted(answers, begun)
    begun, places = begun[places < len(answers)], places[places < len(answers)]
    seen = np.sort(answers[places] - begun)
    seen = seen[seen <= lag.ticks]
    if not len(seen):
        return 0, 0, 0
    return int(seen[0]), int(seen[len(seen) // 2]), int(seen[-1])
