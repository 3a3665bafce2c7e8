"""Decides what differs between two tables of the same sensors by more than chance.

Three kinds of questions are asked, each in both directions:

- of each two sensors and each joint reading whether it comes oftener on the occasions
  on which it could (`neurosnap.poc.learning.pair_occasions`);
- of each two literals, and of each lag, whether that fails oftener where one of them
  begins (`neurosnap.poc.learning.lags`; of what holds at once the lag is 0);
- of each sensor whether it is on, or comes on, more.

Of the first two only what either table tells is asked; but all that could be is
counted. So what tells it promises nothing, and of a periodic sensor each run is worth
a tick at least. An answer is told if chance would tell any in less than `CHANCE` of
such pairs of tables, all questions together (Bonferroni; each kind has a third). How
often chance gives it is the larger of two bounds (`two_samples`):

- By occasions: a door that stays open for a night is one, so that slow sensors, and
  little data, prove little.
- By the spread over up to 32 stretches of each table, so that a burst of failures is
  one.

A relation is tested from both of its sides, and must differ by both: where a machine is
only used more than before, one of the two shifts by itself. A lag has one side.

Suspected first is the sensor that most of the evidence is about, then the one that most
of the rest is about. Of two that are equal it is the one that is odd by itself, or that
has fewer relations left.
"""

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.lags import (
    USUAL,
    Lag,
    bits_of,
    explains,
    later,
    longest_lag,
    proposed,
)
from neurosnap.poc.learning.pair_occasions import OnProgress, PairCounts, count_pairs
from neurosnap.poc.learning.pairs import codes_of, pair_of, rows_of
from neurosnap.poc.learning.relation_rule import (
    CODES,
    evidence_for,
    judge,
    ticks_for_one,
)
from neurosnap.poc.learning.relation_table import at_once, in_time, in_words, span_of
from neurosnap.poc.learning.two_samples import by_stretches, by_trials
from neurosnap.poc.order.literal_sets import Words, from_words

Codes: TypeAlias = NDArray[np.uint8]
Ints: TypeAlias = NDArray[np.int64]
Tables: TypeAlias = tuple[Columns, Columns]
Told: TypeAlias = dict[frozenset[str], int]
"""The fewest tests, in either table, of what relates two sensors."""
CHANCE = 0.05
"""Pairs of tables of an unchanged machine of which anything is told, at most."""
FEW = 10
"""Fewer tests of a relation than these say nothing."""
_NEVER = USUAL + 1
"""The lag of what is not told."""
_NEEDED = -math.log(CHANCE)
_KINDS = 3
_STRETCHES = 32
_MORE, _STRETCH = 4, 8
"""How much more a search for lags may look at than one that `learn` makes; and in what
stretches, in words of 64 ticks, if that is too little for all readings."""
_ENOUGH = 10.0
"""The evidence that a row counts for in a suspicion, at most: many rows say more."""
_CHANGES = {
    (True, False): ("lost", ""),
    (True, True): ("weaker", "stronger"),
    (False, True): ("", "gained"),
}
"""What becomes of a relation that fails oftener, or less often, by whether the first
table tells it, and the second."""


@dataclass(frozen=True, slots=True)
class Difference:
    """A way in which the second of two tables differs from the first."""

    change: str
    """``lost``, ``weaker``, ``later``, ``gained``, ``stronger`` or ``sooner`` of two
    sensors; ``more`` or ``less`` of one."""
    relation: str
    """What that is, in words; of what is later or sooner with both lags."""
    a: str
    """A sensor."""
    b: str
    """Another; empty where it is about one."""
    tested: int
    """Occasions of the first table on which it could fail; of one sensor, ticks."""
    failed: int
    """Those of them on which it failed; of one sensor, at which it is so."""
    tested_new: int
    """The same of the second table."""
    failed_new: int
    within: int | None
    """The lag with which the first table tells it, in ticks; None: it does not, or the
    question is whether both are read at once."""
    within_new: int | None
    chance: float
    """The share of pairs of tables of an unchanged machine, at most, in which anything
    looks as sure."""

    @property
    def sensors(self) -> frozenset[str]:
        """What it is about."""
        return frozenset((self.a, self.b)) - {""}

    @property
    def evidence(self) -> float:
        """The logarithm of the chance, made positive: nats."""
        return -math.log(self.chance)


class Differences(NamedTuple):
    """What differs between two tables."""

    rows: Sequence[Difference]
    """The surest first; one of each two sensors, and of each one, at most."""
    suspects: Sequence[str]
    """The sensors that explain all rows, the likeliest first."""
    relations: int
    """The pairs of sensors that either table relates."""
    untested: int
    """Those of them with fewer than `FEW` tests in one of the tables."""


def compare_tables(
    first: Columns,
    second: Columns,
    known: Iterable[tuple[int, int]] = (),
    on_progress: OnProgress | None = None,
    period: float = 0.0,
) -> Differences:
    """Return what differs between two tables of the same sensors, in the same order.

    Args:
        first: What is taken for right.
        second: What is held against it.
        known: Pairs of literals, ``a -> b``, that hold whatever is read.
        on_progress: Told how many pairs of each are counted.
        period: Seconds from tick to tick; 0: not always as many, or not known.

    Returns:
        O(N² T) time, as `find_lags` takes it; of too many, some ticks are searched.
    """
    tables, names = (first, second), first.sensorium.names
    pairs = len(names) * (len(names) - 1) // 2
    given = codes_of(known, pairs)
    counts = [count_pairs(table, on_progress) for table in tables]
    judged = [
        judge(table, count, given > 0, _worth(table)).codes
        for table, count in zip(tables, counts, strict=True)
    ]
    codes = np.where(given, np.uint8(0), np.array(judged))
    told: Told = {}
    found: dict[frozenset[str], list[Difference]] = {}
    odd: dict[str, float] = {}
    here = _at_once(counts, codes, len(names))
    asked = here, _late(tables, here, codes, given)
    for row in chain(
        *(_differing(tables, each, codes, told, period) for each in asked),
        _own(tables),
    ):
        if not row.b:
            # Asked about this sensor alone, chance has less evidence.
            alone = row.evidence + _free(4 * len(names))
            odd[row.a] = max(alone, odd.get(row.a, _NEEDED))
        if row.chance < CHANCE:
            found.setdefault(row.sensors, []).append(row)
    rows = sorted(map(_chosen, found.values()), key=lambda row: row.chance)
    intact = Counter(chain(*(told.keys() - found.keys())))
    few = sum(tests < FEW for tests in told.values())
    return Differences(rows, [*_suspects(rows, intact, odd)], len(told), few)


class _Asked(NamedTuple):
    """What is asked of both tables."""

    lags: list[Lag]
    """``M``: readings that exclude each other."""
    spans: Ints
    """``(2, M)``: the lag with which each table tells that."""
    failed: Ints
    """``(2, 2, M)``: how often both are read, from the side of the one at the end, and
    of the other; in each table."""
    tested: Ints
    """``(2, 2, M)``: how often that could be."""
    begins: bool
    """Whether it could only where a reading begins. Then each side is a question."""


def _at_once(counts: Sequence[PairCounts], codes: Codes, sensors: int) -> _Asked:
    """Return what relations exclude at once."""
    ends = np.stack(np.tril_indices(sensors, -1))
    lags, spans, runs = list[Lag](), [], []
    for cell, code in enumerate(CODES):
        says = codes & code > 0
        pairs = np.flatnonzero(says.any(axis=0))
        for i, j in ends[:, pairs].T.tolist():
            lags.append(Lag(2 * i + (cell >> 1), 2 * j + (cell & 1), 0, True))
        spans.append(np.where(says[:, pairs], 0, _NEVER))
        of_each = np.array([each.occasions[:, pairs] for each in counts], np.int64)
        runs.append(of_each[:, [cell, cell ^ 1, cell ^ 2]])
    failed, *passed = np.concatenate(runs, axis=-1).swapaxes(0, 1)
    twice, told = np.array([failed, failed]), np.concatenate(spans, axis=-1)
    return _Asked(lags, told, twice, twice + np.array(passed), begins=False)


def _late(tables: Tables, at_once: _Asked, codes: Codes, given: Codes) -> _Asked:
    """Return what either table tells at once, or late, where a reading begins."""
    literals = 2 * len(tables[0].on)
    needed = evidence_for(2 * USUAL * literals * (literals - 2))
    found = (proposed(_some(each), USUAL, needed, _worth(each)) for each in tables)
    spans = np.array([*found])
    spans[spans == 0] = _NEVER
    for span, some in zip(spans, codes, strict=True):
        implied = from_words(rows_of(some, literals // 2), literals)
        span[(span == _NEVER) & implied[:, np.arange(literals) ^ 1]] = 0
    known = rows_of(np.where(given, np.uint8(15), given), literals // 2)
    spans[:, :, from_words(known, literals)] = _NEVER
    late = (spans % _NEVER > 0).any(axis=0)
    # What comes later fails within the shorter of both times.
    shortest = np.column_stack([np.argwhere(late), spans.min(axis=0)[late]]).tolist()
    lags = [*at_once.lags, *(Lag(u, x, k, not last) for last, u, x, k in shortest)]
    counts = [
        np.bitwise_count(_sets(table, lag, begins=True)).sum(axis=-1)
        for table in tables
        for lag in lags
    ]
    shape = 2, len(lags), 2, 2
    failed, tested = np.array(counts, np.int64).reshape(shape).transpose(2, 3, 0, 1)
    told = np.concatenate([at_once.spans, spans[:, late]], axis=1)
    return _Asked(lags, told, failed, tested, begins=True)


def _some(table: Columns) -> Columns:
    """Return all readings, or of too many some stretches, evenly spread."""
    each = max(1, USUAL // max(1, _MORE * longest_lag(table, USUAL)))
    words = np.flatnonzero(np.arange(table.on.shape[1]) // _STRETCH % each == 0)
    on, off = (np.take(bits, words, axis=1) for bits in (table.on, table.off))
    return Columns(table.sensorium, min(table.ticks, 64 * len(words)), on, off)


def _worth(table: Columns) -> NDArray[np.float32]:
    """Return how many ticks of two sensors are worth one; of a run one is, at least."""
    begun = np.bitwise_count(table.on & later(table.off)).sum(axis=1, dtype=np.int64)
    run = (table.ticks / np.maximum(2 * begun, 1)).astype(np.float32)
    worth: NDArray[np.float32] = np.maximum.outer(run, run)
    return np.minimum(ticks_for_one(table), worth)


def _sets(table: Columns, lag: Lag, *, begins: bool) -> tuple[Words, Words]:
    """Return at which ticks two readings come together, and at which they could.

    ``(2, W)`` each: from the side of the one at the end, and of the other.
    """
    bits = np.array(bits_of(table, lag))
    here, gone = bits[::2], bits[1::2]
    asked = here & later(gone) if begins else here
    return asked & here[::-1], asked & (here | gone)[::-1]


def _differing(
    tables: Tables, asked: _Asked, codes: Codes, told: Told, period: float
) -> Iterator[Difference]:
    """Yield what comes more or less often; `told` gets the pairs that are related."""
    names, questions = tables[0].sensorium.names, 8 * codes.shape[1]
    free = _free(questions * (8 * _NEVER if asked.begins else 1))
    least = asked.tested.min(axis=(0, 1)).tolist()
    for lag, count in zip(asked.lags, least, strict=True):
        both = frozenset(names[literal >> 1] for literal in lag[:2])
        told[both] = max(told.get(both, 0), count)
    sure = np.array([*map(by_trials, asked.failed, asked.tested)]) - free
    if not asked.begins:
        sure = sure.min(axis=0, keepdims=True)
    for side, way, place in np.argwhere(sure > _NEEDED).tolist():
        lag, spans = asked.lags[place], asked.spans[:, place].tolist()
        if change := _changed(tables, lag, spans, way):
            sets = [_sets(table, lag, begins=asked.begins) for table in tables]
            by_tests = asked.tested[:, :, place].min(axis=1).argsort()
            sides = [side] if asked.begins else by_tests.tolist()
            asked_of = [[(both[k], tests[k]) for both, tests in sets] for k in sides]
            spread = min(_spread(each, way) for each in asked_of)
            evidence = min(float(sure[side, way, place]), spread - free)
            a, b = lag.implication
            code = int(codes[int(spans[0] > 0), pair_of(a, b)])
            said = in_time(lag, names) if lag.ticks else at_once(code, (a, b), names)
            what = in_words(*said, span_of(lag.ticks, period))
            if change in ("later", "sooner"):
                before, now = (span_of(ticks, period) for ticks in spans)
                what += f" (lag {before}, now {now})"
            about = change, what, names[a >> 1], names[b >> 1]
            counted = asked.tested, asked.failed
            tested, failed = (each[sides[0], :, place] for each in counted)
            within = spans if asked.begins else [_NEVER, _NEVER]
            yield _row(evidence, about, tested, failed, within)


def _row(
    evidence: float,
    about: tuple[str, str, str, str],
    tested: Ints,
    failed: Ints,
    within: Sequence[int] = (_NEVER, _NEVER),
) -> Difference:
    """Return a row of what it says, of the counts in both tables, and of the times."""
    n, lost, n_new, lost_new = np.stack([tested, failed], axis=1).ravel().tolist()
    before, now = (ticks if ticks < _NEVER else None for ticks in within)
    chance = math.exp(-evidence)
    return Difference(*about, n, lost, n_new, lost_new, before, now, chance)


def _changed(tables: Tables, lag: Lag, spans: Sequence[int], way: int) -> str:
    """Return what becomes of what is told within so many ticks, or never."""
    before, now = spans
    if before == now or _NEVER in spans:
        return _CHANGES[before < _NEVER, now < _NEVER][way]
    for table, ticks in zip(tables, spans, strict=True):
        if ticks and not explains(table, lag._replace(ticks=ticks), USUAL):
            return _CHANGES[True, True][way]
    if (now > before) == (way == 0):
        return "later" if now > before else "sooner"
    return ""  # it comes later, and more come in that time


def _free(questions: int) -> float:
    """Return the evidence that chance has for one of so many questions of a kind."""
    return math.log(_KINDS * max(questions, 1))


def _spread(asked: Sequence[tuple[Words, Words]], way: int) -> float:
    """Return how surely failures are a larger share of tests, over stretches.

    Args:
        asked: Of each table the ticks at which it fails, and at which it is tested.
        way: 0: in the second; 1: in the first.
    """
    counted = []
    for both in asked[::-1] if way else asked:
        parts = min(_STRETCHES, len(both[0]))
        bounds = np.arange(parts) * len(both[0]) // parts
        bits = np.bitwise_count(np.array(both)).astype(np.int64)
        counted.append(np.add.reduceat(bits, bounds, axis=1))
    failed, tested = zip(*counted, strict=True)
    return by_stretches(failed, tested)


def _own(tables: Tables) -> Iterator[Difference]:
    """Yield how surely each sensor is on, or comes on, more or less, however little."""
    names = tables[0].sensorium.names
    free = _free(4 * len(names))
    known = [table.on | table.off for table in tables]
    on = [table.on for table in tables]
    comes = [table.on & later(table.off) for table in tables]
    ticks, times_on, times_comes = map(_count, (known, on, comes))
    starts = [[ticks & ~later(ticks) for ticks in (t.on, t.off)] for t in tables]
    # Each run counts as one reading: it is worth about as much.
    runs = np.array([_count(each).sum(axis=0) for each in starts])
    share = np.rint(runs * times_on / np.maximum(ticks, 1)).astype(np.int64)
    for answer, sets, times, failed, tested in (
        ("is on", on, times_on, share, runs),
        ("comes on", comes, times_comes, times_comes, ticks),
    ):
        sure = by_trials(failed, tested)
        for way, sensor in np.argwhere(sure > 0).tolist():
            name = names[sensor]
            asked = [(sets[k][sensor], known[k][sensor]) for k in range(2)]
            evidence = min(float(sure[way, sensor]), _spread(asked, way)) - free
            about = ("more", "less")[way], f"{name} {answer}", name, ""
            yield _row(evidence, about, ticks[:, sensor], times[:, sensor])


def _count(sets: Sequence[Words]) -> Ints:
    """Return how many ticks are in each of several sets, of both tables."""
    return np.array(
        [np.bitwise_count(each).sum(axis=1, dtype=np.int64) for each in sets]
    )


def _chosen(rows: Sequence[Difference]) -> Difference:
    """Return what to tell of the same sensors.

    What only comes later is not called lost, unless there is a relation instead, or
    something else is much surer. And what a relation says goes before what follows.
    """
    left = max((row.evidence for row in rows if row.change != "lost"), default=0)
    moved = [
        row
        for row in rows
        if row.change in ("later", "sooner") and 2 * row.evidence >= left
    ]
    level = [row for row in rows if row.within is row.within_new is None]
    instead = any(row.change == "gained" for row in level)
    return min((not instead and moved) or level or rows, key=lambda row: row.chance)


def _suspects(
    rows: Sequence[Difference], intact: Counter[str], odd: Mapping[str, float]
) -> Iterator[str]:
    """Yield sensors that explain all rows, the likeliest first.

    Args:
        rows: What differs.
        intact: How many relations of each sensor are as they were.
        odd: The evidence of each that is about it alone, and no less than `_NEEDED`.
    """
    left = list(rows)
    while left:
        weights: defaultdict[str, float] = defaultdict(float)
        for row in left:
            for name in row.sensors:
                weights[name] += min(row.evidence, _ENOUGH)
        first = max(
            sorted(weights),
            key=lambda name: (weights[name], odd.get(name, _NEEDED), -intact[name]),
        )
        yield first
        left = [row for row in left if first not in row.sensors]
