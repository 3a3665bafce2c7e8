"""Index scan: the layout of a recording, without reading its messages.

A finished recording says it in its summary, which has a checksum of its own. In one
that was cut short, still grows, or whose summary is damaged, the heads of its records
say it, and the walk from head to head goes on where it stopped once there is more. What
is no record is damage: the walk goes on behind it, from the next record that is surely
one. Where there is none the file was cut, be the rest missing, torn or zeros.

Chunks are not touched: each has a checksum of its own, and is verified when it is
unpacked. `neurosnap.recording.format.full_scan` verifies all there is.
"""

import io
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, MetadataIndex

from neurosnap.errors import RecordingError
from neurosnap.recording.format.facts import take_facts
from neurosnap.recording.format.records import (
    CHUNK_HEAD,
    FOOTER,
    HEAD,
    INDEX_ENTRY,
    INDEX_HEAD,
    LIMIT,
    MAGIC,
    Attached,
    Chunk,
    Cut,
    Damage,
    Layout,
    check_magic,
    damaged,
    library_of,
    opened,
    parse,
)
from neurosnap.recording.format.resync import chunk_at, find_record

_CHUNK_INDEX = struct.Struct("<QQQQI")
_OFFSET = struct.Struct("<HQ")
_PACKING = struct.Struct("<QI")
_SIZES = struct.Struct("<QQ")
_CRC = struct.Struct("<I")
_HEAD_OF_CHUNK = CHUNK_HEAD.size + 24  # with the longest name of a compression
_TORN = 0, b""  # no record has this kind
_FACTS = (Opcode.METADATA,)
_DATA_END = HEAD.size + _CRC.size
_MALFORMED = (struct.error, UnicodeDecodeError, ValueError, IndexError)


class IndexScan(msgspec.Struct):
    """What was seen of a file so far."""

    layout: Layout
    """Chunks and attachments as they are noted, not verified."""
    offset: int
    """Where the first record starts that was not seen, in a file without its end."""


def glance(path: Path) -> IndexScan:
    """Look at a recording. Time: as its summary is long, or its records are many.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        offset = _read_start(path, file, layout)
        if (place := _summary_place(file, layout.size)) is not None:
            whole = _begun(layout)
            try:
                _read_summary(path, file, whole, *place)
            except RecordingError:
                pass  # noted where the walk gets there
            else:
                return IndexScan(whole, whole.size)
        seen = IndexScan(layout, offset)
        _go_on(path, file, seen)
        return seen


def go_on(path: Path, seen: IndexScan) -> bool:
    """Look at what a file has gained; return whether that is anything.

    Raises:
        RecordingError: The file cannot be read.
    """
    with opened(path) as file:
        size = file.seek(0, io.SEEK_END)
        if size == seen.layout.size or seen.layout.cut is None:
            return False
        seen.layout.size = size
        _go_on(path, file, seen)
        return True


def _begun(layout: Layout) -> Layout:
    """Return what is known of a file before its first record behind the header."""
    start = [one for one in layout.damage if one.start == 0]
    return Layout(size=layout.size, library=layout.library, damage=start)


def _read_start(path: Path, file: BinaryIO, layout: Layout) -> int:
    """Read the magic and the header; return where the first record behind them starts.

    Raises:
        RecordingError: They are damaged, and no record shows whose recording it is.
    """
    try:
        file.seek(0)
        check_magic(path, file.read(len(MAGIC)))
        layout.library = library_of(path, *_record(path, file, len(MAGIC)))
        return file.tell()
    except RecordingError:  # ours all the same, if something in it is
        if find_record(path, file, 0, layout.size, only=_FACTS) is None:
            raise
    found = find_record(path, file, 0, layout.size) or 0
    why = "the file must start with the header of a recording, got something else"
    layout.damage.append(Damage(0, found, why, "unknown"))
    return found


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


def _summary_place(file: BinaryIO, size: int) -> tuple[int, int] | None:
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


def _read_summary(
    path: Path, file: BinaryIO, layout: Layout, start: int, end: int
) -> None:
    """Take over what a summary says.

    Args:
        path: The recording.
        file: The same, open.
        layout: Where to note it.
        start: Where it starts.
        end: Where its footer starts.

    Raises:
        RecordingError: It is not what was written.
    """
    if not _DATA_END <= start <= end or end - start > LIMIT:
        rule = "the footer must say where the summary starts"
        raise damaged(path, end, rule, start)
    file.seek(start)
    summary, footer = file.read(end - start), file.read(HEAD.size + FOOTER.size)
    _, _, noted = FOOTER.unpack_from(footer, HEAD.size)
    computed = zlib.crc32(footer[: -_CRC.size], zlib.crc32(summary))
    if noted != computed:
        rule = f"the summary must have checksum {noted:#010x}"
        raise damaged(path, start, rule, f"{computed:#010x}")
    try:
        at = 0
        while at < len(summary):
            opcode, length = HEAD.unpack_from(summary, at)
            at += HEAD.size
            _take_summed(path, file, layout, opcode, summary[at : at + length])
            at += length
    except _MALFORMED as error:
        rule = "the summary must be well-formed"
        raise damaged(path, start, rule, error) from error
    layout.data_end = start - _DATA_END
    layout.summarized = True


def _take_summed(
    path: Path, file: BinaryIO, layout: Layout, opcode: int, body: bytes
) -> None:
    match opcode:
        case Opcode.CHUNK_INDEX:
            layout.chunks.append(_indexed(layout, body))
        case Opcode.CHANNEL:
            channel: Channel = parse(Channel.read, body)
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
            _take_noted(path, file, layout, noted)
        case _:
            pass


def _take_noted(
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
            take_facts(layout, at, record[HEAD.size :])
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


# From head to head --------------------------------------------------------------------


def _go_on(path: Path, file: BinaryIO, seen: IndexScan) -> None:
    """Walk on from where the walk stopped, to the end or to where the file was cut."""
    layout = seen.layout
    layout.cut = None
    over = False
    while not over:
        try:
            over = _take_next(path, file, seen)
        except RecordingError as error:
            over = _leap(path, file, seen, str(error))


def _leap(path: Path, file: BinaryIO, seen: IndexScan, why: str) -> bool:
    """Go on behind what is no record; return whether nothing is there."""
    layout, at = seen.layout, seen.offset
    found = find_record(path, file, at + 1, layout.size)
    if found is None:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    layout.damage.append(Damage(at, found, why.removeprefix(f"{path}: "), "unknown"))
    seen.offset = found
    return False


def _take_next(path: Path, file: BinaryIO, seen: IndexScan) -> bool:
    """File the next record; return whether there is none."""
    layout, at = seen.layout, seen.offset
    file.seek(at)
    head = file.read(HEAD.size)
    if len(head) < HEAD.size:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    opcode, length = HEAD.unpack(head)
    after = at + HEAD.size + length
    if length > LIMIT:
        raise damaged(path, at, f"a record must have at most {LIMIT} bytes", length)
    if after > layout.size:
        raise damaged(path, at, f"a record must end by byte {layout.size}", after)
    try:
        match opcode:
            case Opcode.CHUNK:
                body = file.read(min(length, _HEAD_OF_CHUNK))
                number = len(layout.chunks) + 1
                layout.chunks.append(chunk_at(number, at, length, body))
            case Opcode.MESSAGE_INDEX:
                _take_index(layout, length, file.read(min(length, INDEX_HEAD.size)))
            case Opcode.METADATA:
                take_facts(layout, at, file.read(length))
            case Opcode.ATTACHMENT:
                _take_attachment(layout, at, file.read(length))
            case Opcode.DATA_END if length == _CRC.size:
                # Not passed: where what is behind it is torn, more may come.
                _take_end(path, file, layout, at)
                return True
            case _:
                raise ValueError(f"kind {opcode} of {length} bytes")
    except _MALFORMED as error:
        raise damaged(path, at, "a record must be well-formed", error) from error
    seen.offset = after
    return False


def _take_index(layout: Layout, length: int, body: bytes) -> None:
    channel, size = INDEX_HEAD.unpack(body)
    if size != length - INDEX_HEAD.size or size % INDEX_ENTRY:
        raise ValueError(f"a message index of {length} bytes that notes {size}")
    counts = layout.chunks[-1].counts
    counts[channel] = counts.get(channel, 0) + size // INDEX_ENTRY


def _take_attachment(layout: Layout, at: int, body: bytes) -> None:
    """File an attachment, whose record has a checksum."""
    attachment: Attachment = parse(Attachment.read, body)
    (noted,) = _CRC.unpack(body[-_CRC.size :])
    if zlib.crc32(memoryview(body)[: -_CRC.size]) != noted:
        raise ValueError("an attachment of another checksum")
    layout.attachments[attachment.name] = Attached(
        name=attachment.name,
        media_type=attachment.media_type,
        size=len(attachment.data),
        offset=at + HEAD.size,
        length=len(body),
    )


def _take_end(path: Path, file: BinaryIO, layout: Layout, at: int) -> None:
    """Take over what is behind the data: the summary, whole, torn or damaged.

    Args:
        path: The recording.
        file: The same, open.
        layout: What is known up to there.
        at: Where the record starts that ends the data.
    """
    layout.data_end = at
    start = at + _DATA_END
    footer = _footer(file, start, layout.size)
    if footer is None:
        file.seek(max(start, layout.size - len(MAGIC)))
        if file.read() != MAGIC:
            layout.cut = Cut(len(layout.chunks), start, layout.size)
            return
    whole = _begun(layout)
    try:
        if footer is None:
            rule = "the summary must end with its footer"
            raise damaged(path, start, rule, "something else")
        _read_summary(path, file, whole, start, footer)
    except RecordingError as error:
        why = str(error).removeprefix(f"{path}: ")
        layout.damage.append(Damage(start, layout.size, why, "nothing"))
        return
    # In place: whoever looks at the layout looks at this one.
    for name in ("metadata", "proved", "gaps", "damage", "chunks", "channels"):
        setattr(layout, name, getattr(whole, name))
    layout.attachments, layout.summarized = whole.attachments, True
    end = footer + HEAD.size + FOOTER.size + len(MAGIC)
    if end < layout.size:
        why = f"the file must end behind its footer, got {layout.size - end} bytes more"
        layout.damage.append(Damage(end, layout.size, why, "nothing"))


def _footer(file: BinaryIO, at: int, size: int) -> int | None:
    """Return where the footer starts, going from record to record; None: nowhere."""
    while at + HEAD.size <= size:
        file.seek(at)
        opcode, length = HEAD.unpack(file.read(HEAD.size))
        after = at + HEAD.size + length
        if opcode == Opcode.FOOTER and length == FOOTER.size:
            file.seek(after)
            return at if file.read(len(MAGIC)) == MAGIC else None
        if not opcode or length > LIMIT:
            return None
        at = after
    return None
