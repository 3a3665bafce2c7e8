"""Recordings that are truncated, bit-flipped or malicious."""

import random
import struct
import tracemalloc
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header, Message, Metadata

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.cuts_and_damage import scan, scan_growth, scan_index
from neurosnap.recording.format.records import LIMIT, RUN, TOTALS, Cut, sealed_facts
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.recording_file import RecordingFile
from neurosnap.recording.write import writer
from tests.support.exhaustive import rows
from tests.support.recordings import EACH, delivered, record, traffic

MAGIC = b"\x89MCAP0\r\n"
DELIVERIES = [*traffic(150), *delivered([EACH["keyframe"]])]


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("finished") / "log.mcap"
    record(path, DELIVERIES, every=20)
    return path.read_bytes()


@pytest.fixture(scope="module")
def abandoned(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("abandoned") / "log.mcap"
    record(path, DELIVERIES, every=20, finish=False)
    return path.read_bytes()


@pytest.mark.slow
def test_cut_anywhere_it_gives_the_whole_chunks(finished: bytes, log: Path) -> None:
    known = [delivery.payload for delivery in DELIVERIES]
    header = len(MAGIC) + 9 + int.from_bytes(finished[9:17], "little")
    log.write_bytes(finished)
    ends = [c.offset + c.packed for c in Recording.open(log).files[0].layout.chunks]
    offsets = {*range(header, len(finished), 97), header, len(finished) - 1}
    offsets |= {end + near for end in ends for near in (-1, 0, 1, 8, 9)}
    assert len(offsets) > 100
    for offset in range(header):
        log.write_bytes(finished[:offset])
        with pytest.raises(RecordingError, match=r"must be an MCAP|whole header"):
            Recording.open(log)
    lengths = set()
    for offset in sorted(offsets):
        log.write_bytes(finished[:offset])
        recording = Recording.open(log)
        payloads = [recorded.payload for recorded in recording.messages()]
        assert payloads == known[: 20 * sum(end <= offset for end in ends)]
        assert recording.cut is not None
        assert recording.cut.size == offset
        assert recording.cut.chunks == sum(end <= offset for end in ends)
        lengths.add(len(payloads))
    assert lengths == {0, 20, 40, 60, 80, 100, 120, 140, 151}
    # The last cut is behind the totals.
    recording = Recording.open(log)
    assert recording.totals is not None
    assert recording.balance(recording.sequences()) == Completeness(151)


def flipped(whole: bytes, seed: int, count: int) -> Iterator[tuple[int, bytes]]:
    """Yield copies with one bit flipped, and where; the first and last 64 bytes too."""
    draw = random.Random(seed)
    last = whole.find(b"neurosnap.totals")  # the data end some 300 bytes behind
    ends = (
        *range(64),
        *range(len(whole) - 64, len(whole)),
        *range(last, last + 400, 3),
    )
    for offset in (*ends, *draw.sample(range(len(whole)), count)):
        damaged = bytearray(whole)
        damaged[offset] ^= 1 << draw.randrange(8)
        yield offset, bytes(damaged)


@pytest.mark.slow
@pytest.mark.parametrize("kind", rows(["finished"], ["abandoned"]))
def test_a_flipped_bit_costs_one_chunk_at_most_and_is_noticed(
    kind: str, log: Path, request: pytest.FixtureRequest
) -> None:
    lost = set()
    for offset, damaged in flipped(request.getfixturevalue(kind), 1, 300):
        log.write_bytes(damaged)
        recording = Recording.open(log)
        read = [recorded.delivery for recorded in recording.messages()]
        assert read == [one for one in DELIVERIES if one in read]
        assert not recording.whole
        lost.add(len(DELIVERIES) - len(read))
        if kind == "finished":
            seed = recording.metadata.get("seed"), recording.metadata.get("schema")
            assert seed == ("7", str(wire.SCHEMA)), offset
            assert (recording.cut is None) == (offset < len(damaged) - 8), offset
    assert lost == {0, 11, 20}


def hurt(whole: bytes, path: Path, number: int) -> int:
    """Flip a bit in the middle of a chunk; return where its record starts."""
    path.write_bytes(whole)
    chunk = Recording.open(path).files[0].layout.chunks[number - 1]
    damaged = bytearray(whole)
    damaged[chunk.offset + chunk.packed // 2] ^= 1
    path.write_bytes(damaged)
    return chunk.start_offset


def test_zeros_behind_a_cut_are_a_cut(finished: bytes, log: Path) -> None:
    start = hurt(finished, log, 5)
    for at in (start - 3, start, start + 1, start + 60):
        log.write_bytes(finished[:at] + bytes(len(finished) - at))
        recording = Recording.open(log)
        assert recording.damage == ()
        assert recording.cut is not None
        assert recording.cut.offset <= max(at, start)
        read = [recorded.delivery for recorded in recording.messages()]
        assert read == DELIVERIES[:80]


def test_zeros_elsewhere_cost_what_they_cover(abandoned: bytes, log: Path) -> None:
    start = hurt(abandoned, log, 5)
    for at, size, lost in ((start - 9, 30, slice(80, 100)), (0, 200, slice(20))):
        log.write_bytes(abandoned[:at] + bytes(size) + abandoned[at + size :])
        recording = Recording.open(log)
        read = [recorded.delivery for recorded in recording.messages()]
        assert read == [one for one in DELIVERIES if one not in DELIVERIES[lost]]
        assert recording.balance(recording.sequences()).missing
        assert recording.metadata["seed"] == "7"


def test_facts_without_a_checksum_are_damage(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        writer,
        "sealed_facts",
        lambda name, facts: (
            dict(facts) if name == TOTALS else sealed_facts(name, facts)
        ),
    )
    record(log, DELIVERIES, every=20)
    recording = Recording.open(log)
    assert recording.metadata["seed"] == "7"
    assert recording.totals is None
    assert recording.cut is None  # behind the last record there is the summary
    (said,) = recording.damage
    assert "a record must be well-formed, got no checksum" in said


def test_bytes_behind_the_end_are_noticed(finished: bytes, log: Path) -> None:
    for more in (b"\0", MAGIC, finished):
        log.write_bytes(finished + more)
        recording = Recording.open(log)
        assert [one.delivery for one in recording.messages()] == DELIVERIES
        (said,) = recording.damage
        assert f"the file must end behind its footer, got {len(more)} bytes" in said


def test_what_is_gained_is_found_from_where_the_walk_stopped(
    finished: bytes, log: Path
) -> None:
    log.write_bytes(finished[:100])
    seen = scan_index(log)
    for size in [*range(150, len(finished), 131), len(finished)]:
        log.write_bytes(finished[:size])
        assert scan_growth(log, seen)
        assert not scan_growth(log, seen)
        assert seen == scan_index(log)
        assert seen.damage == []
    assert seen.cut is None


@pytest.mark.slow
def test_no_byte_can_be_wrong_unnoticed_in_what_is_not_verified_at_once(
    finished: bytes, log: Path
) -> None:
    for place, damaged in flipped(finished, 2, 200):
        log.write_bytes(damaged)
        try:
            layout = scan_index(log)
        except RecordingError:
            assert place < 100  # the start: it is no recording of ours then
            continue
        file = RecordingFile(log, layout)
        for chunk in layout.chunks:
            with suppress(RecordingError):
                found = file.chunk(chunk).recorded(wire.TOPICS)
                assert {one.delivery for one in found} <= {*DELIVERIES}


@pytest.mark.parametrize("packed", [0, 1, 2**64 - 1])
def test_a_chunk_that_is_as_long_as_it_does_not_say_ends_what_can_be_read(
    finished: bytes, log: Path, packed: int
) -> None:
    log.write_bytes(finished)
    (first, second, *_), data = scan_index(log).chunks, bytearray(finished)
    struct.pack_into("<Q", data, second.offset - 8, packed)
    log.write_bytes(data[: second.stop_offset + 100])
    seen = scan_index(log)
    assert seen.chunks == scan(log).chunks == [first]
    assert seen.cut == Cut(1, second.start_offset, log.stat().st_size)


def crafted(path: Path, record: Chunk | Message | bytes) -> Recording:
    """Open a file that was never finished and holds one record besides its metadata."""
    builder = RecordBuilder()
    builder.write(MAGIC)
    Header("neurosnap", "a stranger").write(builder)
    Metadata(RUN, sealed_facts(RUN, {"schema": str(wire.SCHEMA)})).write(builder)
    if not isinstance(record, bytes):
        record.write(builder)
        record = b""
    path.write_bytes(builder.end() + record)
    return Recording.open(path)


def zstd_chunk(packed: bytes, claimed: int, compression: str = "zstd") -> Chunk:
    return Chunk(
        compression=compression,
        data=packed,
        message_start_time=0,
        message_end_time=0,
        uncompressed_crc=0,
        uncompressed_size=claimed,
    )


@pytest.mark.parametrize("says_its_size", [True, False])
def test_a_chunk_that_unpacks_to_more_than_it_claims_takes_no_memory(
    log: Path, says_its_size: bool
) -> None:
    compressor = zstandard.ZstdCompressor(write_content_size=says_its_size)
    bomb = compressor.compress(bytes(64 * 2**20))
    tracemalloc.start()
    recording = crafted(log, zstd_chunk(bomb, 1000))
    assert list(recording.messages()) == []
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert recording.cut is not None
    assert peak < 2 * 2**20  # what is read at a time


def many_chunks() -> bytes:
    """Return what looks like chunks, each of which claims all that follows."""
    said = bytes(9)
    for left in range(2000, 0, -1):
        rest = left * 49 - 49
        head = (32 + 8 + rest).to_bytes(8, "little") + bytes(16)
        size = rest.to_bytes(8, "little")
        said += b"\x06" + head + size + b"\1\0\0\0" + bytes(4) + size
    return said


@pytest.mark.parametrize(
    "record",
    [
        b"\x06" + (LIMIT + 1).to_bytes(8, "little"),
        many_chunks(),
        zstd_chunk(b"", LIMIT + 1),
        *(zstd_chunk(b"\x03" + bytes(8), 9, kind) for kind in ("lz4", "zstd", "")),
        Message(1, 0, b"no checksum covers it", 0, 0),
    ],
    ids=[
        *("claims too much", "many chunks", "too large"),
        *("lz4", "zstd", "not packed", "outside a chunk"),
    ],
)
def test_what_no_checksum_proves_is_left_unread(
    log: Path, record: Chunk | Message | bytes
) -> None:
    recording = crafted(log, record)
    assert recording.files[0].layout.chunks == []
    assert list(recording.messages()) == []
    assert recording.cut is not None


def raw(opcode: int, body: bytes) -> bytes:
    return bytes((opcode,)) + struct.pack("<Q", len(body)) + body


def channel(number: int, topic: str) -> bytes:
    """Return the record that registers a channel."""
    texts = (f"/{topic}".encode(), b"json")
    body = struct.pack("<HH", number, 0)
    body += b"".join(struct.pack("<I", len(text)) + text for text in texts)
    return raw(4, body + bytes(4))  # no metadata


ONE = channel(1, "wavestart")


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (raw(5, bytes(99))[:39], "record must end by 39, got"),
        (raw(5, bytes(3)), "must have a whole head, got 3"),
        (raw(5, bytes(22)), "must be registered, got 0"),
        (b"\x05\x00", "record must have a whole head, got"),
        (raw(0x99, b"x"), "a message or its channel, got 153"),
        (raw(4, b"x"), "channel must be well-formed, got"),
        (raw(5, b"\x63" + bytes(21)) + ONE, "channel must be registered, got 99"),
        (ONE + channel(1, "workerreport"), "must keep its topic, got /workerreport"),
    ],
)
def test_a_chunk_that_holds_nonsense_under_a_good_checksum_is_refused(
    log: Path, content: bytes, rule: str
) -> None:
    chunk = zstd_chunk(content, len(content), "")
    chunk.uncompressed_crc = zlib.crc32(content)
    recording = crafted(log, chunk)
    with pytest.raises(RecordingError, match=rf"chunk 1: .*{rule}"):
        list(recording.messages())
