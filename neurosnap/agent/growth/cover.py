"""Searches a history for a cover: literals that held together at no tick of a set."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from neurosnap.poc.learning.history import following, preceding
from neurosnap.poc.learning.search import Count, Numbers, Question, Search
from neurosnap.poc.order.literals import Words

LONGEST: Final = 8
"""Literals of a cover at most."""


class Candidates(NamedTuple):
    """Literals that may be in a cover."""

    literals: Numbers
    """``(n,)``."""
    rings: Numbers
    """``(n,)``: for each the literal that was read at a tick iff it held there."""
    before: bool = False
    """It held at a tick iff that was read at the one before."""


def cover(
    against: Words, several: Sequence[Candidates], ticks: int
) -> Search[tuple[int, ...] | None]:
    """Look for literals that held together at no tick of a set, greedily.

    Args:
        against: ``(W,)``, the ticks.
        several: Those to choose from.
        ticks: How many the history was shown so far.

    Returns:
        Ascending, none of them superfluous; None: there are none, or too many. For each
        that is chosen it asks for a count of all, and for the ring of the chosen one.
    """
    literals = np.concatenate([one.literals for one in several])
    rings = np.concatenate([one.rings for one in several])
    before = np.repeat(
        [one.before for one in several], [len(one.rings) for one in several]
    )
    chosen: dict[int, Words] = {}
    left = against
    while left.any():
        if len(chosen) == LONGEST or not len(literals):
            return None
        counts = tuple(
            Count(preceding(left, ticks) if one.before else left, one.rings)
            for one in several
        )
        remain = np.concatenate((yield Question(counts=counts)).counts)
        best = int(remain.argmin())
        if remain[best] == np.bitwise_count(left).sum():
            return None
        ring = rings[best].item()
        read = (yield Question(readings=(ring,))).readings[ring]
        chosen[best] = following(read, ticks) if before[best] else read
        left = left & chosen[best]
    for place in tuple(chosen):
        rest = [one for other, one in chosen.items() if other != place]
        if rest and not (against & np.bitwise_and.reduce(rest)).any():
            del chosen[place]
    return tuple(sorted(literals[list(chosen)].tolist()))
