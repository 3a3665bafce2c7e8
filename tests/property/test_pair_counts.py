"""Counts, columns, histories and fitted snapshots agree tick by tick."""

import itertools
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.columns import Columns, GrowingColumns, span
from neurosnap.poc.learning.empirical import EmpiricalSnapshot
from neurosnap.poc.learning.pair_occasions import count_pairs
from neurosnap.poc.learning.pairs import pair_of
from neurosnap.poc.learning.reading_history import History
from neurosnap.sensorium import Sensorium
from tests.support.hypothesis_settings import examples
from tests.support.strategies import tables

Table: TypeAlias = NDArray[np.float64]


def runs_of(table: Table, i: int, j: int) -> dict[tuple[int, int], list[int]]:
    """The lengths of the runs of each joint reading of two sensors, one by one."""
    found: dict[tuple[int, int], list[int]] = {}
    before = None
    for row in table.tolist():
        if np.isnan([row[i], row[j]]).any():
            before = None
            continue
        now = (int(row[i]), int(row[j]))
        if now == before:
            found[now][-1] += 1
        else:
            found.setdefault(now, []).append(1)
        before = now
    return found


@examples(60)
@given(tables())
def test_ticks_and_occasions_are_those_of_the_runs(table: Table) -> None:
    columns = Columns.of(table)
    counts, half = count_pairs(columns), columns.on.shape[1] // 2
    again = count_pairs(columns, first=(half, count_pairs(columns.until(half))))
    assert np.array_equal(again, counts)
    pairs = [(i, j) for i in range(table.shape[1]) for j in range(i)]
    for pair, (i, j) in enumerate(pairs):
        runs = runs_of(table, i, j)
        for place, readings in enumerate([(1, 1), (1, 0), (0, 1), (0, 0)]):
            lengths = runs.get(readings, [])
            assert counts.ticks[place, pair] == sum(lengths)
            assert counts.occasions[place, pair] == len(lengths)


@examples(60)
@given(tables(longest=700), st.sampled_from([0.25, 0.1, 0.03, 0.01]))
def test_a_fitted_snapshot_is_one_that_saw_row_after_row(
    table: Table, threshold: float
) -> None:
    walked = EmpiricalSnapshot(table.shape[1], threshold)
    for row in table:
        known = ~np.isnan(row)
        walked.observe(np.nan_to_num(row), None if known.all() else known)
    assert EmpiricalSnapshot.fit(table, threshold).to_bytes() == walked.to_bytes()


@examples(30)
@given(tables(longest=200), st.data())
def test_columns_do_not_depend_on_how_rows_came(
    table: Table, data: st.DataObject
) -> None:
    whole = Columns.of(table)
    growing = GrowingColumns(Sensorium.of(table.shape[1]))
    left = table
    while len(left):
        taken = data.draw(st.integers(1, len(left)))
        part, left = left[:taken], left[taken:]
        growing.extend(part == 1, ~np.isnan(part))
    pieces = growing.columns()
    assert pieces.ticks == whole.ticks == len(table)
    np.testing.assert_array_equal(pieces.on, whole.on)
    np.testing.assert_array_equal(pieces.off, whole.off)
    for sensor in range(table.shape[1]):
        assert whole.reading(sensor).tolist() == (table[:, sensor] == 1).tolist()
        assert whole.known(sensor).tolist() == (table[:, sensor] >= 0).tolist()


@pytest.mark.parametrize("rows", [4095, 4096, 4097, 9000])
def test_many_rows_are_packed_in_order(rows: int) -> None:
    table = np.random.default_rng(rows).integers(0, 2, (rows, 2)).astype(np.bool_)
    growing = GrowingColumns(Sensorium.of(2))
    for row in table:
        growing.append(row)
    columns = growing.columns()
    assert columns.reading(0).tolist() == table[:, 0].tolist()
    assert columns.reading(1).tolist() == table[:, 1].tolist()


@examples(30)
@given(tables(most=3, longest=300))
def test_spans_are_the_first_and_the_last_tick_of_a_joint_reading(
    table: Table,
) -> None:
    columns, literals = Columns.of(table), range(2 * table.shape[1])
    for a, b in itertools.product(literals, repeat=2):
        here = (table[:, a // 2] == 1 - a % 2) & (table[:, b // 2] == 1 - b % 2)
        ticks = here.nonzero()[0]
        wanted = (int(ticks[0]) + 1, int(ticks[-1]) + 1) if ticks.size else (0, 0)
        assert span(columns.ticks_of(a) & columns.ticks_of(b)) == wanted


SENSORS, LENGTH = 3, 64
TICKS = st.lists(
    st.lists(st.sampled_from([0.0, 1.0, float("nan")]), min_size=3, max_size=3),
    min_size=1,
    max_size=200,
)
CELLS = {(0, 0): 0, (0, 1): 1, (1, 0): 2, (1, 1): 3}


@given(TICKS)
def test_they_are_those_of_the_last_ticks(rows: list[list[float]]) -> None:
    counts = count_pairs(Columns.of(rows[-LENGTH:])).occasions
    links = [
        (a, b)
        for a in range(2 * SENSORS)
        for b in range(2 * SENSORS)
        if a >> 1 != b >> 1
    ]
    sources, targets = np.array(links).T
    history = History(SENSORS, LENGTH)
    for row in rows:
        history.record(np.array(row) == 1, ~np.isnan(row))
    held = history.occasions_held(sources, targets)

    def runs(a: int, b: int) -> int:
        """Occasions with both literals on, as the table counts them."""
        if a < b:
            a, b = b, a
        return int(counts[CELLS[a & 1, b & 1], pair_of(a, b)])

    expected = [min(runs(a, b), runs(a ^ 1, b ^ 1)) for a, b in links]
    assert held.tolist() == expected
