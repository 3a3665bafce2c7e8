"""A reader limits how much it unpacks, even from a small crafted recording."""

import zlib
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header, Metadata

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format import chunk_index, records
from neurosnap.recording.format.records import MAGIC, RUN, sealed_facts
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import delivered

FLOOR = 1 << 20
RATIO = 8


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a tenth of a megabyte stand for six."""
    monkeypatch.setattr(records, "FLOOR", FLOOR)
    monkeypatch.setattr(records, "RATIO", RATIO)
    monkeypatch.setattr("neurosnap.recording.write.writer.RATIO", RATIO)


@pytest.fixture
def unpacked(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the sizes of all chunks that are unpacked from now on."""
    sizes: list[int] = []
    unpack = chunk_index._unpack_zstd

    def noted(packed: bytes, size: int) -> bytes:
        sizes.append(size)
        return unpack(packed, size)

    monkeypatch.setattr(chunk_index, "_unpack_zstd", noted)
    return sizes


def craft(
    path: Path, size: int, *, count: int = 20, before: bytes = b"", wrong: int = 0
) -> None:
    """Write chunks of zeros, something before each; `wrong` is added to checksums."""
    builder = RecordBuilder()
    builder.write(MAGIC)
    Header("neurosnap", "a stranger").write(builder)
    Metadata(RUN, sealed_facts(RUN, {"schema": str(wire.SCHEMA)})).write(builder)
    zeros = bytes(size)
    for _ in range(count):
        builder.write(before)
        Chunk(
            compression="zstd",
            data=zstandard.compress(zeros),
            message_start_time=0,
            message_end_time=0,
            uncompressed_crc=zlib.crc32(zeros) + wrong,
            uncompressed_size=size,
        ).write(builder)
    path.write_bytes(builder.end())


def test_a_chunk_that_claims_more_than_its_file_is_named_and_not_unpacked(
    log: Path, unpacked: list[int]
) -> None:
    craft(log, 255 * FLOOR // 100)
    recording = Recording.open(log)
    assert [*recording.messages()] == []
    assert not recording.whole
    assert len(recording.damage) == 20
    for said in recording.damage:
        assert "a chunk here must unpack to at most 10" in said
        assert said.endswith(f"bytes, got {255 * FLOOR // 100}")
    assert unpacked == []


def test_many_chunks_that_claim_little_are_read_up_to_the_budget(
    log: Path, unpacked: list[int]
) -> None:
    craft(log, FLOOR // 10, count=100)
    recording = Recording.open(log)
    assert 10 <= len(recording.chunks) < 15
    assert sum(unpacked) <= records.room(log.stat().st_size)


def test_readers_stop_at_the_first_chunk_without_a_record_of_ours(
    log: Path, unpacked: list[int]
) -> None:
    craft(log, FLOOR // 50)
    recording = Recording.open(log)
    unpacked.clear()
    rule = "chunk 1: record must be a message or its channel, got 0"
    with pytest.raises(RecordingError, match=rule):
        list(recording.messages())
    assert unpacked == [FLOOR // 50] * 2  # for its channels, and for its messages


@pytest.mark.parametrize("wrong", [0, 1])
def test_what_is_unpacked_to_find_a_record_is_of_the_budget_too(
    log: Path, unpacked: list[int], wrong: int
) -> None:
    craft(log, FLOOR // 10, count=100, before=b"\xff", wrong=wrong)
    Recording.open(log, verify=False)
    # What is surely a chunk is unpacked to find it, and counted once it is filed.
    assert sum(unpacked) <= 2 * records.room(log.stat().st_size)


def test_a_writer_never_writes_more_than_is_read(log: Path) -> None:
    alike = [wire.KeyFrame(tick, bytes(40_000)) for tick in range(100)]
    with Writer(log) as writer:
        writer.start({})
        for delivery in delivered(alike):
            writer.add(delivery, 1)
        writer.finish({}, {"coordinator": len(alike)})
    recording = Recording.open(log)
    assert recording.whole
    assert [one.message for one in recording.messages()] == alike
    assert log.stat().st_size < 1 << 20  # of four and a half
