"""A scan of the index finds what a whole walk finds, wherever the file ends."""

import struct
from contextlib import suppress
from pathlib import Path

import pytest
from mcap.opcode import Opcode

from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunks import unpack
from neurosnap.recording.format.records import MAGIC, Cut, opened
from neurosnap.recording.format.scan import scan, scan_growth, scan_index
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import traffic
from tools.fuzz import altered_bytes


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.mcap"
    with Writer(path, chunk=1500) as writer:
        writer.start({"source": "glance"})
        for place, delivery in enumerate(traffic(200)):
            writer.add(delivery, place)
        writer.finish({"ticks": "1"}, {})
    return path


def test_a_finished_file_is_known_by_its_summary(log: Path) -> None:
    seen, scanned = scan_index(log), scan(log)
    found = seen
    assert found.damage == []
    assert len(found.chunks) > 5
    for name in ("size", "library", "metadata", "chunks", "channels"):
        assert getattr(found, name) == getattr(scanned, name)
    assert found.cut is None


def test_a_file_is_known_up_to_wherever_it_was_cut(log: Path) -> None:
    data = log.read_bytes()
    for size in range(60, len(data), 97):
        log.write_bytes(data[:size])
        scanned, seen = scan(log), scan_index(log)
        if seen.metadata.keys() != scanned.metadata.keys():
            pytest.fail(f"metadata differs at {size}")
        assert seen.chunks == scanned.chunks
        assert seen.damage == []
        assert seen.cut is not None
        assert scanned.cut is not None
        assert seen.cut.chunks == scanned.cut.chunks


def test_what_is_gained_is_found_from_where_the_walk_stopped(log: Path) -> None:
    data = log.read_bytes()
    log.write_bytes(data[:100])
    seen = scan_index(log)
    for size in [*range(150, len(data), 131), len(data)]:
        log.write_bytes(data[:size])
        assert scan_growth(log, seen)
        assert not scan_growth(log, seen)
        afresh = scan_index(log)
        assert seen.chunks == afresh.chunks
        assert seen.cut == afresh.cut
        assert seen.damage == afresh.damage == []
    assert seen.cut is None


def test_no_byte_can_be_wrong_unnoticed_in_what_is_shown(log: Path) -> None:
    data = log.read_bytes()
    intact = contents(log)
    for place in range(0, len(data), 61):
        hurt = bytearray(data)
        hurt[place] ^= 0x55
        log.write_bytes(hurt)
        try:
            assert contents(log) <= intact
        except RecordingError:
            assert place < 100  # the start: it is no recording of ours then


FAR = [1 << 20, 2**62, 2**63 - 1, 2**63, 2**64 - 1]


@pytest.mark.parametrize("kind", [Opcode.CHUNK_INDEX, Opcode.METADATA_INDEX])
@pytest.mark.parametrize("place", FAR)
def test_a_summary_that_points_beyond_the_file_is_not_followed(
    log: Path, kind: Opcode, place: int
) -> None:
    scanned = scan(log)
    before = 16 if kind == Opcode.CHUNK_INDEX else 0  # its times
    records = altered_bytes.records(log.read_bytes()[len(MAGIC) : -len(MAGIC)])
    at = [one for one, _ in records].index(kind)
    body = bytearray(records[at][1])
    struct.pack_into("<Q", body, before, place)
    records[at] = kind, bytes(body)
    log.write_bytes(altered_bytes.resealed(records))
    seen = scan_index(log)
    (damage,) = seen.damage
    assert "the summary must be well-formed" in damage.why
    assert seen.chunks == scanned.chunks


@pytest.mark.parametrize("packed", [0, 1, 2**64 - 1])
def test_a_chunk_that_is_as_long_as_it_does_not_say_ends_what_can_be_read(
    log: Path, packed: int
) -> None:
    scanned, data = scan(log), bytearray(log.read_bytes())
    second = scanned.chunks[1]
    struct.pack_into("<Q", data, second.offset - 8, packed)
    log.write_bytes(data[: second.offset + second.packed + 100])
    seen = scan_index(log)
    assert seen.chunks == scan(log).chunks == scanned.chunks[:1]
    assert seen.cut == Cut(1, second.start_offset, log.stat().st_size)


def contents(log: Path) -> set[bytes]:
    """Return what the chunks hold that can be read."""
    found = set()
    with opened(log) as file:
        for chunk in scan_index(log).chunks:
            with suppress(RecordingError):
                found.add(unpack(log, file, chunk))
    return found
