"""Finds latches: of two literals, the one that was read last tells what follows.

References:
    Not the paper's. A sensor that is never read, and stays on from one event to
    another, is a synthetic item of Drescher's (1991) schema mechanism, and the state
    that hidden-state learners look for.
"""

import math
from collections.abc import Collection, Sequence
from typing import Final

import numpy as np

from neurosnap.agent.growth_in_decisions import Context
from neurosnap.poc.learning.history_questions import Question, Search
from neurosnap.poc.learning.reading_history import in_order
from neurosnap.poc.order.literal_sets import Words

ACCIDENT: Final = 0.01
"""The chance that a latch tells nothing of what it is grown for."""
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

    Many pairs of literals are searched, so one counts only if it told so often that
    this is no accident.

    Args:
        alike: The literals that are read after the same action in the same state.
        result: A literal that came then, or not.
        sensors: How many sensors may switch a latch: those before the grown ones.
        own: How many of these are the world's own; they may do so by being off, too.
        ticks: How many the history was shown so far.
        begun: ``(W,)``, the ticks that began a trajectory.
        there_are: Latches that are there: another is looked for.
    """
    some = [*range(2 * own), *range(2 * own, 2 * sensors, 2)]
    asked = dict.fromkeys([*alike, result, result ^ 1, *some])
    read = (yield Question(readings=tuple(asked))).readings
    there = np.bitwise_and.reduce([read[a] for a in alike])
    rings = there & read[result], there & read[result ^ 1], begun
    came, failed, begins = in_order(rings, ticks)
    order = np.arange(len(came))
    at = [np.flatnonzero(one)[-_LOOKED_AT:] - 1 for one in (came, failed)]
    at = [one[one >= 0] for one in at]
    ways = math.comb(sum(map(len, at)), len(at[0]))
    if 2 * len(some) ** 2 >= ACCIDENT * ways:
        return None
    before = np.concatenate(at)
    since = np.maximum.accumulate(np.where(begins, order, -1))
    rows = in_order([read[a] for a in some], ticks)
    lately = np.maximum.accumulate(np.where(rows, order, -1), axis=1)
    last, known = lately[:, before], lately[:, before] >= since[before]
    wanted = np.repeat((True, False), [len(one) for one in at])
    for place, literal in enumerate(some):
        on = (last[place] >= last) & known[place]
        off = (last > last[place]) & known
        right = (on == wanted) & (off != wanted)
        wrong = (off == wanted) & (on != wanted)
        tells = right.all(axis=1) | wrong.all(axis=1)
        for other in np.flatnonzero(tells).tolist():
            found = Context(-1, (literal,), reset=some[other])
            if other != place and found not in there_are:
                return found
    return None
