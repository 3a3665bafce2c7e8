"""Recordings cut anywhere, flipped anywhere, and made to hurt."""

import random
import tracemalloc
import zlib
from pathlib import Path

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, Header, Message, Metadata
from mcap.stream_reader import StreamReader

from neurosnap.errors import RecordingError
from neurosnap.record.layout import LIMIT
from neurosnap.record.reader import Recording
from neurosnap.record.sequences import Completeness
from tests.unit.record.samples import EACH, delivered, record, traffic

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


def whole_chunks(path: Path) -> list[bytes]:
    """Return the payloads up to the last whole chunk, as the library finds them."""
    payloads = []
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Message):
                    payloads.append(record.data)
        except Exception:  # noqa: BLE001  # many kinds, and all mean: no further
            pass
    return payloads


@pytest.mark.slow
def test_cut_anywhere_it_gives_the_whole_chunks(
    finished: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "cut.mcap"
    known = [delivery.payload for delivery in DELIVERIES]
    header = len(MAGIC) + 9 + int.from_bytes(finished[9:17], "little")
    path.write_bytes(finished)
    ends = [c.offset + c.packed for c in Recording.open(path).layout.chunks]
    offsets = {*range(header, len(finished), 41), header, len(finished) - 1}
    offsets |= {end + near for end in ends for near in (-1, 0, 1, 8, 9)}
    assert len(offsets) > 100
    lengths = set()
    for offset in sorted(offsets):
        path.write_bytes(finished[:offset])
        recording = Recording.open(path)
        payloads = [recorded.payload for recorded in recording.messages()]
        assert payloads == known[: len(payloads)]
        assert payloads == whole_chunks(path)
        assert recording.cut is not None
        assert recording.cut.size == offset
        assert recording.cut.chunks == sum(end <= offset for end in ends)
        lengths.add(len(payloads))
    assert lengths == {0, 20, 40, 60, 80, 100, 120, 140, 151}


def test_cut_in_its_header_it_is_refused(finished: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    header = len(MAGIC) + 9 + int.from_bytes(finished[9:17], "little")
    for offset in range(header):
        path.write_bytes(finished[:offset])
        with pytest.raises(RecordingError, match=r"must be an MCAP|whole header"):
            Recording.open(path)


def test_cut_behind_its_totals_it_keeps_them(finished: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(finished[:-3])
    recording = Recording.open(path)
    assert not recording.finished
    assert recording.totals is not None
    assert recording.snapshot == bytes(range(256))
    assert recording.completeness() == Completeness(151)


def test_cut_before_its_totals_gaps_show_but_not_the_tail(tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    early = [delivery for delivery in DELIVERIES if delivery.key == "observe"]
    record(path, [*early[:2], *early[3:5]], finish=False)
    assert Recording.open(path).completeness() == Completeness(4, {"world": 1})


@pytest.mark.slow
def test_a_flipped_bit_in_a_finished_recording_is_noticed_when_it_is_opened(
    finished: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "flipped.mcap"
    draw = random.Random(1)
    ends = (*range(64), *range(len(finished) - 64, len(finished)))
    for offset in (*ends, *draw.sample(range(len(finished)), 800)):
        damaged = bytearray(finished)
        damaged[offset] ^= 1 << draw.randrange(8)
        path.write_bytes(damaged)
        with pytest.raises(RecordingError):
            Recording.open(path)


@pytest.mark.slow
def test_a_flipped_bit_in_a_cut_recording_never_gives_a_wrong_message(
    abandoned: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "flipped.mcap"
    draw = random.Random(2)
    noticed = 0
    for offset in draw.sample(range(len(abandoned)), 800):
        damaged = bytearray(abandoned)
        damaged[offset] ^= 1 << draw.randrange(8)
        path.write_bytes(damaged)
        try:
            read = [recorded.delivery for recorded in Recording.open(path).messages()]
        except RecordingError:
            noticed += 1
        else:
            assert read == DELIVERIES[: len(read)]
    assert noticed > 500


def test_damage_names_its_place(
    abandoned: bytes, finished: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "flipped.mcap"
    for whole in (abandoned, finished):
        path.write_bytes(whole)
        chunk = Recording.open(path).layout.chunks[3]
        damaged = bytearray(whole)
        damaged[chunk.offset + chunk.packed // 2] ^= 1
        path.write_bytes(damaged)
        place = rf"flipped.mcap: at byte {chunk.offset}: chunk 4 must"
        with pytest.raises(RecordingError, match=place):
            list(Recording.open(path).messages())


def test_what_comes_before_the_damage_is_still_given(
    abandoned: bytes, tmp_path: Path
) -> None:
    path = tmp_path / "flipped.mcap"
    path.write_bytes(abandoned)
    chunk = Recording.open(path).layout.chunks[3]
    damaged = bytearray(abandoned)
    damaged[chunk.offset + chunk.packed // 2] ^= 1
    path.write_bytes(damaged)
    read = []
    with pytest.raises(RecordingError, match="chunk 4"):
        for recorded in Recording.open(path).messages():
            read.append(recorded.delivery)
    assert read == DELIVERIES[:60]


def test_bytes_behind_the_end_are_noticed(finished: bytes, tmp_path: Path) -> None:
    path = tmp_path / "longer.mcap"
    for more in (b"\0", MAGIC, finished):
        path.write_bytes(finished + more)
        with pytest.raises(RecordingError, match="the file must end behind its footer"):
            Recording.open(path)


def crafted(path: Path, chunk: Chunk | Message) -> Recording:
    """Open a file that was never finished and holds one record besides its metadata."""
    builder = RecordBuilder()
    builder.write(MAGIC)
    Header("neurosnap", "a stranger").write(builder)
    Metadata("neurosnap.run", {"schema": "1"}).write(builder)
    chunk.write(builder)
    path.write_bytes(builder.end())
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


def test_a_chunk_that_claims_too_much_is_refused_unread(tmp_path: Path) -> None:
    with pytest.raises(
        RecordingError, match="a chunk must unpack to at most 268435456"
    ):
        crafted(tmp_path / "bomb", zstd_chunk(b"", LIMIT + 1))


@pytest.mark.parametrize("says_its_size", [True, False])
def test_a_chunk_that_unpacks_to_more_than_it_claims_takes_no_memory(
    tmp_path: Path, says_its_size: bool
) -> None:
    compressor = zstandard.ZstdCompressor(write_content_size=says_its_size)
    bomb = compressor.compress(bytes(64 * 2**20))
    recording = crafted(tmp_path / "bomb", zstd_chunk(bomb, 1000))
    tracemalloc.start()
    with pytest.raises(RecordingError, match="chunk 1 must unpack to 1000 bytes, got"):
        list(recording.messages())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2**20


def test_a_record_that_claims_too_much_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "bomb"
    crafted(path, zstd_chunk(b"", 0))
    with path.open("ab") as file:
        file.write(b"\x06" + (LIMIT + 1).to_bytes(8, "little"))
    with pytest.raises(RecordingError, match="a record must have at most 268435456"):
        Recording.open(path)


def test_other_compressions_are_refused(tmp_path: Path) -> None:
    recording = crafted(tmp_path / "other", zstd_chunk(b"", 0, "lz4"))
    with pytest.raises(
        RecordingError, match="packed with zstd or not at all, got 'lz4'"
    ):
        list(recording.messages())


def test_a_chunk_without_a_checksum_is_refused(tmp_path: Path) -> None:
    recording = crafted(tmp_path / "unsure", zstd_chunk(b"\x03" + bytes(8), 9, ""))
    with pytest.raises(
        RecordingError, match="chunk 1 must have checksum 0x00000000, got"
    ):
        list(recording.messages())


def test_a_message_outside_chunks_is_refused(tmp_path: Path) -> None:
    message = Message(1, 0, b"no checksum covers it", 0, 0)
    with pytest.raises(
        RecordingError, match=r"the data must hold no such record, got 5$"
    ):
        crafted(tmp_path / "loose", message)


@pytest.mark.parametrize(
    ("content", "rule"),
    [
        (
            b"\x05" + (99).to_bytes(8, "little") + bytes(30),
            "record must end by 39, got",
        ),
        (
            b"\x05" + (3).to_bytes(8, "little") + bytes(3),
            "must have a whole head, got 3",
        ),
        (b"\x05" + (22).to_bytes(8, "little") + bytes(22), "must be registered, got 0"),
        (b"\x05\x00", "record must have a whole head, got"),
        (
            b"\x99" + (1).to_bytes(8, "little") + b"x",
            "a message or its channel, got 153",
        ),
        (
            b"\x04" + (1).to_bytes(8, "little") + b"x",
            "channel must be well-formed, got",
        ),
    ],
)
def test_a_chunk_that_holds_nonsense_under_a_good_checksum_is_refused(
    tmp_path: Path, content: bytes, rule: str
) -> None:
    chunk = zstd_chunk(content, len(content), "")
    chunk.uncompressed_crc = zlib.crc32(content)
    recording = crafted(tmp_path / "nonsense", chunk)
    with pytest.raises(RecordingError, match=rf"chunk 1: .*{rule}"):
        list(recording.messages())
