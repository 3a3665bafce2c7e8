"""Finds what relates sensors beyond two at one instant: premises, and what is late.

``belt ∧ gate -> counter`` (`neurosnap.poc.learning.premises`) and ``valve -> flow
within 3`` (`neurosnap.poc.learning.lags`) are read as two readings that exclude each
other, so that they are counted, and promise, as a relation of two sensors does.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.lags import (
    LONGEST,
    USUAL,
    Lag,
    bits_of,
    find_lags,
    runs,
    shortest,
    waits,
)
from neurosnap.poc.learning.pair_occasions import PairCounts
from neurosnap.poc.learning.pairs import codes_of, leads, pair_of, rows_of
from neurosnap.poc.learning.premises import MOST, find_exclusions
from neurosnap.poc.learning.relation_rule import (
    LEAST_H,
    PROMISE,
    WORK,
    exclusions,
    promises,
)
from neurosnap.poc.order.graph import PocGraph
from neurosnap.poc.order.literal_sets import Words, from_words

Codes = NDArray[np.uint8]
Four = tuple[Words, Words, Words, Words]


class Limits(NamedTuple):
    """What is looked for."""

    premises: int = 2
    """The most; 1: only what two sensors say."""
    lag: int = USUAL
    """The longest, in ticks; 0: only what holds at once."""
    shares: int = 1
    """Of the accidents that are allowed this search has one share of so many."""
    work: int = WORK
    """Words of 64 ticks that a search looks at, about."""

    @classmethod
    def of(cls, premises: int, lag: int) -> "Limits":
        """Return limits; InvalidValueError: one is out of range."""
        for name, value, least, most in (
            ("premises", premises, 1, MOST),
            ("lag", lag, 0, LONGEST),
        ):
            if not least <= value <= most:
                raise InvalidValueError(name, f"must be {least} to {most}", value)
        return cls(premises, lag)


USUAL_LIMITS = Limits()


@dataclass(frozen=True, slots=True)
class Beyond:
    """A relation of several premises, or one that holds late."""

    premises: tuple[int, ...]
    """The literals that imply another."""
    conclusion: int
    """That literal."""
    lag: Lag | None
    """How late; None for several premises."""
    counts: PairCounts
    """``(4,)``, of the joint readings of `bits`."""
    most: float
    """What it promises."""
    explains: int
    """On how many more occasions it would fail at once, or without one of its premises:
    the one that matters least."""
    waits: tuple[int, int, int] = (0, 0, 0)
    """The shortest, the median and the longest, in ticks."""

    @property
    def implication(self) -> tuple[int, int]:
        """Of one premise: it, and what it implies."""
        return self.premises[0], self.conclusion

    def bits(self, columns: Columns) -> Four:
        """Return two readings that exclude each other, ``(W,)`` each.

        Returns:
            The ticks of the one, and of its opposite; the same of the other.
        """
        if self.lag is not None:
            return bits_of(columns, self.lag)
        return _joined(columns, self.premises, self.conclusion ^ 1)


def beyond_pairs(
    columns: Columns, counts: PairCounts, codes: Codes, given: Codes, limits: Limits
) -> tuple[list[Beyond], Codes, int]:
    """Return what relates sensors beyond pairs at one instant.

    Args:
        columns: The readings.
        counts: Of all pairs.
        codes: ``(P,)``: what the rule tells of each pair.
        given: ``(P,)``: what holds whatever is read.
        limits: What to look for; a lag as `longest_lag` returns it.

    Returns:
        It; `codes` without what holds nearly at once, and better late; and how many
        sets of literals were passed over, being too many.
    """
    if limits[:2] == (1, 0):
        return [], codes, 0
    late = _late(columns, counts, codes, find_lags(columns, *limits[1:3]))
    codes = codes & ~codes_of((one.implication for one in late), len(codes))
    reach = _reach(codes | given, columns)
    short = {*shortest((one.lag for one in late if one.lag), reach, limits.lag)}
    found = [one for one in late if one.lag in short]
    sets, left = find_exclusions(columns, limits.premises, reach, *limits[2:])
    oriented = (_oriented(columns, one.literals) for one in sets)
    return [*found, *filter(None, oriented)], codes, left


def _reach(codes: Codes, columns: Columns) -> NDArray[np.bool_]:
    """Return what implies what, ``(2N, 2N)``, reflexive."""
    sensors = len(columns.on)
    closed = PocGraph.of_rows(rows_of(codes, sensors)).closed
    reach: NDArray[np.bool_] = from_words(closed, 2 * sensors)
    return reach | np.eye(2 * sensors, dtype=np.bool_)


def _late(
    columns: Columns, counts: PairCounts, codes: Codes, lags: list[Lag]
) -> list[Beyond]:
    """Return what holds late, and not as well at once.

    What holds nearly at once holds late only if it never fails so, or promises half as
    many failures.
    """
    judged = exclusions(bits_of(columns, lag) for lag in lags)
    edges = [lag.implication for lag in lags]
    at_once = promises(counts, codes & codes_of(edges, len(codes)))
    found = []
    for place, (lag, (a, b)) in enumerate(zip(lags, edges, strict=True)):
        counted = PairCounts(*(each[:, place] for each in judged.counts))
        pair, most = pair_of(a, b), float(judged.most[place])
        better = not counted.ticks[0] or most <= (1 - LEAST_H) * at_once[pair]
        if better or not leads(int(codes[pair]), a, b):
            failing = columns.ticks_of(a) & columns.ticks_of(b ^ 1)
            explains = runs(failing) - int(counted.occasions[0])
            seen = waits(columns, lag)
            found.append(Beyond((a,), b, lag, counted, most, explains, seen))
    return found


def _oriented(columns: Columns, literals: tuple[int, ...]) -> Beyond | None:
    """Return what a set of literals that exclude each other says, as an implication.

    Of those that promise enough it is the one with the fewest literals that say off,
    then the one that promises most; of those that never failed another, if none does.
    """
    ways = []
    for k, last in enumerate(literals):
        rest = literals[:k] + literals[k + 1 :]
        judged = exclusions([_joined(columns, rest, last)])
        counts = PairCounts(*(each[:, 0] for each in judged.counts))
        most, stars = float(judged.most[0]), sum(one & 1 for one in rest) + 1 - last % 2
        if not counts.ticks[0] or most <= PROMISE:
            without = [
                np.bitwise_and.reduce(
                    [columns.ticks_of(one ^ (one == other)) for one in rest]
                )
                for other in rest
            ]
            explains = min(runs(each & columns.ticks_of(last)) for each in without)
            found = Beyond(rest, last ^ 1, None, counts, most, explains)
            ways.append((most > PROMISE, stars, most, k, found))
    return min(ways)[-1] if ways else None


def _joined(columns: Columns, premises: tuple[int, ...], last: int) -> Four:
    """Return where premises hold together, and where not; and the same of a literal."""
    whole = np.bitwise_and.reduce([columns.ticks_of(one) for one in premises])
    broken = np.bitwise_or.reduce([columns.ticks_of(one ^ 1) for one in premises])
    return whole, broken, columns.ticks_of(last), columns.ticks_of(last ^ 1)
