"""Finds out what lies where in a recording, and verifies it.

A finished recording says it in its summary, which has a checksum of its own. In one
that was cut short, still grows, or whose summary is damaged, the heads of its records
say it, and the walk from head to head goes on where it stopped once there is more. What
is no record is damage: the walk goes on behind it, from the next record that is surely
one. Where there is none the file was cut, be the rest missing, torn or zeros.

`scan_index` does that, and touches no chunk: each has a checksum of its own, and is
verified when it is unpacked. `scan` verifies all there is. In a finished file the data
section and the summary have a checksum each: where both are right, all is. Where one is
missing or wrong, every chunk is unpacked and held against its own checksum, and what
does not match is damage. So nothing of what is handed out here can be wrong.
"""

import bisect
import io
import zlib
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Attachment

from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunks import (
    HEAD_OF_CHUNK,
    chunk_at,
    find_record,
    unpack,
)
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
    Chunk,
    Cut,
    Damage,
    Layout,
    check_magic,
    damaged,
    file_metadata,
    heads,
    library_of,
    opened,
    parse,
)
from neurosnap.recording.format.summary import read_summary, summary_place

_BLOCK = 1 << 20
_ZEROS = 8  # bytes that no packed chunk ends with, if all of them are 0
_TORN = 0, b""  # no record has this kind
_FACTS = (Opcode.METADATA,)


def scan_index(path: Path) -> Layout:
    """Find out what lies where; chunks and attachments as they are noted, not verified.

    Time: as its summary is long, or its records are many.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        layout.walked = _read_start(path, file, layout)
        if (place := summary_place(file, layout.size)) is not None:
            whole = _begun(layout)
            try:
                read_summary(path, file, whole, *place)
            except RecordingError:
                pass  # noted where the walk gets there
            else:
                whole.walked = whole.size
                return whole
        _walk_on(path, file, layout)
        return layout


def scan_growth(path: Path, layout: Layout) -> bool:
    """Add what a file has gained since it was scanned; return whether that is anything.

    Raises:
        RecordingError: The file cannot be read.
    """
    with opened(path) as file:
        size = file.seek(0, io.SEEK_END)
        if size == layout.size or layout.cut is None:
            return False
        layout.size = size
        _walk_on(path, file, layout)
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


def _walk_on(path: Path, file: BinaryIO, layout: Layout) -> None:
    """Walk on from where the walk stopped, to the end or to where the file was cut."""
    layout.cut = None
    over = False
    while not over:
        try:
            _file_records(path, file, layout)
        except ValueError as error:
            over = _leap(path, file, layout, f"at byte {layout.walked}: {error}")
        else:
            over = True


def _leap(path: Path, file: BinaryIO, layout: Layout, why: str) -> bool:
    """Go on behind what is no record; return whether nothing is there."""
    at = layout.walked
    found = find_record(path, file, at + 1, layout.size)
    if found is None:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    layout.damage.append(Damage(at, found, why, "unknown"))
    layout.walked = found
    return False


def _file_records(path: Path, file: BinaryIO, layout: Layout) -> None:
    """File the records up to the end of the data, or of the file.

    Raises:
        ValueError: What follows is no record of ours.
    """
    for opcode, body, after in heads(file, layout.walked, layout.size):
        if opcode == Opcode.DATA_END and after - body == CRC.size:
            # Not passed: where what is behind it is torn, more may come.
            _file_end(path, file, layout, layout.walked)
            return
        try:
            _file_record(file, layout, opcode, body, after - body)
        except MALFORMED as error:
            raise ValueError(f"a record must be well-formed, got {error}") from error
        layout.walked = after
    layout.cut = Cut(len(layout.chunks), layout.walked, layout.size)


def _file_record(
    file: BinaryIO, layout: Layout, opcode: int, body: int, length: int
) -> None:
    """File the record whose body is next in the file."""
    at = body - HEAD.size
    match opcode:
        case Opcode.MESSAGE_INDEX:
            _file_index(layout, length, file.read(min(length, INDEX_HEAD.size)))
        case Opcode.CHUNK:
            start = file.read(min(length, HEAD_OF_CHUNK))
            number = len(layout.chunks) + 1
            layout.chunks.append(chunk_at(number, at, length, start))
        case Opcode.METADATA:
            file_metadata(layout, at, file.read(length))
        case Opcode.ATTACHMENT:
            _file_attachment(layout, at, file.read(length))
        case _:
            raise ValueError(f"kind {opcode} of {length} bytes")


def _file_index(layout: Layout, length: int, body: bytes) -> None:
    channel, size = INDEX_HEAD.unpack(body)
    if size != length - INDEX_HEAD.size or size % INDEX_ENTRY:
        raise ValueError(f"a message index of {length} bytes that notes {size}")
    counts = layout.chunks[-1].counts
    counts[channel] = counts.get(channel, 0) + size // INDEX_ENTRY


def _file_attachment(layout: Layout, at: int, body: bytes) -> None:
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


def _file_end(path: Path, file: BinaryIO, layout: Layout, at: int) -> None:
    """Read what is behind the data: the summary, whole, torn or damaged.

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
    # In place: others refer to this layout.
    for name in ("metadata", "gaps", "damage", "chunks", "channels"):
        setattr(layout, name, getattr(whole, name))
    layout.attachments, layout.summarized = whole.attachments, True
    end = footer + HEAD.size + FOOTER.size + len(MAGIC)
    if end < layout.size:
        why = f"the file must end behind its footer, got {layout.size - end} bytes more"
        layout.damage.append(Damage(end, layout.size, why, "nothing"))


def _footer(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the footer starts, going from record to record; None if nowhere."""
    with suppress(ValueError):
        for opcode, body, after in heads(file, start, size):
            if opcode == Opcode.FOOTER and after - body == FOOTER.size:
                file.seek(after)
                at = body - HEAD.size
                return at if file.read(len(MAGIC)) == MAGIC else None
            if not opcode:
                break
    return None


def scan(path: Path) -> Layout:
    """Find out what lies where, and verify it; what is damaged is left out and noted.

    Reads the file once. One that is damaged or has no end is unpacked besides.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    layout = scan_index(path)
    with opened(path) as file:
        noted, computed = _sums(file, layout)
        layout.sure = noted is not None and noted != 0 and noted == computed
        if not layout.sure:
            _prove(path, file, layout)
            if noted and noted != computed and not _explained(layout):
                why = (
                    f"the data must have checksum {noted:#010x}, got {computed:#010x}:"
                    " all messages are whole, what is written of them may not be"
                )
                _add_damage(layout, Damage(0, layout.data_end or 0, why, "nothing"))
    return layout


def _sums(file: BinaryIO, layout: Layout) -> tuple[int | None, int]:
    """Return the checksum of the data as it is noted behind them, and as it is."""
    if layout.data_end is None:
        return None, 0
    file.seek(0)
    left, computed = layout.data_end, 0
    while left > 0 and (block := file.read(min(_BLOCK, left))):
        computed = zlib.crc32(block, computed)
        left -= len(block)
    record = file.read(HEAD.size + CRC.size)
    if len(record) < HEAD.size + CRC.size:
        return None, computed
    opcode, length = HEAD.unpack_from(record)
    if (opcode, length) != (Opcode.DATA_END, CRC.size):
        why = "the data must end with a record that says so, got another"
        end = layout.data_end
        _add_damage(layout, Damage(end, end + len(record), why, "nothing"))
        return None, computed
    return int.from_bytes(record[HEAD.size :], "little"), computed


def _prove(path: Path, file: BinaryIO, layout: Layout) -> None:
    """Leave out what does not match its own checksum."""
    good: list[Chunk] = []
    for chunk in layout.chunks:
        try:
            unpack(path, file, chunk)
        except RecordingError as error:
            why = str(error).removeprefix(f"{path}: at byte {chunk.offset}: ")
            spoiled = Damage(chunk.start_offset, chunk.stop_offset, why, "chunk")
            _add_damage(layout, spoiled)
        else:
            good.append(chunk)
    layout.chunks = good
    for attached in list(layout.attachments.values()):
        if not _is_attached(file, attached):
            del layout.attachments[attached.name]
            why = f"attachment {attached.name!r} must match its checksum, got another"
            start, stop = attached.offset - HEAD.size, attached.offset + attached.length
            _add_damage(layout, Damage(start, stop, why, "nothing"))
    if layout.data_end is None:
        _cut_behind(file, layout)


def _cut_behind(file: BinaryIO, layout: Layout) -> None:
    """Call it a cut where a file without an end has zeros from a chunk on.

    The disk had noted how long the file is before it had what is in it.
    """
    last = layout.chunks[-1].offset if layout.chunks else 0
    while layout.cut is not None and layout.damage:
        damage = layout.damage[-1]
        if damage.lost != "chunk" or damage.start < last:
            break
        file.seek(damage.stop - _ZEROS)
        if any(file.read()):
            break
        layout.damage.pop()
        layout.cut = Cut(len(layout.chunks), damage.start, layout.size)
    if layout.cut is not None:
        chunks = len(layout.chunks)
        layout.cut = msgspec.structs.replace(layout.cut, chunks=chunks)


def _is_attached(file: BinaryIO, attached: Attached) -> bool:
    """Tell whether an attachment is where it is said to be, and what was written."""
    file.seek(attached.offset)
    body = file.read(attached.length)
    noted = int.from_bytes(body[-CRC.size :], "little")
    return len(body) == attached.length and zlib.crc32(body[: -CRC.size]) == noted


def _add_damage(layout: Layout, damage: Damage) -> None:
    bisect.insort(layout.damage, damage, key=lambda one: one.start)


def _explained(layout: Layout) -> bool:
    """Tell whether some damage before the end of the data was found."""
    end = layout.data_end or 0
    return any(one.start < end for one in layout.damage)
