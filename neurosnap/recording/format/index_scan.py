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
import zlib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Attachment

from neurosnap.errors import RecordingError
from neurosnap.recording.format.facts import take_facts
from neurosnap.recording.format.records import (
    CRC,
    DATA_END,
    FOOTER,
    HEAD,
    INDEX_ENTRY,
    INDEX_HEAD,
    MAGIC,
    MALFORMED,
    Attached,
    Cut,
    Damage,
    Layout,
    check_magic,
    damaged,
    library_of,
    opened,
    parse,
)
from neurosnap.recording.format.resync import HEAD_OF_CHUNK, chunk_at, find_record
from neurosnap.recording.format.summary import read_summary, summary_place
from neurosnap.recording.format.walk import heads

_TORN = 0, b""  # no record has this kind
_FACTS = (Opcode.METADATA,)


class IndexScan(msgspec.Struct):
    """What was seen of a file so far."""

    layout: Layout
    """Chunks and attachments as they are noted, not verified."""
    offset: int
    """Where the first record starts that was not seen, in a file without its end."""


def scan_index(path: Path) -> IndexScan:
    """Look at a recording. Time: as its summary is long, or its records are many.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        offset = _read_start(path, file, layout)
        if (place := summary_place(file, layout.size)) is not None:
            whole = _begun(layout)
            try:
                read_summary(path, file, whole, *place)
            except RecordingError:
                pass  # noted where the walk gets there
            else:
                return IndexScan(whole, whole.size)
        seen = IndexScan(layout, offset)
        _go_on(path, file, seen)
        return seen


def scan_growth(path: Path, seen: IndexScan) -> bool:
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
        layout.library = library_of(path, *_header(file, layout.size))
        return file.tell()
    except RecordingError:  # ours all the same, if something in it is
        if find_record(path, file, 0, layout.size, only=_FACTS) is None:
            raise
    found = find_record(path, file, 0, layout.size) or 0
    why = "the file must start with the header of a recording, got something else"
    layout.damage.append(Damage(0, found, why, "unknown"))
    return found


def _header(file: BinaryIO, size: int) -> tuple[int, bytes]:
    """Return kind and body of the first record."""
    try:
        head = next(heads(file, len(MAGIC), size), None)
    except ValueError:
        head = None
    if head is None:
        return _TORN
    opcode, body, after = head
    return opcode, file.read(after - body)


def _go_on(path: Path, file: BinaryIO, seen: IndexScan) -> None:
    """Walk on from where the walk stopped, to the end or to where the file was cut."""
    seen.layout.cut = None
    over = False
    while not over:
        try:
            _take_records(path, file, seen)
        except ValueError as error:
            over = _leap(path, file, seen, f"at byte {seen.offset}: {error}")
        else:
            over = True


def _leap(path: Path, file: BinaryIO, seen: IndexScan, why: str) -> bool:
    """Go on behind what is no record; return whether nothing is there."""
    layout, at = seen.layout, seen.offset
    found = find_record(path, file, at + 1, layout.size)
    if found is None:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    layout.damage.append(Damage(at, found, why, "unknown"))
    seen.offset = found
    return False


def _take_records(path: Path, file: BinaryIO, seen: IndexScan) -> None:
    """File the records up to the end of the data, or of the file.

    Raises:
        ValueError: What follows is no record of ours.
    """
    layout = seen.layout
    for opcode, body, after in heads(file, seen.offset, layout.size):
        if opcode == Opcode.DATA_END and after - body == CRC.size:
            # Not passed: where what is behind it is torn, more may come.
            _take_end(path, file, layout, seen.offset)
            return
        try:
            _take(file, layout, opcode, body, after - body)
        except MALFORMED as error:
            raise ValueError(f"a record must be well-formed, got {error}") from error
        seen.offset = after
    layout.cut = Cut(len(layout.chunks), seen.offset, layout.size)


def _take(file: BinaryIO, layout: Layout, opcode: int, body: int, length: int) -> None:
    """File the record whose body is next in the file."""
    at = body - HEAD.size
    match opcode:
        case Opcode.MESSAGE_INDEX:
            _take_index(layout, length, file.read(min(length, INDEX_HEAD.size)))
        case Opcode.CHUNK:
            start = file.read(min(length, HEAD_OF_CHUNK))
            number = len(layout.chunks) + 1
            layout.chunks.append(chunk_at(number, at, length, start))
        case Opcode.METADATA:
            take_facts(layout, at, file.read(length))
        case Opcode.ATTACHMENT:
            _take_attachment(layout, at, file.read(length))
        case _:
            raise ValueError(f"kind {opcode} of {length} bytes")


def _take_index(layout: Layout, length: int, body: bytes) -> None:
    channel, size = INDEX_HEAD.unpack(body)
    if size != length - INDEX_HEAD.size or size % INDEX_ENTRY:
        raise ValueError(f"a message index of {length} bytes that notes {size}")
    counts = layout.chunks[-1].counts
    counts[channel] = counts.get(channel, 0) + size // INDEX_ENTRY


def _take_attachment(layout: Layout, at: int, body: bytes) -> None:
    """File an attachment, whose record has a checksum."""
    attachment: Attachment = parse(Attachment.read, body)
    (noted,) = CRC.unpack(body[-CRC.size :])
    if zlib.crc32(memoryview(body)[: -CRC.size]) != noted:
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
    start = at + DATA_END
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
        read_summary(path, file, whole, start, footer)
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


def _footer(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the footer starts, going from record to record; None: nowhere."""
    with suppress(ValueError):
        for opcode, body, after in heads(file, start, size):
            if opcode == Opcode.FOOTER and after - body == FOOTER.size:
                file.seek(after)
                at = body - HEAD.size
                return at if file.read(len(MAGIC)) == MAGIC else None
            if not opcode:
                break
    return None
