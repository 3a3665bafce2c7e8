"""What a wave refuses of the reports on it."""

from collections.abc import Sequence
from fractions import Fraction

import pytest

from neurosnap import wire
from neurosnap.errors import MessageError
from neurosnap.protocol.wave import DEEPEST, Wave
from neurosnap.protocol.wave_control import WaveControl
from tests.support.wave_messages import LARGEST, packed


def settled(credit: Sequence[int], **more: int) -> wire.CellReport:
    fields = {"part": 0, "pulses": 0, "wave": 1, **more}
    return wire.CellReport(
        cell=0, literals=(0,), hops=(0,), credit=tuple(credit), **fields
    )


@pytest.mark.parametrize(
    "report",
    [
        settled([LARGEST]),
        settled([DEEPEST + 1]),
        settled([40] * (DEEPEST + 1)),
        settled([]),
        settled([1], pulses=LARGEST),
        settled([1], part=LARGEST),
        settled([1], wave=LARGEST),
    ],
    ids=["far too deep", "too deep", "many", "none", "pulses", "part", "wave"],
)
def test_a_report_that_is_too_large_is_refused(report: wire.CellReport) -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    with pytest.raises(MessageError, match=r"^cellreport: must .*, got .{1,250}$"):
        wave.report(report)
    assert wave.missing == 1
    assert (wave.hops, wave.pulses) == ({}, 0)
    wave.report(settled([0]))
    assert wave.is_settled


def tally(literals: bytes, hops: bytes, **more: int) -> wire.WorkerReport:
    fields = {"wave": 1, "part": 0, "pulses": 0, **more}
    return wire.WorkerReport(
        worker=0, literals=literals, hops=hops, credit=(0,), **fields
    )


@pytest.mark.parametrize(
    "report",
    [
        tally(packed(0), packed(0)[:3]),
        tally(packed(0)[:3], packed(0)),
        tally(packed(0), packed(0, 0)),
        tally(packed(0, 0), packed(0, 0)),
        tally(packed(-1), packed(0)),
        tally(packed(4), packed(0)),
        tally(packed(0), packed(-1)),
        tally(packed(0), packed(DEEPEST + 1)),
        tally(packed(0), packed(0), pulses=LARGEST),
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
        wave.tally(report, range(2))
    assert wave.missing == 1
    assert (wave.hops, wave.pulses) == ({}, 0)
    wave.tally(tally(packed(0, 3), packed(0, 1)), range(2))
    assert wave.is_settled
    assert wave.hops == {0: 0, 3: 1}


@pytest.mark.parametrize("report", [settled([0]), tally(packed(0), packed(0))])
def test_a_report_is_refused_where_nobody_could_send_it(
    report: wire.CellReport | wire.WorkerReport,
) -> None:
    conductor = WaveControl(2, workers=int(isinstance(report, wire.CellReport)))
    conductor.start("signal", signal=(0,))
    with pytest.raises(MessageError, match=r"^(cellreport|workerreport): must be a "):
        conductor.report(report)
    assert conductor.in_flight == (1,)


def test_the_deepest_share_counts() -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    wave.report(settled(range(1, DEEPEST + 1)[::400]))
    before = wave.missing
    wave.report(wire.CellReport(1, 1, 0, (), (), (DEEPEST,), 0))
    assert before - wave.missing == Fraction(1, 2**DEEPEST)
    with pytest.raises(MessageError, match=r"^cellreport: must give back at most"):
        wave.report(wire.CellReport(1, 2, 0, (), (), (1,), 0))
    assert not wave.is_settled
