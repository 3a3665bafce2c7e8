"""What lies where in a recording, found without reading what lies there.

A finished recording says it in its summary, which has a checksum of its own. In one
that was cut short, or still grows, the heads of its records say it, and the walk from
head to head goes on where it stopped once there is more. Chunks are not touched: each
has a checksum of its own, and is verified when it is unpacked.

That is less than `neurosnap.record.scan` does, which reads all and refuses what is
damaged anywhere: metadata and attachments are believed here, and whatever is wrong ends
the walk and is noted, so that what came before can still be looked at.
"""

import io
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, MetadataIndex

from neurosnap.errors import RecordingError
from neurosnap.record.layout import (
    CHUNK_HEAD,
    FOOTER,
    HEAD,
    INDEX_ENTRY,
    INDEX_HEAD,
    LIMIT,
    MAGIC,
    Chunk,
    Cut,
    Layout,
    check_magic,
    damaged,
    library_of,
    opened,
    parse,
)

_CHUNK_INDEX = struct.Struct("<QQQQI")
_OFFSET = struct.Struct("<HQ")
_PACKING = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")
_PACKED = struct.Struct("<Q")
_LONGEST = 16  # bytes a compression's name may have
_TORN = 0, b""  # no record has this kind


class Glance(msgspec.Struct):
    """What was seen of a file so far."""

    layout: Layout
    """Chunks without their checksums: `sealed` reads those. No attachments: what one
    is called is in its record, or in the summary alone."""
    offset: int
    """Where the first record starts that was not seen, in a file without its end."""
    trouble: str | None = None
    """Why nothing beyond can be read; None where more may come."""


def glance(path: Path) -> Glance:
    """Look at a recording. Time: as its summary is long, or its records are many.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        offset = _read_start(path, file, layout)
        trouble = None
        try:
            if _read_summary(path, file, layout):
                return Glance(layout, layout.size)
        except RecordingError as error:
            # What it was to say is found the long way; that it could not is said.
            trouble, library = str(error), layout.library
            layout = Layout(size=layout.size, library=library)
        seen = Glance(layout, offset)
        _go_on(path, file, seen)
        seen.trouble = trouble or seen.trouble
        return seen


def go_on(path: Path, seen: Glance) -> bool:
    """Look at what a file has gained; return whether that is anything.

    Raises:
        RecordingError: The file cannot be read.
    """
    with opened(path) as file:
        size = file.seek(0, io.SEEK_END)
        if size == seen.layout.size or seen.layout.cut is None or seen.trouble:
            return False
        seen.layout.size = size
        _go_on(path, file, seen)
        return True


def sealed(path: Path, file: BinaryIO, chunk: Chunk) -> Chunk:
    """Return a chunk with the checksum its own head notes.

    Raises:
        RecordingError: There is no such chunk at its place.
    """
    size = _chunk_head(chunk.compression)
    file.seek(chunk.offset - size)
    head = file.read(size)
    if len(head) < size or head[0] != Opcode.CHUNK:
        rule = f"chunk {chunk.number} must be where the summary says"
        raise damaged(path, chunk.offset, rule, "something else")
    _, _, unpacked, checksum, _ = CHUNK_HEAD.unpack_from(head, HEAD.size)
    if unpacked != chunk.unpacked:
        rule = f"chunk {chunk.number} must unpack to {chunk.unpacked} bytes"
        raise damaged(path, chunk.offset, rule, unpacked)
    return msgspec.structs.replace(chunk, checksum=checksum)


def _chunk_head(compression: str) -> int:
    """Return how many bytes of a chunk's record come before what is packed."""
    return HEAD.size + CHUNK_HEAD.size + len(compression.encode()) + 8


def _read_start(path: Path, file: BinaryIO, layout: Layout) -> int:
    """Read the magic and the header; return where that ends."""
    file.seek(0)
    check_magic(path, file.read(len(MAGIC)))
    layout.library = library_of(path, *_record(path, file, len(MAGIC)))
    return file.tell()


def _record(path: Path, file: BinaryIO, at: int) -> tuple[int, bytes]:
    """Return kind and body of the record at a place."""
    file.seek(at)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        return _TORN
    opcode, length = HEAD.unpack(head)
    if length > LIMIT:
        rule = f"a record must have at most {LIMIT} bytes"
        raise damaged(path, at, rule, length)
    body = file.read(length)
    return (opcode, body) if len(body) == length else _TORN


# By the summary -----------------------------------------------------------------------


def _read_summary(path: Path, file: BinaryIO, layout: Layout) -> bool:
    """Take over what the summary says; return whether there is one."""
    tail = HEAD.size + FOOTER.size + len(MAGIC)
    end = layout.size - tail
    if end < len(MAGIC):
        return False
    file.seek(end)
    last = file.read(tail)
    if not last.endswith(MAGIC) or last[0] != Opcode.FOOTER:
        return False
    start, _, checksum = FOOTER.unpack_from(last, HEAD.size)
    if not 0 < start <= end or end - start > LIMIT:
        raise damaged(path, end, "the footer must name the summary's place", start)
    file.seek(start)
    summary = file.read(end - start)
    covered = last[: HEAD.size + FOOTER.size - 4]
    if zlib.crc32(covered, zlib.crc32(summary)) != checksum:
        rule = "the summary must have the checksum noted here"
        raise damaged(path, end, rule, "another")
    try:
        at = 0
        while at < len(summary):
            opcode, length = HEAD.unpack_from(summary, at)
            at += HEAD.size
            _take_summed(path, file, layout, opcode, summary[at : at + length])
            at += length
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        rule = "the summary must be well-formed"
        raise damaged(path, start, rule, error) from error
    return True


def _take_summed(
    path: Path, file: BinaryIO, layout: Layout, opcode: int, body: bytes
) -> None:
    match opcode:
        case Opcode.CHUNK_INDEX:
            layout.chunks.append(_indexed(layout, body))
        case Opcode.CHANNEL:
            channel: Channel = parse(Channel.read, body)
            layout.channels[channel.id] = channel
        case Opcode.METADATA_INDEX:
            noted: MetadataIndex = parse(MetadataIndex.read, body)
            # No file system seeks as far as a stranger's number may go.
            there = noted.offset < layout.size
            kind, metadata = _record(path, file, noted.offset) if there else _TORN
            if kind != Opcode.METADATA:
                raise ValueError(f"no metadata at byte {noted.offset}")
            _take_metadata(layout, metadata)
        case _:
            pass


def _indexed(layout: Layout, body: bytes) -> Chunk:
    """Return the chunk an index entry is of.

    How many messages of a channel it has is told by where the channel's message index
    ends: there the next one starts, or all of them end.
    """
    start, end, at, length, size = _CHUNK_INDEX.unpack_from(body)
    entries = body[_CHUNK_INDEX.size : _CHUNK_INDEX.size + size]
    after = _CHUNK_INDEX.size + size
    indexes, name = _PACKING.unpack_from(body, after)
    after += _PACKING.size
    compression = body[after : after + name].decode()
    packed, unpacked = _SIZES.unpack_from(body, after + name)
    if unpacked > LIMIT or packed > LIMIT:
        raise ValueError(f"a chunk of {max(packed, unpacked)} bytes")
    placed = sorted((place, channel) for channel, place in _OFFSET.iter_unpack(entries))
    ends = [place for place, _ in placed[1:]] + [at + length + indexes]
    counts = {
        channel: (upto - place - HEAD.size - INDEX_HEAD.size) // INDEX_ENTRY
        for (place, channel), upto in zip(placed, ends, strict=True)
    }
    offset = at + _chunk_head(compression)
    if offset + packed > layout.size:
        raise ValueError(f"a chunk up to byte {offset + packed}")
    number = len(layout.chunks) + 1
    return Chunk(number, offset, packed, unpacked, 0, compression, start, end, counts)


def _take_metadata(layout: Layout, body: bytes) -> None:
    metadata: Metadata = parse(Metadata.read, body)
    layout.metadata[metadata.name] = metadata.metadata


# From head to head --------------------------------------------------------------------


def _go_on(path: Path, file: BinaryIO, seen: Glance) -> None:
    """Walk on from where the walk stopped, to the end or to what is torn there."""
    layout = seen.layout
    layout.cut = None
    try:
        while not _is_over(path, file, seen):
            pass
    except RecordingError as error:
        seen.trouble = str(error)
        layout.cut = Cut(len(layout.chunks), seen.offset, layout.size)


def _is_over(path: Path, file: BinaryIO, seen: Glance) -> bool:
    """File the next record; return whether there is none that is whole."""
    layout, at = seen.layout, seen.offset
    file.seek(at)
    head = file.read(HEAD.size)
    opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
    after = at + HEAD.size + length
    if len(head) == HEAD.size and length > LIMIT:
        raise damaged(path, at, f"a record must have at most {LIMIT} bytes", length)
    if len(head) < HEAD.size or after > layout.size:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    try:
        match opcode:
            case Opcode.CHUNK:
                body = file.read(min(length, CHUNK_HEAD.size + _LONGEST + 8))
                layout.chunks.append(_headed(layout, at, length, body))
            case Opcode.MESSAGE_INDEX:
                channel, size = INDEX_HEAD.unpack(file.read(INDEX_HEAD.size))
                counts = layout.chunks[-1].counts
                counts[channel] = counts.get(channel, 0) + size // INDEX_ENTRY
            case Opcode.METADATA:
                _take_metadata(layout, file.read(length))
            case Opcode.ATTACHMENT:
                pass
            case Opcode.DATA_END:
                # Its summary is as good as written: it is looked at next.
                return _end(path, file, seen)
            case _:
                raise damaged(path, at, "the data must hold no such record", opcode)
    except (struct.error, UnicodeDecodeError, ValueError, IndexError) as error:
        raise damaged(path, at, "a record must be well-formed", error) from error
    seen.offset = after
    return False


def _headed(layout: Layout, at: int, length: int, body: bytes) -> Chunk:
    """Return the chunk whose record starts so."""
    start, end, unpacked, checksum, name = CHUNK_HEAD.unpack_from(body)
    if name > _LONGEST:
        raise ValueError(f"a compression with a name of {name} bytes")
    compression = body[CHUNK_HEAD.size : CHUNK_HEAD.size + name].decode()
    offset = at + _chunk_head(compression)
    packed = at + HEAD.size + length - offset
    (noted,) = _PACKED.unpack_from(body, CHUNK_HEAD.size + name)
    if noted != packed:
        raise ValueError(f"a chunk of {packed} bytes that notes {noted}")
    if unpacked > LIMIT:
        raise ValueError(f"a chunk that unpacks to {unpacked} bytes")
    number = len(layout.chunks) + 1
    return Chunk(
        number, offset, packed, unpacked, checksum, compression, start, end, {}
    )


def _end(path: Path, file: BinaryIO, seen: Glance) -> bool:
    """Take over the summary of a file that has just got its end; it may be torn."""
    whole = Layout(size=seen.layout.size, library=seen.layout.library)
    if _read_summary(path, file, whole):
        # In place: whoever looks at the layout looks at this one.
        for name in ("metadata", "chunks", "channels"):
            setattr(seen.layout, name, getattr(whole, name))
        seen.offset = seen.layout.size
        return True
    seen.layout.cut = Cut(len(seen.layout.chunks), seen.offset, seen.layout.size)
    return True
