"""Finds latches: of two literals, the one that was read last tells what follows.

It need not have been known each time: what is unknown may be looked at, and what is
read only while a latch is on comes to imply it, as with any sensor.

References:
    Not the paper's. A sensor that is never read, and stays on from one event to
    another, is a synthetic item of Drescher's (1991) schema mechanism, and the state
    that hidden-state learners look for.
"""

import math
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import in_order
from neurosnap.poc.order.literal_sets import Words

ACCIDENT: Final = 1e-6
"""The chance that a latch tells nothing of what it is grown for. It is small, as what
is done depends on what was seen: occasions are less apart than they are taken for."""
_SOME = 4  # of so many of them one is looked at first
_LOOKED_AT = 256  # results, and as many failures, that latches are held against


def find_latch(
    alike: Sequence[int],
    result: int,
    sensors: int,
    own: int,
    ticks: int,
    begun: Words,
    there_are: Collection[Context],
) -> Search[Context | None]:
    """Look for what was there long ago whenever a result came in the same state.

    A latch that is found was never wrong. It need not have been known each time: what
    is not known can be looked at. Many pairs of literals are searched, so one counts
    only if it told so often that this is no accident. The world's own come first.

    Args:
        alike: The literals that are read after the same action in the same state.
        result: A literal that came then, or not.
        sensors: How many sensors may switch a latch: those before the grown ones.
        own: How many of these are the world's own; they may do so by being off, too.
        ticks: How many the history was shown so far.
        begun: ``(W,)``, the ticks that began a trajectory.
        there_are: Latches that are there. If one of them tells it, none is looked for.
    """
    some = [*range(2 * own), *range(2 * own, 2 * sensors, 2)]
    asked = dict.fromkeys([*alike, result, result ^ 1, *some])
    read = (yield Question(readings=tuple(asked))).readings
    there = np.bitwise_and.reduce([read[a] for a in alike])
    rings = there & read[result], there & read[result ^ 1], begun
    came, failed, begins = in_order(rings, ticks)
    order = np.arange(len(came))
    since = np.maximum.accumulate(np.where(begins, order, -1))
    at = [np.flatnonzero(one[1:])[-_LOOKED_AT:] for one in (came, failed)]
    before = np.sort(np.concatenate(at))
    wanted = came[before + 1]
    first = np.flatnonzero(np.diff(2 * since[before] + wanted, prepend=-3))
    if _is_accident(wanted[first], 2 * own):
        return None
    rows = in_order([read[a] for a in some], ticks)
    last = np.maximum.accumulate(np.where(rows, order, -1), axis=1)[:, before]
    last[last < since[before]] = -1
    places = {literal: place for place, literal in enumerate(some)}
    for latch in there_are:
        both = [places[a] for a in (*latch.literals, latch.reset) if a in places]
        if _best_pair(last[both], wanted, first) is not None:
            return None
    for searched in last[: 2 * own], last:
        if _is_accident(wanted[first], len(searched)):
            break
        pair = _best_pair(searched, wanted, first)
        if pair is not None:
            return Context(-1, (some[pair[0]],), reset=some[pair[1]])
    return None


def _best_pair(
    last: NDArray[np.intp], wanted: NDArray[np.bool_], first: NDArray[np.intp]
) -> tuple[int, int] | None:
    """Return the pair of which the one read last tells most, and is never wrong.

    Args:
        last: ``(k, m)``, when each of several literals was read last before each
            time; -1: not in that trajectory.
        wanted: ``(m,)``, whether the result came then.
        first: The first of each occasion: while it comes again and again, or fails, in
            one trajectory, what is hidden may be the same all the while.

    Returns:
        The first that tells most occasions of the rarer outcome, then most of all;
        None if each may be an accident. O(k² m) time at most.
    """
    found, most = None, 0
    some = slice(None, None, _SOME)  # most pairs are wrong at one of these
    for one, mine in enumerate(last):
        others = np.arange(len(last))
        right, wrong = _told(mine[some], last[:, some], wanted[some])
        others = others[~(right.any(axis=1) & wrong.any(axis=1))]
        right, wrong = _told(mine, last[others], wanted)
        never = ~(right.any(axis=1) & wrong.any(axis=1))
        others = others[never]
        told = np.logical_or.reduceat((right | wrong)[never], first, axis=1)
        came = wanted[first]
        yes, no = (told & came).sum(axis=1), (told & ~came).sum(axis=1)
        rank = 2 * len(first) * np.minimum(yes, no) + yes + no
        rank[others == one] = 0
        best = int(rank.argmax()) if rank.size else -1
        if best < 0 or rank[best] <= most:
            continue
        if not _is_accident(came[told[best]], len(last)):
            found, most = (one, int(others[best])), int(rank[best])
    return found


def _told(
    mine: NDArray[np.intp], last: NDArray[np.intp], wanted: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return where a latch of one literal and each other is right, and where wrong.

    ``(k, m)`` each, as if it was on where the result came; see `_best_pair`.
    """
    known = np.maximum(mine, last) >= 0
    on = mine >= last
    return known & (on == wanted), known & (on != wanted)


def _is_accident(came: NDArray[np.bool_], literals: int) -> bool:
    """Return whether some pair of literals may well tell on so many occasions."""
    ways = math.comb(len(came), int(came.sum()))
    return 2 * literals**2 >= ACCIDENT * ways
