"""Decides what differs between two tables of the same sensors by more than chance.

Three kinds of questions are asked, each in both directions:

- of each two sensors and each joint reading whether it comes oftener on the occasions
  on which it could (`neurosnap.poc.learning.pair_occasions`);
- of each two literals, and of each time, whether the second follows the first in that
  time less often (`neurosnap.poc.learning.delays`);
- of each sensor whether it is on, or comes on, more.

Of the first two only what a relation says, in either table, is told; but all that could
be asked is counted. An answer is told if chance would tell any in less than `CHANCE` of
such pairs of tables, all questions together (Bonferroni; each kind has a third). How
often chance gives it is the larger of two bounds (`two_samples`):

- By occasions: a door that stays open for a night is one, so that slow sensors, and
  little data, prove little.
- By the spread over up to 32 stretches of each table, so that a burst of failures is
  one.

A relation is tested from both of its sides, and must differ by both: where a machine is
only used more than before, one of the two shifts by itself. What follows has one side.

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
from neurosnap.poc.learning.delays import (
    ANSWERS,
    LONGEST,
    Waits,
    count_waits,
    later,
    occasions,
)
from neurosnap.poc.learning.pair_occasions import OnProgress, count_pairs
from neurosnap.poc.learning.pairs import codes_of
from neurosnap.poc.learning.relation_rule import CODES, LEAST_H, judge
from neurosnap.poc.learning.two_samples import by_stretches, by_trials
from neurosnap.poc.order.literal_sets import Words, to_words

Ints: TypeAlias = NDArray[np.int64]
Flags: TypeAlias = NDArray[np.bool_]
Tables: TypeAlias = tuple[Columns, Columns]
Told: TypeAlias = dict[frozenset[str], int]
"""The fewest tests, in either table, of what relates two sensors."""
CHANCE = 0.05
"""Pairs of tables of an unchanged machine of which anything is told, at most."""
FEW = 10
"""Fewer tests of a relation than these say nothing."""
_FAILING = 0.5
"""The largest share of its occasions on which one literal does not follow another."""
_NEEDED = -math.log(CHANCE)
_KINDS = 3
_STRETCHES = 32
_STEP, _ROOM = 64, 1 << 22
"""Sensors whose waits are counted at a time; fewer, if there are more counts then."""
_ENOUGH = 10.0
"""The evidence that a row counts for in a suspicion, at most: many rows say more."""
_NAMES = {3: "the same", 4: "never together", 12: "opposite"}
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
    """What that is, in words."""
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
    """The ticks in which at least half of the answers come; None where they do not, or
    none is awaited."""
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
) -> Differences:
    """Return what differs between two tables of the same sensors, in the same order.

    Args:
        first: What is taken for right.
        second: What is held against it.
        known: Pairs of literals, ``a -> b``, that hold whatever is read.
        on_progress: Told how many pairs of each are counted.

    Returns:
        O(N² T / 64) time, and what `neurosnap.poc.learning.delays` takes.
    """
    tables, sensors = (first, second), len(first.sensorium)
    given = codes_of(known, sensors * (sensors - 1) // 2) > 0
    told: Told = {}
    found: dict[frozenset[str], list[Difference]] = {}
    odd: dict[str, float] = {}
    for row in chain(
        _levels(tables, given, told, on_progress),
        _waits(tables, given, told),
        _own(tables),
    ):
        if not row.b:
            # Asked about this sensor alone, chance has less evidence.
            alone = row.evidence + _free(4 * sensors)
            odd[row.a] = max(alone, odd.get(row.a, _NEEDED))
        if row.chance < CHANCE:
            found.setdefault(row.sensors, []).append(row)
    rows = sorted(map(_chosen, found.values()), key=lambda row: row.chance)
    intact = Counter(chain(*(told.keys() - found.keys())))
    few = sum(tests < FEW for tests in told.values())
    return Differences(rows, [*_suspects(rows, intact, odd)], len(told), few)


def _row(
    evidence: float,
    about: tuple[str, str, str, str],
    tested: Ints,
    failed: Ints,
    within: tuple[int, int] = (LONGEST + 1, LONGEST + 1),
) -> Difference:
    """Return a row of what it says, of the counts in both tables, and of the times."""
    n, lost, n_new, lost_new = np.stack([tested, failed], axis=1).ravel().tolist()
    before, now = (ticks if ticks <= LONGEST else None for ticks in within)
    chance = math.exp(-evidence)
    return Difference(*about, n, lost, n_new, lost_new, before, now, chance)


def _levels(
    tables: Tables, given: Flags, told: Told, on_progress: OnProgress | None
) -> Iterator[Difference]:
    """Yield what relations exclude, where that comes more or less often.

    Args:
        tables: Both.
        given: ``(P,)``: the pairs whose relation is known.
        told: Gets the pairs that are related.
        on_progress: Told how many pairs of each table are counted.
    """
    names = tables[0].sensorium.names
    counts = [count_pairs(table, on_progress) for table in tables]
    judged = [judge(*each, given).codes for each in zip(tables, counts, strict=True)]
    codes = np.where(given, np.uint8(0), np.array(judged))
    ends = np.stack(np.tril_indices(len(names), -1), axis=1)
    free = _free(8 * len(given))
    for cell, code in enumerate(CODES):
        says = codes & code > 0
        pairs = np.flatnonzero(says.any(axis=0))
        runs = np.array([each.occasions[:, pairs] for each in counts], np.int64)
        failed = runs[:, cell]
        sides = np.array([failed + runs[:, cell ^ other] for other in (1, 2)])
        _note(told, names, ends[pairs], sides.min(axis=(0, 1)))
        sure = np.min([by_trials(failed, tested) for tested in sides], axis=0) - free
        for way, place in np.argwhere(sure > _NEEDED).tolist():
            pair = pairs[place]
            i, j = ends[pair].tolist()
            change = _CHANGES[says[0, pair], says[1, pair]][way]
            spread = _level_spread(
                tables, (2 * i + (cell >> 1), 2 * j + (cell & 1)), way
            )
            if change:
                side = sides[:, :, place].min(axis=1).argmin()
                said = int(codes[0 if says[0, pair] else 1, pair])
                a, b = (names[i], names[j]) if said == 1 else (names[j], names[i])
                evidence = min(float(sure[way, place]), spread - free)
                counted = sides[side, :, place], failed[:, place]
                about = change, _sentence(said, a, b), a, b
                yield _row(evidence, about, *counted)


def _sentence(code: int, a: str, b: str) -> str:
    if code == 8:
        return f"at least one of {a} and {b}"
    return f"{a} and {b}: {_NAMES[code]}" if code in _NAMES else f"{a} implies {b}"


def _note(told: Told, names: Sequence[str], pairs: Ints, tests: Ints) -> None:
    """Note that pairs of sensors, ``(n, 2)``, are related, and by how many tests."""
    for (i, j), count in zip(pairs.tolist(), tests.tolist(), strict=True):
        both = frozenset((names[i], names[j]))
        told[both] = max(told.get(both, 0), count)


def _free(questions: int) -> float:
    """Return the evidence that chance has for one of so many questions of a kind."""
    return math.log(_KINDS * max(questions, 1))


def _level_spread(tables: Tables, failing: tuple[int, int], way: int) -> float:
    """Return how surely two literals are read together oftener, while either is."""
    sure = []
    for a, b in (failing, failing[::-1]):
        asked = []
        for table in tables:
            here, there = table.ticks_of(a), table.ticks_of(b)
            asked.append((here & there, here & (there | table.ticks_of(b ^ 1))))
        sure.append(_spread(asked, way))
    return min(sure)


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


def _waits(tables: Tables, given: Flags, told: Told) -> Iterator[Difference]:
    """Yield the answers that come later, sooner, more or less often.

    Args:
        tables: Both.
        given: ``(P,)``: the pairs whose relation is known.
        told: Gets the pairs that are related.
    """
    names, kinds = tables[0].sensorium.names, len(ANSWERS)
    free = _free(2 * (LONGEST + 1) * 4 * kinds * len(given))
    skipped = np.eye(len(names), dtype=np.bool_)
    skipped[np.tril_indices(len(names), -1)] = given
    step = max(1, min(_STEP, _ROOM // (2 * kinds * LONGEST * len(names))))
    begun = [occasions(table) for table in tables]
    for start in range(0, len(names), step):
        some = slice(start, min(start + step, len(names)))
        waits = [
            count_waits(table, some, each)
            for table, each in zip(tables, begun, strict=True)
        ]
        may = ~(skipped | skipped.T)[:, some].repeat(2, axis=0).repeat(kinds, axis=1)
        within = np.array([_within(each, may, free) for each in waits])
        asked = np.argwhere((within <= LONGEST).any(axis=0))
        ends = asked // (2, kinds) + (0, start)
        counts = np.array([each.counts[asked[:, 0], asked[:, 1]] for each in waits])
        tested, failed = _late(counts.astype(np.int64))
        _note(told, names, ends, tested[..., 0].min(axis=0))
        flat = by_trials(failed.reshape(2, -1), tested.reshape(2, -1))
        sure = flat.reshape(failed.shape) - free
        for way, place in np.argwhere(sure.max(axis=-1) > _NEEDED).tolist():
            ticks = int(sure[way, place].argmax())
            literal, answer = asked[place].tolist()
            spans = int(within[0, literal, answer]), int(within[1, literal, answer])
            if change := _changed_wait(*spans, way):
                a, b = (names[sensor] for sensor in ends[place])
                said = (
                    f"{a} {ANSWERS[2 + literal % 2]}, then {b} {ANSWERS[answer % kinds]}"
                    f" {_span(ticks)}"
                )
                sets = [
                    _late_at(each[literal], some.each[:, answer], ticks)
                    for each, some in zip(begun, waits, strict=True)
                ]
                spread = _spread(sets, way)
                evidence = min(float(sure[way, place, ticks]), spread - free)
                counted = tested[:, place, ticks], failed[:, place, ticks]
                yield _row(evidence, (change, said, a, b), *counted, spans)


def _late(counts: Ints) -> tuple[Ints, Ints]:
    """Return occasions, and those not followed within each time, of counts of waits."""
    tested = counts.sum(axis=-1, keepdims=True)
    failed = tested - counts.cumsum(axis=-1)[..., :-1]
    return np.broadcast_to(tested, failed.shape), failed


def _within(waits: Waits, may: Flags, free: float) -> Ints:
    """Return in how many ticks literals follow others, above `LONGEST` if they do not.

    They follow once at least half of the occasions are followed, at most half as many
    as of all ticks are not, and that is no accident.

    Args:
        waits: Of one table.
        may: ``(2N, M)``: what is asked for.
        free: As `_free` returns it.

    Returns:
        ``(2N, M)``.
    """
    tested, failed = _late(waits.counts.astype(np.int64))
    ticks, late = _late(waits.usual)
    usual = late / np.maximum(ticks, 1)
    most = np.minimum(_FAILING, (1 - LEAST_H) * usual)
    follows = may[..., np.newaxis] & (tested > 0) & (failed <= most * tested)
    places = np.nonzero(follows)
    of, lost = tested[places], failed[places]
    rest, gone = ticks[places[1:]] - of, late[places[1:]] - lost
    sure = by_trials(np.array([lost, gone]), np.array([of, rest]))[0] - free
    follows[places] = sure > _NEEDED
    found: Ints = np.where(follows.any(axis=-1), follows.argmax(axis=-1), LONGEST + 1)
    return found


def _changed_wait(before: int, now: int, way: int) -> str:
    """Return what becomes of an answer, by the times of `_within`."""
    if before == now or max(before, now) > LONGEST:
        return _CHANGES[before <= LONGEST, now <= LONGEST][way]
    if (now > before) == (way == 0):
        return "later" if now > before else "sooner"
    return ""  # it comes later, and more come in that time


def _span(ticks: int) -> str:
    return f"within {ticks} tick{'s' * (ticks > 1)}" if ticks else "at once"


def _late_at(
    begun: NDArray[np.intp], waits: NDArray[np.uint8], ticks: int
) -> tuple[Words, Words]:
    """Return the occasions, as sets of ticks, without an answer in time, and all."""
    known = begun[waits[begun] <= LONGEST + 1]
    sets = np.zeros((2, len(waits)), np.bool_)
    sets[0, known[waits[known] > ticks]] = True
    sets[1, known] = True
    return to_words(sets[0]), to_words(sets[1])


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
        (ANSWERS[0], on, times_on, share, runs),
        (ANSWERS[2], comes, times_comes, times_comes, ticks),
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
