"""Detects a settled wave for any order of reports, and rejects invalid ones."""

import random
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.cell_and_worker_base import DEEPEST, split_evenly
from neurosnap.protocol.wave_settling import Wave
from neurosnap.protocol.worker_kernels import carried, split
from tests.support.wave_messages import LARGEST, packed, share

DEEP = 5000


def report(
    cell: int,
    literals: Sequence[int],
    credit: Sequence[int],
    *,
    part: int = 0,
    hops: Sequence[int] | None = None,
    pulses: int = 0,
    wave: int = 1,
) -> wire.CellReport:
    return wire.CellReport(
        wave,
        cell,
        part,
        tuple(literals),
        tuple(hops if hops is not None else [0] * len(literals)),
        tuple(credit),
        pulses,
    )


def give(wave: Wave, report: wire.CellReport) -> None:
    wave.report(report, range(report.cell, report.cell + 1))


def signal_wave(*signal: int) -> Wave:
    return Wave(1, 0, "signal", len(signal), DEEP + 1, signal)


def reached(wave: Wave) -> list[int]:
    literals: list[int] = np.flatnonzero(wave.reached).tolist()
    return literals


@pytest.mark.parametrize(
    ("seeds", "credit"), [(1, 0), (2, 1), (3, 2), (4, 2), (5, 3), (1000, 10)]
)
def test_every_seed_gets_the_same_share_of_one(seeds: int, credit: int) -> None:
    wave = Wave(7, 3, "state", seeds, seeds)
    assert wave.start(5, 7) == wire.WaveStart(7, 3, "state", credit, 5, fence=7)
    assert wave.missing == Fraction(seeds, 2**credit) <= 1


def spread(seeds: int, chance: random.Random, most: int) -> list[wire.CellReport]:
    """Return the reports of a made-up wave: shares split until all are given back."""
    start = max(seeds - 1, 0).bit_length()
    shares = [start] * seeds
    reports: list[wire.CellReport] = []
    while shares:
        share = shares.pop(chance.randrange(len(shares)))
        back = [share]
        if len(reports) + len(shares) < most:
            back, on = [], split_evenly(share, chance.randint(1, 5))
            back.append(on.pop(0))
            shares += on
        cell = len(reports)
        reports.append(report(cell, [2 * cell], back, hops=[cell]))
    return reports


@given(
    seeds=st.integers(1, 9),
    seed=st.integers(0, 2**32),
    most=st.integers(0, 60),
    data=st.data(),
)
def test_it_settles_with_the_last_report_and_not_before_in_any_order(
    seeds: int, seed: int, most: int, data: st.DataObject
) -> None:
    reports = spread(seeds, random.Random(seed), most)
    wave = Wave(1, 0, "state", seeds, len(reports))
    for count, one in enumerate(data.draw(st.permutations(reports))):
        assert not wave.is_settled, count
        give(wave, one)
    assert wave.is_settled
    assert reached(wave) == [2 * cell for cell in range(len(reports))]
    assert wave.depth == len(reports) - 1


def test_shares_far_below_what_a_float_can_tell_are_counted() -> None:
    wave = signal_wave(0)
    deep = DEEP
    for cell in range(deep):
        give(wave, report(cell, [2 * cell], [cell + 1]))
        assert not wave.is_settled
    assert wave.missing == Fraction(1, 2**deep)
    give(wave, report(deep, [2 * deep], [deep]))
    assert wave.is_settled


def test_a_report_that_comes_again_changes_nothing() -> None:
    wave = signal_wave(0)
    for _ in range(3):
        give(wave, report(0, [0], [1], pulses=1))
    assert (wave.missing, wave.pulses) == (Fraction(1, 2), 1)
    give(wave, report(0, [], [1], part=1))
    assert wave.is_settled


def by_worker(literals: bytes, hops: bytes, pulses: int = 0) -> wire.WorkerReport:
    return wire.WorkerReport(1, 1, 0, literals, hops, (1,), pulses)


MUCH = "cellreport: must give back at most the credit given out, got cell 1, credit ["
WRONG = "cellreport: must report on wave 1, own literals, each once, got CellReport("
LARGE = "cellreport: must give back credit, and hold numbers up to 131072, got cell 1, "
BY_WORKER = "workerreport: "


@pytest.mark.parametrize(
    ("wrong", "what"),
    [
        (report(1, [2], [0]), MUCH),
        (report(1, [2], [1, 1]), MUCH),
        (report(1, [2], [2, 2, 70, 2]), MUCH),  # by a little
        (report(1, [2], [2], wave=2), WRONG),
        (report(1, [2], [2], wave=LARGEST), WRONG),
        (report(1, [4], [2]), WRONG),
        (report(1, [2, 2], [2]), WRONG),
        (report(1, [2], [2], hops=[]), WRONG),
        (report(0, [0], [2], part=1), WRONG),  # has fired before
        (report(1, [2], [LARGEST]), LARGE),
        (report(1, [2], [DEEPEST + 1]), LARGE),
        (report(1, [2], [40] * (DEEPEST + 1)), LARGE),
        (report(1, [2], []), LARGE),
        (report(1, [2], [1], pulses=LARGEST), LARGE),
        (report(1, [2], [1], part=LARGEST), LARGE),
        (by_worker(packed(2), packed(0)[:3]), "hops: must be four bytes a number"),
        (by_worker(packed(2)[:3], packed(0)), "literals: must be four bytes a number"),
        (by_worker(packed(2), packed(0, 0)), "must report on wave 1, own"),
        (by_worker(packed(2, 2), packed(0, 0)), "must report on wave 1, own"),
        (by_worker(packed(-1), packed(0)), "must report on wave 1, own"),
        (by_worker(packed(6), packed(0)), "must report on wave 1, own"),
        (by_worker(packed(2), packed(-1)), "must report on wave 1, own"),
        (by_worker(packed(2), packed(DEEPEST + 1)), "must give back credit, and hold"),
        (by_worker(packed(2), packed(0), LARGEST), "must give back credit, and hold"),
    ],
    ids=lambda given: f"{given!r:.70}" if not isinstance(given, str) else "",
)
def test_a_report_that_cannot_be_right_is_refused(
    wrong: wire.CellReport | wire.WorkerReport, what: str
) -> None:
    wave = signal_wave(0)
    give(wave, report(0, [0], [1], pulses=1))
    with pytest.raises(MessageError) as refused:
        if isinstance(wrong, wire.CellReport):
            give(wave, wrong)
        else:
            wave.report(wrong, range(1, 3))
    said = str(refused.value).removeprefix(BY_WORKER)
    assert said.startswith(what)
    assert len(said) < 350
    assert (wave.missing, reached(wave)) == (Fraction(1, 2), [0])
    assert (wave.depth, wave.pulses) == (0, 1)
    wave.report(by_worker(packed(2, 5), packed(0, 1)), range(1, 3))
    assert wave.is_settled
    assert (reached(wave), wave.depth) == ([0, 2, 5], 1)


EDGES: dict[int, list[int]] = {0: [2, 5], 2: [6], 4: [], 5: [], 6: []}
FIRST = report(0, [0], [3], pulses=2)


@pytest.mark.parametrize(
    ("signal", "reports", "silent"),
    [
        ((0, 6), [], [0, 3]),
        ((0, 6), [report(3, [6], [2])], [0]),
        ((0, 7), [report(3, [6], [3])], [0, 3]),  # its other literal is owed still
        ((0,), [FIRST], [1, 2]),
        ((0,), [FIRST, report(1, [2], [3], hops=[1], pulses=1)], [2, 3]),
        ((0, 4), [FIRST, report(2, [4], [1])], [1, 2]),
        (
            (0,),
            [FIRST, report(1, [2], [3]), report(2, [5], [3]), report(3, [6], [3])],
            [],
        ),
    ],
)
def test_what_was_to_fire_and_did_not_report_is_silent(
    signal: tuple[int, ...], reports: list[wire.CellReport], silent: list[int]
) -> None:
    wave = signal_wave(*signal)
    for one in reports:
        give(wave, one)
    assert wave.silent(signal, EDGES.__getitem__) == silent


@given(credit=st.integers(0, 10_000), parts=st.integers(1, 300))
def test_split_shares_add_up_to_the_whole(credit: int, parts: int) -> None:
    shares = split_evenly(credit, parts)
    assert len(shares) == parts
    assert sum(Fraction(1, 2**share) for share in shares) == Fraction(1, 2**credit)
    assert shares == sorted(shares)
    assert shares[-1] - shares[0] <= 1


@given(st.integers(0, 10_000), st.integers(1, 3000))
def test_a_worker_splits_credit_as_a_cell_does(credit: int, parts: int) -> None:
    larger, exponent = split(credit, parts)
    shares = [exponent - (number < larger) for number in range(parts)]
    assert shares == split_evenly(credit, parts)


@given(st.lists(st.integers(0, 90), min_size=1, max_size=60), st.integers(1, 40))
def test_a_worker_adds_shares_up_until_each_comes_once(
    exponents: list[int], room: int
) -> None:
    least = min(exponents)
    back = np.bincount(np.array(exponents) - least, minlength=room).astype(np.int64)
    total = sum(map(share, exponents))
    left = carried(back, least)
    assert list(left) == sorted(left)
    if total <= 1:
        assert sum(map(share, left)) == total
        assert len(set(left)) == len(left)
    else:  # no wave has so much, and what is said cannot be taken for less
        assert sum(map(share, left)) > 1
