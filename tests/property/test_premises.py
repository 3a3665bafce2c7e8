"""What several literals imply together: the search against all sets, one by one."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from neurosnap.poc.learning.beyond_pairs import Limits
from neurosnap.poc.learning.columns import Columns
from neurosnap.poc.learning.premises import Exclusion, _covers, find_exclusions
from neurosnap.poc.learning.relation_rule import evidence_for, exclusions
from neurosnap.poc.learning.relation_table import tabulate
from neurosnap.poc.order.literal_sets import to_words
from tests.support.hypothesis_settings import examples

Flags = NDArray[np.bool_]
ROWS = 600


def drawn(seed: int, sensors: int, noise: float, unknown: float = 0) -> Any:
    """Return a table in which some sensors follow from two or three others."""
    chance = np.random.default_rng(seed)
    table = chance.random((ROWS, sensors)) < chance.uniform(0.3, 0.7, sensors)
    for size in 2, 3:
        *given_, last = chance.permutation(sensors)[: size + 1]
        wanted = chance.random(size) < 0.5
        table[:, last] |= (table[:, given_] == wanted).all(axis=1)
    table ^= chance.random(table.shape) < noise
    return np.where(chance.random(table.shape) < unknown, np.nan, table)


def literal_ticks(table: Any, literal: int) -> Flags:
    ticks: Flags = table[:, literal >> 1] == 1 - (literal & 1)
    return ticks


def by_one(table: Any, size: int) -> dict[tuple[int, ...], float]:
    """Return the least evidence of every set of literals of which each counts."""
    sensors = table.shape[1]
    found = {}
    for several in itertools.combinations(range(sensors), size):
        for signs in itertools.product((0, 1), repeat=size):
            literals = tuple(
                2 * k + sign for k, sign in zip(several, signs, strict=True)
            )
            least = np.inf
            for two in itertools.combinations(literals, 2):
                rest = np.ones(len(table), np.bool_)
                for other in set(literals) - set(two):
                    rest &= literal_ticks(table, other)
                bits = [
                    to_words((literal_ticks(table, k) & rest)[np.newaxis])[0]
                    for one in two
                    for k in (one, one ^ 1)
                ]
                judged = exclusions([(bits[0], bits[1], bits[2], bits[3])])
                if not judged.h[0] >= 0.5:
                    least = 0
                least = min(least, judged.evidence[0])
            found[literals] = float(least)
    return found


@examples(6)
@given(
    st.integers(0, 10_000),
    st.sampled_from([0, 0.01]),
    st.sampled_from([0, 0.02]),
)
def test_no_set_is_told_that_one_by_one_is_not_and_none_that_is_sure_is_missed(
    seed: int, noise: float, unknown: float
) -> None:
    table = drawn(seed, 6, noise, unknown)
    sets, left = find_exclusions(Columns.of(table), 3, np.eye(12, dtype=np.bool_))
    told = {one.literals: one.evidence for one in sets}
    assert not left
    for size, count in (3, 20), (4, 15):
        needed = evidence_for((1 << size) * count)
        every = by_one(table, size)
        mine = {k: told[k] for k in told if len(k) == size}
        assert mine == pytest.approx({k: every[k] for k in mine})
        assert all(evidence >= needed for evidence in mine.values())
        # The search goes by what ticks are worth in the whole table.
        sure = {k for k, evidence in every.items() if evidence >= 1.5 * needed}
        assert sure <= mine.keys()


def test_of_sets_that_follow_from_others_none_is_told() -> None:
    """The sensor 4 implies 0; so what 0 and 1 imply, 4 and 1 do as well."""
    chance = np.random.default_rng(1)
    table = chance.random((2000, 6)) < 0.5
    table[:, 2] |= table[:, 0] & table[:, 1]
    table[:, 4] = table[:, 0] & (chance.random(2000) < 0.7)
    reach = np.eye(12, dtype=np.bool_)
    sets, _ = find_exclusions(Columns.of(table), 2, reach)
    assert {one.literals for one in sets} == {(0, 2, 5), (2, 5, 8)}
    reach[8, 0] = reach[1, 9] = True
    sets, _ = find_exclusions(Columns.of(table), 2, reach)
    assert [one.literals for one in sets] == [(0, 2, 5)]


def test_a_parity_is_told_though_no_two_sensors_have_a_relation() -> None:
    chance = np.random.default_rng(2)
    table = chance.random((3000, 12)) < 0.5
    table[:, 7] = table[:, 3] ^ table[:, 5]
    rows = tabulate(Columns.of(table), limits=Limits(2, 0))
    # Each literal of the four sets may be the one that is implied.
    never = {
        frozenset(each) for each in ((6, 10, 14), (6, 11, 15), (7, 10, 15), (7, 11, 14))
    }
    place = {f"s{k}{star}": 2 * k + bool(star) for k in (3, 5, 7) for star in ("", "*")}
    told = [[*row.a.split(" ∧ "), row.b] for row in rows]
    assert len(told) == 4
    assert {frozenset((place[a], place[b], place[c] ^ 1)) for a, b, c in told} == never


@pytest.mark.parametrize("mutual", [False, True])
@pytest.mark.parametrize(
    ("failed", "left"),
    [
        ((False, False), [0]),
        ((True, True), [0]),
        ((True, False), [0, 1]),  # what never failed follows from nothing that did
        ((False, True), [0]),
    ],
)
def test_what_never_failed_does_not_follow_from_what_did(
    failed: tuple[bool, bool], left: list[int], *, mutual: bool
) -> None:
    reach = np.eye(8, dtype=np.bool_)
    reach[4, 2], reach[2, 4] = True, mutual  # so the second set follows from the first
    literals = (0, 2, 7), (0, 4, 7)
    found = [Exclusion(literals[k], 9.0, failed[k]) for k in (0, 1)]
    if mutual and failed == (True, False):
        left = [1]  # and the first from the second
    assert [*_covers(found, reach)] == [found[k] for k in left]


def test_what_fails_hides_no_premise_that_explains_it() -> None:
    a, b, c, g, d = np.random.default_rng(0).random((5, 6000)) < [[0.5]] * 4 + [[0.2]]
    c |= np.where(a & b, ~d, (a ^ b) & d & g)
    sets, _ = find_exclusions(Columns.of(np.stack([a, b, c, d], 1)), 3, np.eye(8) > 0)
    assert [one.literals for one in sets] == [(0, 2, 5), (0, 2, 5, 7)]


def test_independent_sensors_have_no_premises() -> None:
    chance = np.random.default_rng(3)
    table = chance.random((3000, 60)) < chance.uniform(0.02, 0.98, 60)
    sets, _ = find_exclusions(Columns.of(table), 3, np.eye(120, dtype=np.bool_))
    assert sets == []


def test_a_row_says_what_its_premises_explain_and_how_often_it_was_tested() -> None:
    """The gate alone is not enough; on 60 occasions the belt was off."""
    chance = np.random.default_rng(4)
    belt, gate = (chance.random((2, 1200)) < 0.5).repeat(2, axis=1)
    counter = belt & gate | (chance.random(2400) < 0.2)
    readings = np.stack([belt, gate, counter], axis=1)
    columns = Columns.of(readings, ["belt", "gate", "counter"])
    (row,) = tabulate(columns, limits=Limits(2, 0))
    assert row.sentence == "belt ∧ gate implies counter"

    def occasions(ticks: Flags) -> int:
        return int(ticks[0]) + int((ticks[1:] & ~ticks[:-1]).sum())

    both, off = belt & gate, ~counter
    assert (row.tested, row.failed) == (occasions(both), 0)
    assert row.tested_back == occasions(off & ~both)
    alone = occasions(belt & ~gate & off), occasions(gate & ~belt & off)
    assert (row.premises, row.explains) == (2, min(alone))
    assert (row.ticks, row.since, row.last_failure) == (2400, 1, None)


def test_of_the_ways_to_say_it_one_is_told_that_was_tested_often() -> None:
    """On eight occasions b and c are on, and a as well; else it is never on with c."""
    chance = np.random.default_rng(5)
    a, b, c = chance.random((3, 4000)) < 0.4
    a &= ~c
    b &= ~c
    some = np.flatnonzero(c)[::200]
    a[some] = b[some] = True
    columns = Columns.of(np.stack([a, b, c], axis=1), [*"abc"])
    rows = [row for row in tabulate(columns, limits=Limits(2, 0)) if row.premises > 1]
    assert {row.sentence for row in rows} == {"a* ∧ c implies b*", "b* ∧ c implies a*"}
    assert all(row.at_most < 0.01 for row in rows)


def test_of_too_many_sensors_it_goes_on_from_pairs_that_fail() -> None:
    """Whichever of the three sensors comes last."""
    for order in itertools.permutations(range(3)):
        table = np.random.default_rng(6).random((3000, 12)) < 0.5
        a, b, last = (3 * place + 1 for place in order)
        table[:, last] |= table[:, a] & table[:, b]
        columns, reach = Columns.of(table), np.eye(24, dtype=np.bool_)
        work = 8 * 12 * (columns.on.shape[1] + 64) * 10
        sets, _ = find_exclusions(columns, 2, reach, work=work)
        assert [one.literals for one in sets] == [
            tuple(sorted((2 * a, 2 * b, 2 * last + 1)))
        ]
