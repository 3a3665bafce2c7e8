"""The summary of a finished recording: what it says lies where.

It has a checksum of its own, so all of it is what was written, or none of it is taken.
"""

import io
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, MetadataIndex

from neurosnap.recording.format.records import (
    CRC,
    DATA_END,
    FOOTER,
    HEAD,
    INDEX_ENTRY,
    INDEX_HEAD,
    LIMIT,
    MAGIC,
    MALFORMED,
    Attached,
    Chunk,
    Damage,
    Layout,
    channel_of,
    damaged,
    file_metadata,
    heads,
    parse,
)

_CHUNK_INDEX = struct.Struct("<QQQQI")
_OFFSET = struct.Struct("<HQ")
_PACKING = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")


def summary_place(file: BinaryIO, size: int) -> tuple[int, int] | None:
    """Return where the summary starts and its footer does, by the end of the file."""
    tail = HEAD.size + FOOTER.size + len(MAGIC)
    end = size - tail
    if end < len(MAGIC):
        return None
    file.seek(end)
    last = file.read(tail)
    if not last.endswith(MAGIC) or last[0] != Opcode.FOOTER:
        return None
    start, _, _ = FOOTER.unpack_from(last, HEAD.size)
    return start, end


def read_summary(
    path: Path, file: BinaryIO, layout: Layout, start: int, end: int
) -> None:
    """Read what a summary says.

    Args:
        path: The recording.
        file: The same, open.
        layout: Where to note it.
        start: Where it starts.
        end: Where its footer starts.

    Raises:
        RecordingError: It is not what was written.
    """
    if not DATA_END <= start <= end or end - start > LIMIT:
        rule = "the footer must say where the summary starts"
        raise damaged(path, end, rule, start)
    file.seek(start)
    summary, footer = file.read(end - start), file.read(HEAD.size + FOOTER.size)
    _, _, noted = FOOTER.unpack_from(footer, HEAD.size)
    computed = zlib.crc32(footer[: -CRC.size], zlib.crc32(summary))
    if noted != computed:
        rule = f"the summary must have checksum {noted:#010x}"
        raise damaged(path, start, rule, f"{computed:#010x}")
    try:
        for opcode, body, after in heads(io.BytesIO(summary), 0, len(summary)):
            _file_summed(path, file, layout, opcode, summary[body:after])
    except MALFORMED as error:
        rule = "the summary must be well-formed"
        raise damaged(path, start, rule, error) from error
    layout.data_end = start - DATA_END
    layout.summarized = True


def _file_summed(
    path: Path, file: BinaryIO, layout: Layout, opcode: int, body: bytes
) -> None:
    match opcode:
        case Opcode.CHUNK_INDEX:
            layout.chunks.append(_indexed(layout, body))
        case Opcode.CHANNEL:
            channel = channel_of(body)
            layout.channels[channel.id] = channel
        case Opcode.ATTACHMENT_INDEX:
            attached: AttachmentIndex = parse(AttachmentIndex.read, body)
            layout.attachments[attached.name] = Attached(
                name=attached.name,
                media_type=attached.media_type,
                size=attached.data_size,
                offset=attached.offset + HEAD.size,
                length=attached.length - HEAD.size,
            )
        case Opcode.METADATA_INDEX:
            noted: MetadataIndex = parse(MetadataIndex.read, body)
            _file_noted(path, file, layout, noted)
        case _:
            pass


def _file_noted(
    path: Path, file: BinaryIO, layout: Layout, noted: MetadataIndex
) -> None:
    """File the metadata an index entry is of, or that it is damaged."""
    at, stop = noted.offset, noted.offset + noted.length
    # No file system seeks as far as a stranger's number may go.
    if stop > layout.size or noted.length < HEAD.size:
        raise ValueError(f"metadata up to byte {stop}")
    file.seek(at)
    record = file.read(noted.length)
    head = HEAD.pack(Opcode.METADATA, noted.length - HEAD.size)
    got = "another record"
    if record.startswith(head):
        try:
            file_metadata(layout, at, record[HEAD.size :])
        except ValueError as error:
            got = str(error)
        else:
            return
    why = f"metadata must be what was written, got {got}"
    layout.damage.append(Damage(at, stop, why, "nothing"))


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
    offset = at + length - packed
    if offset + packed > layout.size:
        raise ValueError(f"a chunk up to byte {offset + packed}")
    number = len(layout.chunks) + 1
    chunk = Chunk(number, offset, packed, unpacked, compression, start, end, counts)
    if chunk.start_offset != at:
        raise ValueError(f"a chunk of {length} bytes")
    return chunk
