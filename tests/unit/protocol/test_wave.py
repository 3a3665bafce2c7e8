"""When a wave has settled, in whatever order reports come, and what it refuses."""

import random
from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.wave import DEEPEST, Wave, split_evenly
from tests.support.wave_messages import LARGEST, packed


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
    return Wave(1, 0, "signal", len(signal), signal)


def test_it_settles_when_all_credit_is_back() -> None:
    wave = signal_wave(0)
    seen = [(wave.is_settled, wave.missing)]
    for one in (report(0, [0], [1], pulses=1), report(1, [2], [1], hops=[1])):
        give(wave, one)
        seen.append((wave.is_settled, wave.missing))
    assert seen == [(False, 1), (False, Fraction(1, 2)), (True, 0)]


def test_what_it_reached_is_what_was_reported() -> None:
    wave = signal_wave(0)
    give(wave, report(1, [3, 2], [2, 2], hops=[2, 1], pulses=4))
    give(wave, report(0, [0], [1], pulses=3))
    assert wave.hops == {0: 0, 2: 1, 3: 2}
    assert wave.depth == 2
    assert wave.pulses == 7


def test_a_wave_that_reached_nothing_yet_has_no_depth() -> None:
    assert signal_wave(0).depth == 0


@pytest.mark.parametrize(
    ("seeds", "credit"), [(1, 0), (2, 1), (3, 2), (4, 2), (5, 3), (1000, 10)]
)
def test_every_seed_gets_the_same_share_of_one(seeds: int, credit: int) -> None:
    wave = Wave(7, 3, "state", seeds)
    assert wave.start(5, 7) == wire.WaveStart(7, 3, "state", credit, 5, fence=7)
    assert wave.missing == Fraction(seeds, 2**credit) <= 1


def test_its_start_says_what_it_repeats() -> None:
    wave = Wave(7, 3, "signal", 2, (4, 9), repeats=6)
    assert wave.start(7, 7) == wire.WaveStart(7, 3, "signal", 1, 7, (4, 9), 6, 7)


def test_its_start_can_be_for_one_cell() -> None:
    start = Wave(7, 3, "signal", 2, (4, 9)).start(5, 6, cell=2)
    assert start == wire.WaveStart(7, 3, "signal", 1, 5, (4, 9), fence=6, cell=2)


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
    wave = Wave(1, 0, "state", seeds)
    for count, one in enumerate(data.draw(st.permutations(reports))):
        assert not wave.is_settled, count
        give(wave, one)
    assert wave.is_settled
    assert set(wave.hops) == {2 * cell for cell in range(len(reports))}


def test_shares_far_below_what_a_float_can_tell_are_counted() -> None:
    wave = signal_wave(0)
    deep = 5000
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


@pytest.mark.parametrize(
    "wrong",
    [
        report(1, [2], [0]),
        report(1, [2], [1, 1]),
        report(1, [2], [2, 2, 70, 2]),
    ],
    ids=["at once", "in parts", "by a little"],
)
def test_more_credit_than_was_given_is_refused(wrong: wire.CellReport) -> None:
    wave = signal_wave(0)
    give(wave, report(0, [0], [1], pulses=1))
    expected = r"^cellreport: must give back at most the credit given out, got cell"
    with pytest.raises(MessageError, match=expected + r" 1, credit \["):
        give(wave, wrong)
    assert (wave.missing, wave.hops, wave.pulses) == (Fraction(1, 2), {0: 0}, 1)
    give(wave, report(1, [2], [1]))
    assert wave.is_settled


@pytest.mark.parametrize(
    "wrong",
    [
        report(1, [2], [2], wave=2),
        report(1, [4], [2]),
        report(1, [2, 2], [2]),
        report(1, [2], [2], hops=[]),
        report(0, [0], [2], part=1),
    ],
    ids=["another wave", "another's literal", "twice", "no hops", "fired before"],
)
def test_a_report_that_cannot_be_right_is_refused(wrong: wire.CellReport) -> None:
    wave = signal_wave(0)
    give(wave, report(0, [0], [1]))
    expected = (
        r"^cellreport: must report on wave 1, own literals, each once, got CellReport\("
    )
    with pytest.raises(MessageError, match=expected):
        give(wave, wrong)
    assert (wave.missing, wave.hops) == (Fraction(1, 2), {0: 0})


def gives_back(credit: Sequence[int], **more: int) -> wire.CellReport:
    fields = {"part": 0, "pulses": 0, "wave": 1, **more}
    return wire.CellReport(
        cell=0, literals=(0,), hops=(0,), credit=tuple(credit), **fields
    )


@pytest.mark.parametrize(
    "report",
    [
        gives_back([LARGEST]),
        gives_back([DEEPEST + 1]),
        gives_back([40] * (DEEPEST + 1)),
        gives_back([]),
        gives_back([1], pulses=LARGEST),
        gives_back([1], part=LARGEST),
        gives_back([1], wave=LARGEST),
    ],
    ids=["far too deep", "too deep", "many", "none", "pulses", "part", "wave"],
)
def test_a_report_that_is_too_large_is_refused(report: wire.CellReport) -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    with pytest.raises(MessageError, match=r"^cellreport: must .*, got .{1,250}$"):
        give(wave, report)
    assert wave.missing == 1
    assert (wave.hops, wave.pulses) == ({}, 0)
    give(wave, gives_back([0]))
    assert wave.is_settled


def by_worker(literals: bytes, hops: bytes, **more: int) -> wire.WorkerReport:
    fields = {"wave": 1, "part": 0, "pulses": 0, **more}
    return wire.WorkerReport(
        worker=0, literals=literals, hops=hops, credit=(0,), **fields
    )


@pytest.mark.parametrize(
    "report",
    [
        by_worker(packed(0), packed(0)[:3]),
        by_worker(packed(0)[:3], packed(0)),
        by_worker(packed(0), packed(0, 0)),
        by_worker(packed(0, 0), packed(0, 0)),
        by_worker(packed(-1), packed(0)),
        by_worker(packed(4), packed(0)),
        by_worker(packed(0), packed(-1)),
        by_worker(packed(0), packed(DEEPEST + 1)),
        by_worker(packed(0), packed(0), pulses=LARGEST),
    ],
    ids=[
        "part of hops",
        "part of a literal",
        "uneven",
        "twice",
        "negative",
        "another's",
        "hops below 0",
        "deep",
        "pulses",
    ],
)
def test_a_worker_s_report_that_cannot_be_right_is_refused(
    report: wire.WorkerReport,
) -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    with pytest.raises(MessageError, match=r"^workerreport: .*must .*, got .{1,250}$"):
        wave.report(report, range(2))
    assert wave.missing == 1
    assert (wave.hops, wave.pulses) == ({}, 0)
    wave.report(by_worker(packed(0, 3), packed(0, 1)), range(2))
    assert wave.is_settled
    assert wave.hops == {0: 0, 3: 1}


def test_the_deepest_share_counts() -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    give(wave, gives_back(range(1, DEEPEST + 1)[::400]))
    before = wave.missing
    give(wave, wire.CellReport(1, 1, 0, (), (), (DEEPEST,), 0))
    assert before - wave.missing == Fraction(1, 2**DEEPEST)
    with pytest.raises(MessageError, match=r"^cellreport: must give back at most"):
        give(wave, wire.CellReport(1, 2, 0, (), (), (1,), 0))
    assert not wave.is_settled


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
