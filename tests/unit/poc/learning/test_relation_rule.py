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
from neurosnap.poc.learning.beyond_pairs import Limits
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.pair_occasions import PairCounts
from neurosnap.poc.learning.relation_rule import promises, spectra_of
from neurosnap.poc.learning.relation_table import Relation, tabulate
from tests.support.planted import planted


def found(rows: list[Relation]) -> dict[str, list[tuple[int, int]]]:
    """Rows by the name of their relation, nearly or not, as pairs of columns."""
    by_name: dict[str, list[tuple[int, int]]] = {}
    for row in rows:
        pair = int(row.a[1:]), int(row.b[1:])
        by_name.setdefault(row.relation.removeprefix("nearly "), []).append(pair)
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
        kinds = ["implies", "never together", "the same"]
        assert set(rows) <= set(kinds)
        implied, excluded, copies = (rows.get(kind, []) for kind in kinds)
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
    turned = [(value - k / 20) % 1 < 0.5 for k in range(10)]
    rows = tabulate(Columns.of(np.stack(turned, axis=1)), limits=Limits(1, 0))
    beside = {(f"s{k}", f"s{k + 1}", "nearly the same") for k in range(9)}
    told = [(row.a, row.b, row.relation) for row in rows]
    assert set(told) == beside | {("s0", "s9", "nearly opposite")}
    assert len(told) == 10


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
    assert {(row.a, row.b) for row in rows if row.relation.endswith("implies")} == {
        (f"x{a}", f"x{b}") for a, b in wanted.covers
    }
    framed = type("Framed", (dict,), {"attrs": {}})
    learned = neurosnap.implications(wanted.table, threshold=0.01, every=True)
    assert len(learned) > len(rows)
    monkeypatch.setitem(sys.modules, "pandas", SimpleNamespace(DataFrame=framed))
    frame = neurosnap.implications(wanted.table, names=names)
    assert list(frame) == [field.name for field in dataclasses.fields(Relation)]
    assert frame["a"] == [row.a for row in rows]
    counted = {"made": rows.made, "kept": rows.kept, "left": 0, "lag": 32}
    assert frame.attrs == counted
    assert rows.made > 30


def test_what_is_told_of_one_half_holds_in_the_other() -> None:
    held = Counter[str]()
    for seed in range(3):
        wanted = planted(seed, 0.005)
        first, second = np.split(wanted.table, 2)
        for row in tabulate(Columns.of(first), every=True):
            a, b = second[:, int(row.a[1:])], second[:, int(row.b[1:])]
            wrong, tests = against(row, a, b)
            held["told"] += 1
            held["as promised"] += wrong / min(tests) <= row.at_most
    assert held["told"] > 300
    assert held["as promised"] >= 0.95 * held["told"]
    whole = tabulate(Columns.of(planted(3, 0.005).table))
    assert whole.made > 100
    assert whole.kept >= 0.9 * whole.made


def against(
    row: Relation, a: NDArray[np.bool_], b: NDArray[np.bool_]
) -> tuple[int, tuple[int, int]]:
    """At how many ticks a relation failed, and those of its two tests."""
    kind = row.relation.removeprefix("nearly ")
    if kind == "never together":
        return int((a & b).sum()), (int(a.sum()), int(b.sum()))
    wrong = a ^ b if kind == "the same" else a & ~b
    return int(wrong.sum()), (int(a.sum()), int((~b).sum()))


def test_a_promise_that_was_not_kept_is_counted() -> None:
    chance = np.random.default_rng(4)
    a = chance.random((2, 1024)) < 0.4
    b = a | (chance.random((2, 1024)) < 0.3)
    b[1] ^= chance.random(1024) < 0.4  # the second half is another machine
    rows = tabulate(Columns.of(np.stack([a.ravel(), b.ravel()], axis=1)))
    assert (rows.made, rows.kept, list(rows)) == (1, 0, [])


def test_what_never_failed_comes_first_however_little_it_promises() -> None:
    """A stop was pressed eight times, and the pump, which is fast, never ran then."""
    chance = np.random.default_rng(7)
    stop = np.arange(4096) % 512 < 12
    pump, valve = chance.random((2, 4096)) < 0.5
    pump &= ~stop
    table = np.stack([stop, pump, valve, valve ^ (chance.random(4096) < 0.01)], axis=1)
    first, second = tabulate(Columns.of(table))
    assert (first.sentence, first.failed) == ("s0 and s1: never together", 0)
    assert (second.relation, second.at_most < first.at_most) == (
        "nearly the same",
        True,
    )
    assert first.at_most > 0.15


def test_what_is_known_is_no_promise() -> None:
    value = np.random.default_rng(8).random(4096)
    columns = Columns.of(np.stack([value < 0.3, value < 0.5], axis=1))
    assert [tabulate(columns, known=known).made for known in ([], [(0, 2)])] == [1, 0]


@pytest.mark.parametrize(
    ("ticks", "runs"),
    [
        ((30, 0, 40, 90), (30, 0, 40, 90)),
        ((300, 0, 0, 900), (30, 0, 0, 90)),
        # Flips: occasions that fail are as short as can be.
        ((900, 60, 10, 900), (90, 60, 10, 90)),
        # One long failure is one.
        ((900, 60, 10, 900), (90, 2, 10, 90)),
    ],
)
def test_a_promise_is_what_a_score_test_still_takes_for_the_same(
    ticks: tuple[int, ...], runs: tuple[int, ...]
) -> None:
    counts = PairCounts(*(np.array([n], np.uint32).T for n in (ticks, runs)))
    worse = 0.0
    for passes in (0, 3):
        share = ticks[1] / (ticks[1] + ticks[passes])
        worth: float = runs[1] + runs[passes]
        if share:
            worth = min(worth, runs[1] / share)
        again = np.linspace(share + 1e-9, 1, 100_001)
        both = (share + again) / 2
        score = worth * (again - share) ** 2 / (2 * both * (1 - both) + 1e-12)
        worse = max(worse, float(again[score <= 1.645**2].max()))
    promised = promises(counts, np.array([1], np.uint8))
    assert promised.tolist() == pytest.approx([worse], abs=1e-4)


def test_ticks_are_worth_what_shifts_of_a_sensor_make_of_them() -> None:
    """The sum over all lags, one by one, to either side."""
    chance = np.random.default_rng(6)
    slow = np.repeat(chance.random(40) < 0.5, 32)
    table = np.stack([slow, chance.random(1280) < 0.3, np.arange(1280) % 10 < 4])
    columns = Columns.of(table.T)
    apart = table - table.mean(axis=1, keepdims=True)
    lags = [
        (apart[:, : 1280 - lag] * apart[:, lag:]).sum(axis=1) / (apart**2).sum(axis=1)
        for lag in [*range(1280), *range(1, 1280)]
    ]
    expected = np.maximum(np.transpose(lags) @ np.array(lags), 1)
    spectra = spectra_of(columns.on, columns.off)
    assert np.maximum(spectra @ spectra.T, 1) == pytest.approx(expected, rel=1e-3)
