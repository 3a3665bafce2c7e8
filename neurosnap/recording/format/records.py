"""Parses and iterates over MCAP records; errors give their file position.

The records in a chunk are walked in `neurosnap.recording.format.chunk_index`, compiled.
"""

import io
import stat
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Literal, TypeAlias, TypeVar

import msgspec
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.records import Metadata

from neurosnap.errors import NoRecordingError, RecordingError

PROFILE = "neurosnap"
RUN = "neurosnap.run"
TOTALS = "neurosnap.totals"
SHARE = "neurosnap.share"
"""Where a file is not the first of its run: what number each sender's share begins
with."""
GAP = "neurosnap.gap"
"""Between chunks: messages are missing here, and no number shows that."""
CLOSING = "decision"
"""Among the totals of a file that another follows: the decision of its last tick, as on
the wire, where it opens the next file."""
LIMIT = 256 * 2**20
"""The largest record, and the largest chunk once unpacked, that is read at all: a
stranger's file may claim any size. The writer stays below it."""
FLOOR = 64 * 2**20
"""Bytes that the chunks of a file may unpack to in all, however small it is."""
RATIO = 512
"""Bytes more for each byte of the file up to their end. Recordings in `tests/golden`
reach 12, those of `tools/bench` 74 with 1,000 sensors and 258 with 7,000; a writer pads
a file that would pass it."""

# The format's own layout, little-endian without padding, as far as it is read here and
# not by `mcap.records`: https://mcap.dev/spec.
MAGIC = b"\x89MCAP0\r\n"
"""The first bytes of a file, and its last."""
HEAD = struct.Struct("<BQ")
"""Of a record: its kind, and the bytes behind this."""
CHUNK_HEAD = struct.Struct("<QQQII")
"""Of a chunk: its first and last time, bytes unpacked, checksum, and how long the name
of its compression is."""
FOOTER = struct.Struct("<QQI")
"""Where the summary starts, and its offsets; its checksum, up to here."""
CRC = struct.Struct("<I")
"""A checksum."""
MALFORMED = (struct.error, UnicodeDecodeError, ValueError, IndexError)
"""What reading the body of a record raises."""
_Record = TypeVar("_Record")


class Chunk(msgspec.Struct, frozen=True):
    """Where a chunk's packed messages lie, and what its header says of them."""

    number: int
    """Counts from 1."""
    start_offset: int
    """Where the record starts."""
    offset: int
    """Where the packed messages start."""
    packed: int
    """Bytes in the file."""
    unpacked: int
    """Bytes once unpacked."""
    checksum: int
    """Of these."""
    compression: str
    """`zstd`, or empty where nothing is packed."""
    start: int
    """Time of the earliest message."""
    end: int
    """Time of the latest message."""
    counts: dict[int, int]
    """Messages a channel, from the indexes behind the chunk."""

    @property
    def stop_offset(self) -> int:
        """Where the record ends."""
        return self.offset + self.packed


def room(size: int) -> int:
    """Return how many bytes the chunks in so many bytes of a file may unpack to."""
    return FLOOR + RATIO * size


class Cut(msgspec.Struct, frozen=True):
    """Where a recording ends that was never finished."""

    chunks: int
    """Whole chunks before the cut."""
    offset: int
    """Where the last whole record ends."""
    size: int
    """Where the file ends."""


class Damage(msgspec.Struct, frozen=True):
    """Bytes of a file that cannot be read, or cannot be trusted."""

    start: int
    stop: int
    """Where what can be read goes on."""
    why: str
    """The rule that is broken there, and by what."""
    lost: Literal["chunk", "unknown", "nothing"]
    """Messages that are missing for it: those of a chunk, perhaps some, or none."""


class Gap(msgspec.Struct, frozen=True):
    """A place where messages are missing, as a writer noted it."""

    offset: int
    why: str


class Layout(msgspec.Struct):
    """The records of one file, without the messages in its chunks."""

    size: int = 0
    metadata: dict[str, dict[str, str]] = {}
    first: Chunk | None = None
    """The first chunk, in which a writer of ours registers all channels."""
    chunks: list[Chunk] = []
    """Those that can be read; all, until they are verified."""
    cut: Cut | None = None
    damage: list[Damage] = []
    """What cannot be read, ascending; whatever is behind a cut is not in here."""
    unpacked: int = 0
    """Bytes that `chunks` unpack to, and those unpacked in vain to find one."""
    gaps: list[Gap] = []
    """Where messages are missing that no damage of this file explains."""
    data_end: int | None = None
    """Where the record starts that ends the data; None if it was not found."""
    summarized: bool = False
    """There is a summary, and its checksum is right."""
    sure: bool = False
    """The checksum of the whole data section was there and right."""
    walked: int = 0
    """Where the first record starts that was not seen, in a file without its end."""

    def claim(self, size: int, stop: int) -> str:
        """Count what a chunk that ends at `stop` unpacks to; return why it must not."""
        if size > (left := room(stop) - self.unpacked):
            return f"a chunk here must unpack to at most {left} bytes, got {size}"
        self.unpacked += size
        return ""

    @property
    def sealed(self) -> bool:
        """Finished, and the checksums of data and summary were there and right."""
        return self.sure and self.summarized and not self.damage

    @property
    def indexed(self) -> bool:
        """The counts of every chunk can be relied on."""
        return self.sealed and all(chunk.counts for chunk in self.chunks)


@contextmanager
def opened(path: Path) -> Iterator[BinaryIO]:
    """Open a recording; turn what the file system says into errors of ours."""
    shown = repr(str(path))
    try:
        # A pipe or a device could be read for ever.
        if not stat.S_ISREG(path.stat().st_mode):
            raise NoRecordingError(f"log: must be a file, got {shown}")
        file = path.open("rb")
    except FileNotFoundError as error:
        raise NoRecordingError(f"log: must exist, got {shown}") from error
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        rule = f"must be readable, got {shown} ({error})"
        raise NoRecordingError(f"log: {rule}") from error
    try:
        with file:
            yield file
    except OSError as error:
        raise RecordingError(f"log: must be readable, got {shown} ({error})") from error


def damaged(path: Path, offset: int, rule: str, got: object) -> RecordingError:
    """Return the error for a recording that is not what was written."""
    return RecordingError(f"{path}: at byte {offset}: {rule}, got {got}")


def damaged_in(path: Path, chunk: Chunk, rule: str, got: object) -> RecordingError:
    """Return the error for a chunk that holds what was not written."""
    return damaged(path, chunk.offset, f"chunk {chunk.number}: {rule}", got)


def parse(read: Callable[[ReadDataStream], _Record], body: bytes) -> _Record:
    """Return the record in `body`, as its class reads it.

    Raises:
        ValueError: It is not one whole record of this kind.
    """
    stream = ReadDataStream(io.BytesIO(body))
    try:
        record = read(stream)
    except (McapError, struct.error, UnicodeDecodeError, OverflowError) as error:
        raise ValueError(str(error) or "a record that ends too soon") from error
    if stream.count != len(body):
        raise ValueError(f"{len(body) - stream.count} bytes beyond its end")
    return record


Head: TypeAlias = tuple[int, int, int]
"""Of a record: its kind, where its body starts, and where it ends."""


def heads(file: BinaryIO, start: int, end: int) -> Iterator[Head]:
    """Yield the head of each record in a range; then the file stands at the body.

    Cost: a read for each record. Bodies are not read, so nothing is verified but that
    each record fits.

    Args:
        file: Open for reading; it may be moved meanwhile.
        start: Where the first record starts.
        end: The byte behind the last one.

    Raises:
        ValueError: While iterating: the next record is longer than can be.
    """
    at = start
    while at < end:
        file.seek(at)
        data = file.read(HEAD.size)
        body = at + HEAD.size
        if len(data) < HEAD.size:
            raise ValueError(f"a record must have a whole head, got {len(data)} bytes")
        opcode, length = HEAD.unpack(data)
        if length > LIMIT:
            raise ValueError(f"a record must have at most {LIMIT} bytes, got {length}")
        at = body + length
        if at > end:
            raise ValueError(f"a record must end by byte {end}, got {at}")
        yield opcode, body, at


# Metadata --------------------------------------------------------------------------
# The format has one checksum for all of the data, at their end: in a file that is
# damaged anywhere, or has no end, nothing else says whether metadata is right. So each
# has a checksum of its own. Metadata without one is damage.

CHECKSUM = "crc"
"""The fact that is the checksum of the others."""


def checksum(name: str, facts: Mapping[str, str]) -> str:
    """Return the CRC-32 of metadata, in hexadecimal digits; `CHECKSUM` is left out."""
    texts = sorted((k, v) for k, v in facts.items() if k != CHECKSUM)
    return f"{zlib.crc32(msgspec.json.encode([name, texts])):08x}"


def sealed_facts(name: str, facts: Mapping[str, str]) -> dict[str, str]:
    """Return metadata with its checksum."""
    return {**facts, CHECKSUM: checksum(name, facts)}


def read_facts(body: bytes) -> tuple[str, dict[str, str]]:
    """Return name and content of metadata, verified by its checksum.

    Raises:
        ValueError: It is not what was written.
    """
    metadata: Metadata = parse(Metadata.read, body)
    name, facts = metadata.name, dict(metadata.metadata)
    noted = facts.pop(CHECKSUM, None)
    if noted is None:
        raise ValueError("no checksum")
    if noted != (computed := checksum(name, facts)):
        raise ValueError(f"checksum {computed} for {noted}")
    return name, facts
