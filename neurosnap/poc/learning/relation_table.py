"""A table of the relations between sensors that readings support.

A row is a relation of two sensors with what speaks for it. It comes from the rule of
`neurosnap.poc.learning.relation_rule`, or from the order of a snapshot. Only covers are
rows, unless all are asked for: what follows from two rows is none. Near copies count as
one there, so that a copy does not hide what its original implies; that is not in the
order of a snapshot, which cannot hold them (docs/paper.md, "Not in the paper"). There
are rows of what is beyond pairs at one instant (`neurosnap.poc.learning.beyond_pairs`).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, Literal, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from neurosnap.poc.learning.beyond_pairs import (
    USUAL_LIMITS,
    Beyond,
    Four,
    Limits,
    beyond_pairs,
)
from neurosnap.poc.learning.columns import Columns, span
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.lags import USUAL, Lag, longest_lag
from neurosnap.poc.learning.pair_occasions import OnProgress, PairCounts, count_pairs
from neurosnap.poc.learning.pairs import codes_of, leads, pair_of, rows_of
from neurosnap.poc.learning.relation_rule import CODES, judge, keeps, promises
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.poc.order.graph import PocGraph

Kind: TypeAlias = Literal[
    "implies",
    "never together",
    "at least one of",
    "implies late",
    "only after",
    "the same",
    "opposite",
    "nearly implies",
    "nearly never together",
    "nearly at least one of",
    "nearly implies late",
    "nearly only after",
    "nearly the same",
    "nearly opposite",
]

Said: TypeAlias = tuple[Kind, str, str, bool]
"""A kind, two readings, and whether the first must last for what comes to come."""
_TESTS: dict[int, tuple[Kind, bool, tuple[int, int], tuple[int, int]]] = {
    1: ("implies", False, (1, 0), (1, 3)),
    2: ("implies", True, (2, 0), (2, 3)),
    4: ("never together", True, (0, 2), (0, 1)),
    8: ("at least one of", True, (3, 1), (3, 2)),
    3: ("the same", True, (2, 0), (1, 0)),
    12: ("opposite", True, (0, 2), (3, 1)),
}
"""Of each code of a pair of sensors ``j < i``: its name; whether it is told of ``j``
first; and of its two tests the joint readings that fail and that pass."""


@dataclass(frozen=True, slots=True)
class Relation:
    """A relation of two sensors, and the evidence for it.

    A relation is put to the test on the occasions on which it could fail, and counted
    from both sides: ``a implies b`` where ``a`` is on, and where ``b`` is off; ``never
    together`` and ``the same`` where ``a`` is on, and where ``b`` is; ``at least one
    of`` where ``a`` is off, and where ``b`` is; ``opposite`` where ``a`` is on, and
    where it is off. ``a implies b late`` is tested where ``a`` is on, and where ``b``
    stays off; ``a only after b`` where ``a`` is on, and where ``b`` stays off.
    """

    relation: Kind
    a: str
    """A sensor; premises are literals, as in ``belt ∧ gate*``: where both are read so.
    A star means off."""
    b: str
    """Another; of premises, and of what is late, it may have a star, too."""
    tested: int
    """Occasions on which the first test was made; see above."""
    failed: int
    """Those of them on which it failed."""
    tested_back: int
    """Occasions on which the second test was made."""
    failed_back: int
    """Those of them on which it failed; equal to `failed` but for copies."""
    share: float
    """The share of the ticks, with both known, at which it held."""
    at_most: float
    """What it promises: in as many occasions again, no more than this share of the
    ticks at which either test is made fail, with confidence 0.95."""
    since: int
    """The tick, from 1, since when it has not failed."""
    last_failure: int | None
    """The last tick at which it failed; None: never."""
    ticks: int
    """The ticks at which both sensors were known."""
    premises: int = 1
    """How many literals `a` is."""
    within: int = 0
    """Of what is late: the ticks in which it comes."""
    lasting: bool = False
    """Of what is late: `a` implies it once it was read for `within` ticks and one."""
    soonest: int = 0
    """The shortest wait that was seen, in ticks."""
    usual: int = 0
    """The median wait, in ticks."""
    explains: int = 0
    """Of premises, and of what is late: on how many more occasions it would fail
    without the premise that matters least, or at once."""

    @property
    def sentence(self) -> str:
        """The relation in words."""
        return self.said()

    def said(self, period: float = 0.0) -> str:
        """Return the relation in words, its time as `span_of` does."""
        time = span_of(self.within, period)
        return in_words(self.relation, self.a, self.b, self.lasting, time)


def in_words(relation: Kind, a: str, b: str, lasting: bool, time: str) -> str:
    """Return a relation of two readings in the words that all reports have for it."""
    word = relation.removesuffix(" late").removesuffix(" after")
    if word.endswith("implies"):
        held = f" for {time}" if lasting else ""
        late = "" if lasting or word == relation else f" within {time}"
        return f"{a}{held} {word} {b}{late}"
    if word.endswith("only"):
        return f"{a} {word} within {time} after {b}"
    if relation.endswith("at least one of"):
        return f"{relation} {a} and {b}"
    return f"{a} and {b}: {relation}"


def span_of(ticks: int, period: float = 0.0) -> str:
    """Return how long some ticks are, if each takes as many seconds; 0: in ticks."""
    if period:
        return f"{round(ticks * period, 3):g} s"
    return f"{ticks} tick{'s' * (ticks != 1)}"


def at_once(code: int, pair: tuple[int, int], names: Sequence[str]) -> Said:
    """Return what the code of a pair says, given by any literals of its sensors."""
    kind, swapped, *_ = _TESTS[code]
    a, b = (names[one >> 1] for one in sorted(pair, reverse=not swapped))
    return kind, a, b, False


def in_time(lag: Lag, names: Sequence[str]) -> Said:
    """Return what a lag says."""
    a, b = (names[one >> 1] + "*" * (one & 1) for one in lag.implication)
    if not lag.first and a.endswith("*") and b.endswith("*"):
        return "only after", b[:-1], a[:-1], False
    return "implies late", a, b, not lag.first


class Relations(list[Relation]):
    """Relations, and how far promises such as theirs can be trusted."""

    made: int = 0
    """The relations that the first half of the ticks tells, those that follow from
    others too, and the second puts to the test."""
    kept: int = 0
    """Those that failed there no more often than the first half promised."""
    left: int = 0
    """Sets of literals that the search for premises passed over, being too many."""
    lag: int = 0
    """The longest lag that was looked for, in ticks; less than asked of too many."""


def tabulate(
    columns: Columns,
    snapshot: Snapshot | None = None,
    every: bool = False,
    on_progress: OnProgress | None = None,
    known: Iterable[tuple[int, int]] = (),
    limits: Limits = USUAL_LIMITS,
) -> Relations:
    """Return the relations of readings, the strongest first.

    What never failed comes first; then the strongest is the one that promises least
    failures: `Relation.at_most`.

    Args:
        columns: The readings.
        snapshot: What learned from them: its order is shown, and copies that it cannot
            hold; if None, what the rule finds, with its promises held against the
            second half.
        every: Whether to show those that follow from others, too.
        on_progress: Told how many pairs are counted.
        known: Pairs of literals, ``a -> b``, that hold whatever is read. They count for
            what follows from them, and are rows only if `every` is asked for.
        limits: Of what is looked for beyond pairs, if there is no snapshot.

    Returns:
        O(N² T / 64) time for pairs; what is beyond them takes some seconds at most.
    """
    count = len(columns.sensorium)
    given = codes_of(known, count * (count - 1) // 2)
    told, beyond = Relations(), list[Beyond]()
    if snapshot is None:
        told.lag = longest_lag(columns, limits.lag)
        limits = limits._replace(lag=told.lag)
        half = _first_half(columns, given, limits)
        # What is counted of the first half is not counted again.
        counts = count_pairs(columns, on_progress, (half.words, half.counts))
        codes = judge(columns, counts, given > 0).codes
        beyond, codes, told.left = beyond_pairs(columns, counts, codes, given, limits)
        told.made, told.kept = half.checked(columns, counts)
    else:
        counts = count_pairs(columns, on_progress)
        judged = judge(columns, counts, given > 0)
        codes = np.where(judged.near, judged.codes, snapshot.codes)
    found = _Found(columns, counts, np.where(given, given, codes), given > 0)
    # A pair has one relation; a class that holds complements, too, tells it twice.
    rows = {(row.a, row.b): row for row in (found.every() if every else found.covers())}
    told += sorted([*rows.values(), *map(found.beyond, beyond)], key=_rank)
    return told


class _Half(NamedTuple):
    """What the first half of the readings tells."""

    words: int
    """The words of it."""
    counts: PairCounts
    told: NDArray[np.intp]
    """The pairs that it relates, ``(n,)``."""
    codes: NDArray[np.uint8]
    """``(n,)``."""
    most: NDArray[np.float64]
    """``(n,)``: what they promise."""
    before: NDArray[np.uint32]
    """``(4, n)``: their joint readings in it."""
    beyond: list[Beyond]

    def checked(self, columns: Columns, counts: PairCounts) -> tuple[int, int]:
        """Return `Relations.made` and `Relations.kept`, by the second half."""
        after = [counts.ticks[:, self.told] - self.before]
        for one in self.beyond:
            a, a_off, b, b_off = (each[self.words :] for each in one.bits(columns))
            both = np.stack([a & b, a & b_off, a_off & b, a_off & b_off])
            after.append(np.bitwise_count(both).sum(axis=1, keepdims=True))
        codes = [*self.codes, *(CODES[0] for _ in self.beyond)]
        most = [*self.most, *(one.most for one in self.beyond)]
        tested, kept = keeps(
            np.concatenate(after, axis=1), np.array(codes, np.uint8), np.array(most)
        )
        return int(tested.sum()), int((tested & kept).sum())


def _first_half(columns: Columns, given: NDArray[np.uint8], limits: Limits) -> _Half:
    words = columns.on.shape[1] // 2
    early = columns.until(words)
    counts = count_pairs(early)
    codes = judge(early, counts, given > 0).codes
    beyond, codes, _ = beyond_pairs(early, counts, codes, given, limits)
    told = np.where(given, np.uint8(0), codes).nonzero()[0]
    most, before = promises(counts, codes)[told], counts.ticks[:, told]
    return _Half(words, counts, told, codes[told], most, before, beyond)


def implications(
    data: Any,  # noqa: ANN401 - an array, a data frame, or columns
    threshold: float | str | None = None,
    names: Iterable[str] | None = None,
    every: bool = False,
    premises: int = 2,
    lag: int = USUAL,
) -> Any:  # noqa: ANN401 - a data frame, where pandas is
    """Return which relations of sensors a table of readings supports.

    Args:
        data: As of `EmpiricalSnapshot.fit`.
        threshold: Show the order that a snapshot with this threshold learns, instead of
            what the rule of `neurosnap.poc.learning.relation_rule` finds.
        names: Of the sensors; if None, those of the data frame, or ``s0``, ``s1`` and
            so on.
        every: Whether to show relations that follow from others, too.
        premises: Look for up to so many literals that together imply another; 1: none.
        lag: Look for what comes in up to so many rows, which are taken for ticks in
            their order; 0: only for what holds at once.

    Returns:
        A data frame of pandas where that is installed, else `Relations`; the strongest
        relation comes first. The columns are the attributes of `Relation`, and `attrs`
        has those of `Relations`.

    Raises:
        ShapeError: `data` has not two axes, or there is not one name a column.
        InvalidValueError: An entry is not 0, 1 or unknown, or the threshold is out of
            range, or so is a limit.
    """
    limits = Limits.of(premises, lag)
    columns = data if isinstance(data, Columns) else Columns.of(data, names)
    fitted = None if threshold is None else EmpiricalSnapshot.fit(columns, threshold)
    rows = tabulate(columns, fitted, every, limits=limits)
    try:
        pandas = import_module("pandas")
    except ImportError:
        return rows
    fields = Relation.__dataclass_fields__
    frame = pandas.DataFrame(
        {name: [getattr(row, name) for row in rows] for name in fields}
    )
    frame.attrs.update(
        {name: getattr(rows, name) for name in ("made", "kept", "left", "lag")}
    )
    return frame


def _rank(row: Relation) -> tuple[bool, float, str, str, str]:
    """Return what rows are sorted by."""
    return row.last_failure is not None, row.at_most, row.a, row.b, row.relation


class _Found:
    """Makes rows of pairs and their codes."""

    def __init__(
        self,
        columns: Columns,
        counts: PairCounts,
        codes: NDArray[np.uint8],
        known: NDArray[np.bool_],
    ) -> None:
        self._columns, self._counts, self._codes = columns, counts, codes
        self._known = known
        self._at_most = promises(counts, codes)
        self._names = columns.sensorium.names

    def every(self) -> Iterator[Relation]:
        """Yield a row for every pair that has a code."""
        i, j = np.tril_indices(len(self._names), -1)
        some = self._codes.nonzero()[0]
        for first, second in zip(i[some].tolist(), j[some].tolist(), strict=True):
            yield self._row(2 * first, 2 * second)

    def covers(self) -> Iterator[Relation]:
        """Yield a row for every cover, and some that tell all copies."""
        graph = PocGraph.of_rows(rows_of(self._codes, len(self._names)))
        head = graph.representative
        members: dict[int, list[int]] = {}
        for literal, first in enumerate(head.tolist()):
            members.setdefault(first, []).append(literal)
        for group in members.values():
            if len(group) > 1 and group[0] % 2 == 0:
                yield from self._copies(group)
        for low, high in np.argwhere(graph.hasse()).tolist():
            if low <= high ^ 1 and head[low] != head[high]:
                rows = self._direct(members[int(head[low])], members[int(head[high])])
                yield from sorted(rows, key=_rank)[:1]

    def _copies(self, group: list[int]) -> Iterator[Relation]:
        """Yield rows that make of a class of literals one: as few, from its first on.

        Noise may bind literals to a class that are no copies: ``a -> c -> b`` and ``a``
        nearly the same as ``b``. These rows follow.
        """
        left, waiting = set(group), []
        while left:
            waiting.append(min(left))
            left.discard(waiting[-1])
            while waiting:
                literal = waiting.pop(0)
                for other in sorted(left):
                    if self._is_copy(literal, other):
                        left.discard(other)
                        waiting.append(other)
                        if not self._known[pair_of(literal, other)]:
                            yield self._row(literal, other)
        for k, low in enumerate(group):
            for high in group[k + 1 :]:
                new = self._code(low, high) and not self._known[pair_of(low, high)]
                if new and not self._is_copy(low, high):
                    yield self._row(low, high)

    def _direct(self, low: list[int], high: list[int]) -> Iterator[Relation]:
        """Yield the rows of all edges from one class to another."""
        for a in low:
            for b in high:
                if leads(self._code(a, b), a, b) and not self._known[pair_of(a, b)]:
                    yield self._row(a, b)

    def _code(self, a: int, b: int) -> int:
        """Return what relates two literals; 0 for nothing, or both of one sensor."""
        return int(self._codes[pair_of(a, b)]) if a >> 1 != b >> 1 else 0

    def _is_copy(self, a: int, b: int) -> bool:
        """Return whether two literals are the same, or nearly."""
        return self._code(a, b) == (3 if (a ^ b) & 1 == 0 else 12)

    def _row(self, a: int, b: int) -> Relation:
        """Return the row of two related sensors, given by any of their literals."""
        i, j = max(a, b) >> 1, min(a, b) >> 1
        pair, columns = pair_of(a, b), self._columns
        code = int(self._codes[pair])
        counts = PairCounts(*(each[:, pair] for each in self._counts))
        bits = columns.on[i], columns.off[i], columns.on[j], columns.off[j]
        tests, most = _TESTS[code][2:], float(self._at_most[pair])
        kind, *names, _ = at_once(code, (a, b), self._names)
        return _with_evidence(kind, names, counts, bits, tests, most)

    def beyond(self, one: Beyond) -> Relation:
        """Return the row of what is beyond pairs at one instant."""
        both = " ∧ ".join(map(self._name, one.premises))
        said: Said = "implies", both, self._name(one.conclusion), False
        kind, a, b, lasting = in_time(one.lag, self._names) if one.lag else said
        tests = [(0, 2), (0, 1)] if lasting else [(0, 1), (0, 2)]
        bits = one.bits(self._columns)
        row = _with_evidence(kind, (a, b), one.counts, bits, tests, one.most)
        soonest, usual, _ = one.waits
        return replace(
            row,
            premises=len(one.premises),
            within=one.lag.ticks if one.lag else 0,
            lasting=lasting,
            soonest=soonest,
            usual=usual,
            explains=one.explains,
        )

    def _name(self, literal: int) -> str:
        return self._names[literal >> 1] + "*" * (literal & 1)


def _with_evidence(
    kind: Kind,
    names: Sequence[str],
    counts: PairCounts,
    bits: Four,
    tests: Sequence[tuple[int, int]],
    most: float,
) -> Relation:
    """Return a row of what was counted of two readings.

    Args:
        kind: What it is called if it never failed.
        names: Of both.
        counts: ``(4,)``, of the joint readings.
        bits: ``(W,)`` each: where the first is on, and off; the same of the second.
        tests: Of its two tests the joint readings that fail and that pass.
        most: What it promises.
    """
    a, a_off, b, b_off = bits
    joint = [a & b, a & b_off, a_off & b, a_off & b_off]
    ticks, runs = (each.tolist() for each in counts)
    failures = {failed for failed, _ in tests}
    wrong, total = sum(ticks[cell] for cell in failures), sum(ticks)
    tested = [runs[failed] + runs[passed] for failed, passed in tests]
    failed = [runs[failed] for failed, _ in tests]
    last = max(span(joint[cell])[1] for cell in failures)
    firsts = [first for first in (span(each)[0] for each in joint) if first]
    return Relation(
        relation=cast("Kind", f"nearly {kind}") if wrong else kind,
        a=names[0],
        b=names[1],
        tested=tested[0],
        failed=failed[0],
        tested_back=tested[1],
        failed_back=failed[1],
        share=1 - wrong / total if total else 1.0,
        at_most=most,
        since=last + 1 if last else min(firsts, default=0),
        last_failure=last or None,
        ticks=total,
    )
