"""Planted relations are all found, and no chance relations are."""

import dataclasses
import itertools
import sys
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

import neurosnap
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.relation_table import Relation, tabulate
from tests.support.planted import planted


def found(rows: list[Relation]) -> dict[str, list[tuple[int, int]]]:
    """Rows by the name of their relation, as pairs of columns."""
    by_name: dict[str, list[tuple[int, int]]] = {}
    for row in rows:
        pair = int(row.a[1:]), int(row.b[1:])
        by_name.setdefault(row.relation, []).append(pair)
    return by_name


@pytest.mark.parametrize(
    ("noise", "hold"),
    [
        *itertools.product((0, 0.001, 0.002, 0.005, 0.01, 0.02), (0, 0.5)),
        *itertools.product((0, 0.005, 0.02), (0.9, 0.98)),
    ],
)
def test_what_is_planted_is_found_whole_or_of_slow_sensors_less_and_nothing_false(
    noise: float, hold: float
) -> None:
    wanted = planted(0, noise, hold=hold)
    for every in False, True:
        rows = found(tabulate(Columns.of(wanted.table), every=every))
        kinds = ["implies", "never together", "the same", "nearly the same"]
        assert set(rows) <= set(kinds)
        implied, excluded, *same = (rows.get(kind, []) for kind in kinds)
        copies = [pair for pairs in same for pair in pairs]
        for pairs, true in (
            (implied, wanted.implied if every else wanted.covers),
            ([frozenset(pair) for pair in excluded], wanted.exclusions),
            ([frozenset(pair) for pair in copies], wanted.copies),
        ):
            if hold < 0.9:
                assert Counter(pairs) == Counter(true)
            elif every:
                assert set(pairs) <= true


@pytest.mark.parametrize("hold", [0, 0.9, 0.99])
def test_independent_sensors_have_no_relation(hold: float) -> None:
    chance = np.random.default_rng(1)
    rates = chance.uniform(0.005, 0.995, 120)
    fresh = chance.random((4000, 120)) >= hold
    fresh[0] = True
    last = np.maximum.accumulate(np.where(fresh, np.arange(4000)[:, None], 0))
    drawn = chance.random((4000, 120)) < rates
    assert tabulate(Columns.of(np.take_along_axis(drawn, last, 0)), every=True) == []


def test_copies_of_copies_may_be_opposites() -> None:
    """Arcs of half a circle, each turned a little further: no order can hold these."""
    value = np.random.default_rng(5).random(5000)
    turned = [(value - k / 40) % 1 < 0.5 for k in range(20)]
    rows = tabulate(Columns.of(np.stack(turned, axis=1)))
    beside = {(f"s{k}", f"s{k + 1}", "nearly the same") for k in range(19)}
    told = [(row.a, row.b, row.relation) for row in rows]
    assert set(told) == beside | {("s0", "s19", "nearly opposite")}
    assert len(told) == 20


VALUE, *NOISE = np.random.default_rng(3).random((3, 5000))
NIGHT = np.arange(5000) // 1000


@pytest.mark.parametrize(
    ("columns", "told"),
    [
        # Bins that differ seldom are no copies.
        ([VALUE < 0.5, VALUE < 0.51], ["s0 implies s1"]),
        # An opposite that is noisy is told as that.
        (
            [VALUE < 0.3, (VALUE >= 0.3) ^ (NOISE[0] < 0.002)],
            ["s0 and s1: nearly opposite"],
        ),
        # Copies do not hide what their original implies.
        (
            [
                *(bound > VALUE for bound in (0.3, 0.5, 0.7)),
                *((VALUE < 0.5) ^ (noise < 0.005) for noise in NOISE),
            ],
            [
                *("s0 implies s1", "s1 implies s2"),
                *("s1 and s3: nearly the same", "s1 and s4: nearly the same"),
            ],
        ),
        # A lamp and a heater that were on once, at the same time, for long.
        ([(NIGHT == 1) | (NIGHT == 2)] * 2, []),
        # Too little to say anything.
        *(([np.ones(rows, np.bool_)] * 3, []) for rows in (0, 1, 2)),
    ],
)
def test_what_is_told_of_small_tables(
    columns: list[NDArray[np.bool_]], told: list[str]
) -> None:
    rows = tabulate(Columns.of(np.stack(columns, axis=1)))
    assert Counter(row.sentence for row in rows) == Counter(told)


def test_a_table_in_python_is_a_data_frame_if_it_can_be_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wanted = planted(0, 0.002, sensors=92, rows=2000)
    names = [f"x{k}" for k in range(92)]
    monkeypatch.setitem(sys.modules, "pandas", None)
    rows = neurosnap.implications(wanted.table, names=names)
    assert {(row.a, row.b) for row in rows if row.relation == "implies"} == {
        (f"x{a}", f"x{b}") for a, b in wanted.covers
    }
    learned = neurosnap.implications(wanted.table, threshold=0.01, every=True)
    assert len(learned) > len(rows)
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=dict))
    frame = neurosnap.implications(wanted.table, names=names)
    assert list(frame) == [field.name for field in dataclasses.fields(Relation)]
    assert frame["a"] == [row.a for row in rows]
