"""When a wave has settled, whatever order the reports come in."""

import random
from collections.abc import Sequence
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.wave import Wave, split_evenly


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


def signal_wave(*signal: int) -> Wave:
    return Wave(1, 0, "signal", len(signal), signal)


def test_it_settles_when_all_credit_is_back() -> None:
    wave = signal_wave(0)
    seen = [(wave.is_settled, wave.missing)]
    for one in (report(0, [0], [1], pulses=1), report(1, [2], [1], hops=[1])):
        wave.report(one)
        seen.append((wave.is_settled, wave.missing))
    assert seen == [(False, 1), (False, Fraction(1, 2)), (True, 0)]


def test_what_it_reached_is_what_was_reported() -> None:
    wave = signal_wave(0)
    wave.report(report(1, [3, 2], [2, 2], hops=[2, 1], pulses=4))
    wave.report(report(0, [0], [1], pulses=3))
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
        wave.report(one)
    assert wave.is_settled
    assert set(wave.hops) == {2 * cell for cell in range(len(reports))}


def test_shares_far_below_what_a_float_can_tell_are_counted() -> None:
    wave = signal_wave(0)
    deep = 5000
    for cell in range(deep):
        wave.report(report(cell, [2 * cell], [cell + 1]))
        assert not wave.is_settled
    assert wave.missing == Fraction(1, 2**deep)
    wave.report(report(deep, [2 * deep], [deep]))
    assert wave.is_settled


def test_a_report_that_comes_again_changes_nothing() -> None:
    wave = signal_wave(0)
    for _ in range(3):
        wave.report(report(0, [0], [1], pulses=1))
    assert (wave.missing, wave.pulses) == (Fraction(1, 2), 1)
    wave.report(report(0, [], [1], part=1))
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
    wave.report(report(0, [0], [1], pulses=1))
    expected = r"^cellreport: must give back at most the credit given out, got cell"
    with pytest.raises(MessageError, match=expected + r" 1, credit \["):
        wave.report(wrong)
    assert (wave.missing, wave.hops, wave.pulses) == (Fraction(1, 2), {0: 0}, 1)
    wave.report(report(1, [2], [1]))
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
    wave.report(report(0, [0], [1]))
    expected = (
        r"^cellreport: must report on wave 1, own literals, each once, got CellReport\("
    )
    with pytest.raises(MessageError, match=expected):
        wave.report(wrong)
    assert (wave.missing, wave.hops) == (Fraction(1, 2), {0: 0})


EDGES = {0: [2, 5], 2: [6], 5: [], 6: []}


def targets(literal: int) -> list[int]:
    return EDGES[literal]


def test_cells_of_the_signal_are_silent_until_they_report() -> None:
    wave = signal_wave(0, 6)
    assert wave.silent([0, 6], targets) == [0, 3]
    wave.report(report(3, [6], [1]))
    assert wave.silent([0, 6], targets) == [0]


def test_a_cell_that_reported_only_one_of_its_literals_is_silent_still() -> None:
    wave = signal_wave(0, 7)
    wave.report(report(3, [6], [3]))
    assert wave.silent([0, 7], targets) == [0, 3]


def test_targets_of_what_fired_are_silent_until_they_report() -> None:
    wave = signal_wave(0)
    wave.report(report(0, [0], [2], pulses=2))
    assert wave.silent([0], targets) == [1, 2]
    wave.report(report(1, [2], [2], hops=[1], pulses=1))
    assert wave.silent([0], targets) == [2, 3]


def test_a_cell_that_fired_its_other_literal_can_still_be_silent() -> None:
    wave = signal_wave(0, 4)
    wave.report(report(0, [0], [3], pulses=2))
    wave.report(report(2, [4], [1]))
    assert wave.silent([0, 4], {**EDGES, 4: []}.__getitem__) == [1, 2]


def test_nobody_is_silent_in_a_settled_wave() -> None:
    wave = signal_wave(0)
    wave.report(report(0, [0], [2], pulses=2))
    wave.report(report(1, [2], [3], pulses=1))
    wave.report(report(2, [5], [1]))
    wave.report(report(3, [6], [3]))
    assert wave.is_settled
    assert wave.silent([0], targets) == []


@given(credit=st.integers(0, 10_000), parts=st.integers(1, 300))
def test_split_shares_add_up_to_the_whole(credit: int, parts: int) -> None:
    shares = split_evenly(credit, parts)
    assert len(shares) == parts
    assert sum(Fraction(1, 2**share) for share in shares) == Fraction(1, 2**credit)
    assert shares == sorted(shares)
    assert shares[-1] - shares[0] <= 1
