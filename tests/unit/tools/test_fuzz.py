"""Hostile input: a short run of each target, and what the long runs have found."""

import random
import struct
import zlib
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from neurosnap import wire
from neurosnap.errors import MessageError, RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol import cell as cells
from neurosnap.protocol import message_checks as limits
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.message_checks import check_readings
from neurosnap.protocol.wave import DEEPEST, Wave
from neurosnap.protocol.wave_control import WaveControl
from neurosnap.recording.format.records import RUN
from neurosnap.recording.read.reader import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.participant import decoded
from neurosnap.sensorium import pack
from tests.support.refusals import refusal
from tests.support.wave_messages import packed
from tools.fuzz import __main__ as fuzz
from tools.fuzz import altered_bytes
from tools.fuzz.messages import altered
from tools.fuzz.run import honest_run
from tools.fuzz.targets import Count, FuzzError, Twins

LARGEST = 2**31 - 1
OWN = 2  # of the cell of sensor 1


# The fuzzer ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("target", fuzz.SHARES)
def test_no_input_does_harm(target: str) -> None:
    inputs = 150 if target == "recording" else 1500
    (count,) = fuzz.fuzz([target], inputs, 7, 1.0, None).values()
    assert count.inputs >= inputs
    assert 0 < count.rejected < count.inputs


@pytest.mark.slow
def test_a_round_can_be_made_again(tmp_path: Path) -> None:
    drawn: list[list[bytes]] = []
    for folder in (tmp_path / "first", tmp_path / "again"):
        folder.mkdir()
        honest, chance = honest_run(folder), random.Random("1/recording/3")
        drawn.append(
            [altered_bytes.damage_recording(honest.recording, chance) for _ in "abc"]
        )
    assert drawn[0] == drawn[1]


class Broken:
    """A target that gets into trouble with some input of its third round."""

    def __init__(self) -> None:
        self._rounds = 0

    def round(self, chance: random.Random, count: Count) -> None:
        count.timed("the input", lambda: 1 // (2 - self._rounds))
        self._rounds += 1


def test_a_failure_says_how_to_make_it_again() -> None:
    expected = (
        r"(?s)^broken: ZeroDivisionError: .*"
        r"\nagain: --seed 5 --only broken --round 2\ninput: 'the input'$"
    )
    with pytest.raises(FuzzError, match=expected):
        for _ in fuzz.rounds("broken", Broken(), 5):
            pass


class Parrot:
    """Says how much it has heard, and calls everything a fault."""

    def __init__(self) -> None:
        self._heard = 0

    def receive(self, given: wire.Message) -> list[wire.Message]:
        self._heard += 1
        return [wire.Fault("parrot", f"{self._heard} of {type(given).__name__}")]


def test_a_core_that_is_changed_by_what_it_rejects_is_found_out() -> None:
    twins = Twins(Parrot(), [wire.Leave("a")] * 50)
    with pytest.raises(FuzzError, match=r"^said .*Leave.* and not .*Leave"):
        twins.play(random.Random(1), Count(), 4)


# A cell -------------------------------------------------------------------------------


def start(wave: int, *, cell: int = -1, **more: int) -> wire.WaveStart:
    fields = {"tick": 0, "credit": 0, "settled_below": 1, "fence": wave, **more}
    return wire.WaveStart(wave, kind="signal", signal=(OWN,), cell=cell, **fields)


def pulse(wave: int, source: int = 0, **more: int) -> wire.Pulse:
    fields = {"hops": 1, "credit": 1, "fence": wave, **more}
    return wire.Pulse(wave, source, OWN, **fields)


def under_way() -> Cell:
    """Return a cell that has come to wave 7 and tick 5, and knows an edge."""
    cell = Cell(1)
    cell.receive([wire.Wiring(1, 1, 0, add=(4,)), wire.Observation(5, b"\2")])
    (sent, report) = cell.receive([wire.WaveStart(7, 5, "state", 0, 7, fence=7)])
    assert isinstance(sent, wire.Pulse)
    assert isinstance(report, wire.CellReport)
    return cell


FAR = 7 + 4096 + 1

WRONG: list[wire.Message] = [
    start(LARGEST),
    start(FAR),
    start(8, fence=FAR),
    start(8, settled_below=9),
    start(8, settled_below=LARGEST),
    start(8, tick=14),
    start(8, credit=DEEPEST + 1),
    start(8, cell=2),
    start(FAR, cell=1),
    pulse(FAR),
    pulse(8, fence=FAR),
    pulse(8, hops=DEEPEST + 1),
    pulse(8, credit=LARGEST),
    wire.Observation(14, b"\2"),
    wire.Observation(6, bytes(2)),
    wire.Wiring(1, FAR, 0),
    wire.Wiring(1, 2, 1, add=tuple(range(DEEPEST + 1))),
    wire.Wiring(1, 2, 1, add_complement=tuple(range(DEEPEST + 1))),
]


@pytest.mark.parametrize("wrong", WRONG, ids=lambda m: f"{m!r:.40}")
def test_what_cannot_be_right_is_a_fault_and_changes_nothing(
    wrong: wire.Message,
) -> None:
    clean, tried = under_way(), under_way()
    (fault,) = tried.receive([wrong])
    assert isinstance(fault, wire.Fault)
    assert len(fault.what) < 100
    rest: list[wire.Message] = [
        wire.Wiring(1, 2, 1, add=(6,)),
        wire.Observation(6, b"\0"),
        wire.WaveStart(8, 6, "state", 0, 8, fence=8),
        pulse(8, 5),
        pulse(9, 5, fence=8),
    ]
    for message in rest:
        assert tried.receive([message]) == clean.receive([message])


@pytest.mark.parametrize(
    "right",
    [
        start(FAR - 1),
        pulse(FAR - 1),
        start(8, tick=13),
        wire.Wiring(1, FAR - 1, 0),
        start(8, settled_below=8),
    ],
    ids=["wave", "pulse", "tick", "epoch", "settled"],
)
def test_what_is_only_just_right_is_taken(right: wire.Message) -> None:
    said = under_way().receive([right])
    assert not any(isinstance(one, wire.Fault) for one in said)


def test_a_cell_that_has_seen_nothing_begins_anywhere() -> None:
    cell = Cell(1)
    cell.receive([wire.Wiring(1, 90_000, 0, add=(4,)), wire.Observation(80_000, b"\2")])
    said = cell.receive([wire.WaveStart(99_999, 80_000, "state", 0, 9, fence=99_999)])
    assert [type(one) for one in said] == [wire.Pulse, wire.CellReport]


def test_readings_of_ticks_to_come_do_not_displace_the_one_that_is_due() -> None:
    cell = Cell(1)
    for tick in range(LARGEST - 9, LARGEST):
        cell.receive([wire.Observation(tick, b"\0")])
    cell.receive([start(1, tick=1)])
    for tick in (2, 3):
        state = wire.WaveStart(tick, tick, "state", 0, 1, fence=tick)
        (report,) = cell.receive([wire.Observation(tick, b"\2"), state])
        assert isinstance(report, wire.CellReport)
        assert report.literals == (OWN,)


def flood(cell: Cell, messages: Callable[[int], wire.Message], most: int) -> list[str]:
    """Send until the cell complains; return what it says of the last few."""
    said: list[str] = []
    for number in range(most):
        for one in cell.receive([messages(number)]):
            if isinstance(one, wire.Fault):
                said.append(one.what)
        if len(said) == 3:
            break
    return said


@pytest.mark.parametrize(
    "messages",
    [
        lambda number: pulse(1000 + number * 1000),
        lambda number: start(1000 + number * 1000, cell=1),
    ],
    ids=["pulses", "starts"],
)
def test_waves_that_never_come_are_kept_to_a_number_and_then_forgotten(
    messages: Callable[[int], wire.Message],
) -> None:
    cell = Cell(1)
    said = flood(cell, messages, 10_000)
    assert len(said) == 3
    assert all("must be of 8192 waves in all" in what for what in said)
    assert len(cell._waves) == limits.WAVES
    cell.receive([start(1)])
    # Only what may yet come about is left, and there is room for more.
    assert set(cell._waves) == {1, *range(1000, 4098, 1000)}
    (report,) = cell.receive([pulse(2, fence=1)])
    assert isinstance(report, wire.CellReport)


@pytest.mark.slow
def test_pulses_are_kept_to_a_number_and_forgotten_with_their_waves() -> None:
    cell = Cell(1)
    said = flood(cell, lambda source: pulse(2, source), 200_000)
    assert len(said) == 3
    assert said[0].startswith("pulse: must be one of 131072 in flight")
    assert cell._remembered == cells._PULSES
    cell.receive([start(3, settled_below=3)])
    (report,) = cell.receive([pulse(3)])
    assert isinstance(report, wire.CellReport)
    assert cell._remembered == 1


def test_of_a_signal_only_its_own_literals_are_kept() -> None:
    cell = Cell(1)
    for kind in ("signal", "state"):
        wave = 2 if kind == "signal" else 3
        signal = (*range(100_000), OWN)
        cell.receive([wire.WaveStart(wave, 0, kind, 0, 1, signal, fence=9)])
        kept = cell._waves[wave].start
        assert kept is not None
        assert len(kept.signal) == 2


# A wave -------------------------------------------------------------------------------


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
    with pytest.raises(MessageError, match=r"^settle: must .*, got .{1,250}$"):
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
    with pytest.raises(MessageError, match=r"^tally: .*must .*, got .{1,250}$"):
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
    with pytest.raises(MessageError, match=r"^(settle|tally): must be a "):
        conductor.report(report)
    assert conductor.in_flight == (1,)


def test_the_deepest_share_counts() -> None:
    wave = Wave(1, 0, "signal", 1, (0,))
    wave.report(settled(range(1, DEEPEST + 1)[::400]))
    before = wave.missing
    wave.report(wire.CellReport(1, 1, 0, (), (), (DEEPEST,), 0))
    assert before - wave.missing == Fraction(1, 2**DEEPEST)
    with pytest.raises(MessageError, match=r"^settle: must give back at most"):
        wave.report(wire.CellReport(1, 2, 0, (), (), (1,), 0))
    assert not wave.is_settled


# What every part does -----------------------------------------------------------------


def test_a_fault_does_not_repeat_ten_megabytes() -> None:
    hub = MemoryHub()
    part, heard = hub.fabric("cell/1"), list[wire.Delivery]()
    hub.fabric("ear").listen(("fault/**",), heard.extend)
    large = b'{"type":"' + b"x" * 10_000_000 + b'"}'
    assert decoded(part, [wire.Delivery("wave", 0, 0, large)]) == []
    hub.run()
    (delivery,) = heard
    assert len(delivery.payload) < 500
    fault = wire.decode("fault/cell/1", delivery.payload)
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith("wave: must hold a message, got Invalid value 'xxx")


# A recording --------------------------------------------------------------------------


def test_a_message_nested_too_deep_is_an_error_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "deep.mcap"
    payload = wire.encode(wire.Observation(1, pack([True])))
    room = len(payload) + 10_000
    with Writer(path, compression="none") as writer:
        writer.start({"swarm": "deep"})
        writer.add(wire.Delivery("observe", 0, 0, payload.ljust(room)), 0)
        writer.finish({}, {})
    honest = path.read_bytes()
    deep = payload[:-1] + b',"x":'
    forged = honest.replace(payload.ljust(room), deep.ljust(room, b"["))
    path.write_bytes(_resealed(forged))
    expected = r": chunk 1: /observe must hold its own messages, got maximum recursion"
    with pytest.raises(RecordingError, match=expected):
        list(Recording.open(path).messages())


def _resealed(whole: bytes) -> bytes:
    """Return a recording of one unpacked chunk with all its checksums right."""
    records = altered_bytes.records(whole[8:-8])
    for at, (kind, body) in enumerate(records):
        if kind == Opcode.CHUNK:
            (size,) = struct.unpack_from("<Q", body, 16)
            checksum = struct.pack("<I", zlib.crc32(body[-size:]))
            records[at] = kind, body[:24] + checksum + body[28:]
    return altered_bytes.resealed(records)


@pytest.mark.parametrize("schema", ["9" * 5000, "0", "01", "\u0661", "", "-1"])
def test_a_schema_that_is_no_number_of_ours_is_refused(
    schema: str, tmp_path: Path
) -> None:
    path, builder = tmp_path / "schema.mcap", RecordBuilder()
    Header("neurosnap", "").write(builder)
    Metadata(RUN, {"schema": schema}).write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    with pytest.raises(RecordingError, match=r": schema: must be in \[1, \d\], got '"):
        Recording.open(path)


def test_partial_observations_that_may_be_right_are_tried_and_others_too() -> None:
    chance, whole = random.Random(0), wire.Observation(3, b"\x5a\x03")
    tried = [altered(whole, chance) for _ in range(400)]
    partial = [one for one in tried if isinstance(one, wire.Observation) and one.known]
    right = sum(refusal(check_readings, one) is None for one in partial)
    assert 40 < right < len(partial) - 40
