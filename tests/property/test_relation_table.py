"""The table of relations equals one computed row by row."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.relation_table import Relation, tabulate
from tests.support.hypothesis_settings import examples
from tests.support.strategies import tables


def fails(row: Relation, a: float, b: float) -> tuple[bool, bool]:
    """Whether two readings are a failure of the first test, and of the second."""
    on, other = a == 1, b == 1
    match row.relation.removeprefix("nearly "):
        case "implies":
            return (on and not other,) * 2
        case "never together":
            return (on and other,) * 2
        case "at least one of":
            return (not on and not other,) * 2
        case "the same":
            return on and not other, other and not on
        case _:
            return on and other, not on and not other


def is_put_to(row: Relation, a: float, b: float) -> tuple[bool, bool]:
    """Whether two readings put a relation to its first test, and to its second."""
    on, other = a == 1, b == 1
    match row.relation.removeprefix("nearly "):
        case "implies":
            return on, not other
        case "at least one of":
            return not on, not other
        case "opposite":
            return on, not on
        case _:
            return on, other


def by_hand(row: Relation, table: NDArray[np.float64]) -> tuple[object, ...]:
    tested, failed, last, wrong, total = [0, 0], [0, 0], 0, 0, 0
    before: tuple[float, ...] = ()
    for tick, values in enumerate(table.tolist(), start=1):
        now = values[int(row.a[1:])], values[int(row.b[1:])]
        if np.isnan(now).any():
            before = ()
            continue
        total += 1
        bad = fails(row, *now)
        if any(bad):
            wrong, last = wrong + 1, tick
        if now != before:
            for side, (there, broken) in enumerate(
                zip(is_put_to(row, *now), bad, strict=True)
            ):
                tested[side] += there
                failed[side] += broken
        before = now
    return (*tested, *failed, last or None, total, 1 - wrong / total if total else 1.0)


@examples(40)
@given(tables(most=4, longest=250), st.sampled_from([0.25, 0.1, 0.02]))
def test_every_figure_is_that_of_the_rows(
    table: NDArray[np.float64], threshold: float
) -> None:
    columns = Columns.of(table)
    snapshot = EmpiricalSnapshot.fit(columns, threshold)
    for row in tabulate(columns, snapshot, every=True):
        told = row.tested, row.tested_back, row.failed, row.failed_back
        more = row.last_failure, row.ticks, pytest.approx(row.share)
        assert by_hand(row, table) == (*told, *more)
        assert row.relation.startswith("nearly ") == (row.last_failure is not None)


@examples(40)
@given(tables(most=6, longest=250, unknown=False), st.sampled_from([0.25, 0.05]))
def test_what_is_a_row_follows_from_the_covers_and_nothing_else_does(
    table: NDArray[np.float64], threshold: float
) -> None:
    columns = Columns.of(table)
    snapshot = EmpiricalSnapshot.fit(columns, threshold)
    whole = {row.sentence for row in tabulate(columns, snapshot, every=True)}
    covers = tabulate(columns, snapshot)
    assert {row.sentence for row in covers} <= whole
    assert len(covers) == len({row.sentence for row in covers})
    assert closed(covers) == closed(tabulate(columns, snapshot, every=True))


def closed(rows: list[Relation]) -> set[tuple[str, str]]:
    """All implications between literals that follow from rows, going step by step."""
    leads: set[tuple[str, str]] = set()
    for row in rows:
        a, b = row.a, row.b
        edges = {
            "implies": [(a, b)],
            "never together": [(a, f"{b}*")],
            "at least one of": [(f"{a}*", b)],
            "the same": [(a, b), (b, a)],
            "opposite": [(a, f"{b}*"), (f"{b}*", a)],
        }[row.relation.removeprefix("nearly ")]
        leads |= {*edges, *((other(y), other(x)) for x, y in edges)}
    while more := {(x, z) for x, y in leads for w, z in leads if w == y} - leads:
        leads |= more
    return {(x, y) for x, y in leads if x != y}


def other(literal: str) -> str:
    return literal[:-1] if literal.endswith("*") else f"{literal}*"


@examples(40)
@given(tables(most=4, longest=250))
def test_what_never_failed_holds_since_it_was_first_seen(
    table: NDArray[np.float64],
) -> None:
    for row in tabulate(Columns.of(table), every=True):
        known = ~np.isnan(table[:, [int(row.a[1:]), int(row.b[1:])]]).any(axis=1)
        first = int(known.argmax()) + 1
        assert row.since == (row.last_failure + 1 if row.last_failure else first)


def test_strongest_first() -> None:
    bits = np.random.default_rng(0).random((4000, 3)) < 0.4
    often, rarely = bits[:, 0], bits[:, 0] & bits[:, 1] & bits[:, 2]
    readings = np.stack([often, rarely, bits[:, 1], bits[:, 2]], axis=1)
    rows = tabulate(Columns.of(readings, ["a", "all", "b", "c"]))
    assert {row.sentence for row in rows} == {
        "all implies a",
        "all implies b",
        "all implies c",
    }
    assert [row.at_most for row in rows] == sorted(row.at_most for row in rows)
