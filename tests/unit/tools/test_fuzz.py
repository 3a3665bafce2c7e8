"""Hostile input: a short run of each target, and what the long runs have found."""

import random
import struct
import zlib
from pathlib import Path

import pytest
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Header, Metadata

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.host import check_readings
from neurosnap.recording.format.records import RUN, sealed_facts
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.job import decoded
from neurosnap.sensorium import pack
from tests.support.exhaustive import rows
from tests.support.refusals import refusal
from tools.fuzz import __main__ as fuzz
from tools.fuzz import altered_bytes
from tools.fuzz.messages import altered
from tools.fuzz.run import honest_run
from tools.fuzz.targets import Count, FuzzError, Twins

DISK = {"disk", "recording"}
"""Targets that write files."""

# The fuzzer ---------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    "target", rows(sorted(fuzz.TARGETS.keys() - DISK), sorted(DISK))
)
def test_no_input_does_harm(target: str) -> None:
    inputs = {"recording": 150, "disk": 12}.get(target, 1500)
    (count,) = fuzz.fuzz([target], inputs, 7, 1.0, None).values()
    assert count.inputs >= inputs
    assert count.rejected < count.inputs
    assert count.rejected or target == "disk"  # of few files something can be read


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


# What every part does -----------------------------------------------------------------


def test_a_fault_does_not_repeat_ten_megabytes() -> None:
    hub = MemoryHub()
    part, heard = hub.fabric("cell/1"), list[wire.Delivery]()
    hub.fabric("ear").listen(("fault/**",), heard.extend)
    large = b'{"type":"' + b"x" * 10_000_000 + b'"}'
    assert decoded(part, [wire.Delivery("wavestart", 0, 0, large)]) == []
    hub.run()
    (delivery,) = heard
    assert len(delivery.payload) < 500
    fault = wire.decode("fault/cell/1", delivery.payload)
    assert isinstance(fault, wire.Fault)
    assert fault.what.startswith(
        "wavestart: must hold a message, got Invalid value 'xxx"
    )


# A recording --------------------------------------------------------------------------


def test_a_message_nested_too_deep_is_an_error_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "deep.mcap"
    payload = wire.encode(wire.Observation(1, pack([True])))
    room = len(payload) + 10_000
    with Writer(path, packs=False) as writer:
        writer.start({"swarm": "deep"})
        writer.add(wire.Delivery("observation", 0, 0, payload.ljust(room)), 0)
        writer.finish({}, {})
    honest = path.read_bytes()
    deep = payload[:-1] + b',"x":'
    forged = honest.replace(payload.ljust(room), deep.ljust(room, b"["))
    path.write_bytes(_resealed(forged))
    expected = (
        r": chunk 1: /observation must hold its own messages, got maximum recursion"
    )
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
    Metadata(RUN, sealed_facts(RUN, {"schema": schema})).write(builder)
    path.write_bytes(b"\x89MCAP0\r\n" + builder.end())
    with pytest.raises(RecordingError, match=r": schema: must be \d+, got '"):
        Recording.open(path)


def test_partial_observations_that_may_be_right_are_tried_and_others_too() -> None:
    chance, whole = random.Random(0), wire.Observation(3, b"\x5a\x03")
    tried = [altered(whole, chance) for _ in range(400)]
    partial = [one for one in tried if isinstance(one, wire.Observation) and one.known]
    right = sum(refusal(check_readings, one) is None for one in partial)
    assert 40 < right < len(partial) - 40
