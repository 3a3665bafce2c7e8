"""Scans a recording for whole records and chunks, for cuts, and for damage.

The heads of its records say it, from one to the next. Where a file was cut short, or
still grows, the walk goes on where it stopped once there is more. What is no record is
damage: the walk goes on behind it, from the next record that is surely one. Where there
is none the file was cut, be the rest missing, torn or zeros. The summary of a finished
file says nothing that the walk does not find; other programs need it.

`scan_index` does that, and touches no chunk: each has a checksum of its own, and is
verified when it is unpacked. `scan` verifies all there is. In a finished file the data
section and the summary have a checksum each: where both are right, all is. Where one is
missing or wrong, every chunk is unpacked and held against its own checksum, and what
does not match is damage. So nothing of what is handed out here can be wrong. A file
that cannot be read, or is no recording of ours, is refused by `RecordingError`.
"""

import bisect
import io
import struct
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Header

from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunk_index import (
    HEAD_OF_CHUNK,
    chunk_at,
    find_record,
    unpack,
)
from neurosnap.recording.format.records import (
    CRC,
    FOOTER,
    GAP,
    HEAD,
    MAGIC,
    MALFORMED,
    PROFILE,
    Chunk,
    Cut,
    Damage,
    Gap,
    Layout,
    damaged,
    heads,
    opened,
    parse,
    read_facts,
)
from neurosnap.system.durable import checksum_of

_INDEX_HEAD = struct.Struct("<HI")
"""Of a message index: its channel, and bytes of its entries."""
_INDEX_ENTRY = 16
"""Bytes of a message index that stand for one message."""
_DATA_END = HEAD.size + CRC.size
"""Bytes of the record that ends the data."""
_ZEROS = 8  # bytes that no packed chunk ends with, if all of them are 0
_FACTS = (Opcode.METADATA,)


def scan_index(path: Path) -> Layout:
    """Find out what lies where; chunks as they are noted, not verified.

    Time: as its records are many.
    """
    with opened(path) as file:
        layout = Layout(size=file.seek(0, io.SEEK_END))
        layout.walked = _read_start(path, file, layout)
        _walk_on(path, file, layout)
        return layout


def scan_growth(path: Path, layout: Layout) -> bool:
    """Add what a file has gained since it was scanned; return whether it has."""
    with opened(path) as file:
        size = file.seek(0, io.SEEK_END)
        if size == layout.size or layout.cut is None:
            return False
        layout.size = size
        _walk_on(path, file, layout)
        return True


def _read_start(path: Path, file: BinaryIO, layout: Layout) -> int:
    """Read magic and header; return where the first record behind them starts."""
    try:
        _check_start(path, file, layout.size)
        return file.tell()
    except RecordingError:  # ours all the same, if something in it is
        if find_record(path, file, layout, 0, only=_FACTS) is None:
            raise
    found = find_record(path, file, layout, 0) or 0
    why = "the file must start with the header of a recording, got something else"
    layout.damage.append(Damage(0, found, why, "unknown"))
    return found


def _check_start(path: Path, file: BinaryIO, size: int) -> None:
    """Refuse what is no MCAP file, or no recording of ours."""
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise RecordingError(f"log: must be an MCAP recording, got {str(path)!r}")
    first = None
    with suppress(ValueError):
        first = next(heads(file, len(MAGIC), size), None)
    if first is None or first[0] != Opcode.HEADER:
        rule = "the file must start with a whole header"
        raise damaged(path, len(MAGIC), rule, "none")
    _, body, after = first
    try:
        header: Header = parse(Header.read, file.read(after - body))
    except ValueError as error:
        rule = "the header must be well-formed"
        raise damaged(path, len(MAGIC), rule, error) from error
    if header.profile != PROFILE:
        rule = f"must be {PROFILE!r}"
        raise RecordingError(f"{path}: profile: {rule}, got {header.profile!r}")


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
    """Go on behind what is no record; return whether no other record is there."""
    at = layout.walked
    found = find_record(path, file, layout, at + 1)
    end = _noted_end(file, at, layout.size) if found is None else None
    goes_on = found if end is None else end
    if goes_on is None:
        layout.cut = Cut(len(layout.chunks), at, layout.size)
        return True
    if goes_on > at:
        layout.damage.append(Damage(at, goes_on, why, "unknown"))
    layout.walked = goes_on
    if end is not None:
        _file_end(file, layout)
    return found is None


def _noted_end(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the data end by the footer; None if not behind `start`, or unsaid.

    A file that was finished was not cut, whatever its last records are.
    """
    tail = HEAD.size + FOOTER.size + len(MAGIC)
    file.seek(max(0, size - tail))
    record = file.read()
    if not record.startswith(HEAD.pack(Opcode.FOOTER, FOOTER.size)):
        return None
    summary, _, _ = FOOTER.unpack_from(record, HEAD.size)
    end = int(summary) - _DATA_END
    return end if record.endswith(MAGIC) and start <= end < size - tail else None


def _file_records(path: Path, file: BinaryIO, layout: Layout) -> None:
    """File the records up to the end of the data, or of the file."""
    for opcode, body, after in heads(file, layout.walked, layout.size):
        if opcode == Opcode.DATA_END and after - body == CRC.size:
            # Not passed: where what is behind it is torn, more may come.
            _file_end(file, layout)
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
            _file_index(layout, length, file.read(min(length, _INDEX_HEAD.size)))
        case Opcode.CHUNK:
            start = file.read(min(length, HEAD_OF_CHUNK))
            chunk = chunk_at(len(layout.chunks) + 1, at, length, start)
            if why := layout.claim(chunk.unpacked, chunk.stop_offset):
                layout.damage.append(Damage(at, chunk.stop_offset, why, "chunk"))
                return
            layout.first = layout.first or chunk
            layout.chunks.append(chunk)
        case Opcode.METADATA:
            name, facts = read_facts(file.read(length))
            if name == GAP:
                layout.gaps.append(Gap(at, facts.get("why", "")))
            layout.metadata[name] = facts
        case Opcode.ATTACHMENT:
            pass  # none is ours
        case _:
            raise ValueError(f"kind {opcode} of {length} bytes")


def _file_index(layout: Layout, length: int, body: bytes) -> None:
    channel, size = _INDEX_HEAD.unpack(body)
    if size != length - _INDEX_HEAD.size or size % _INDEX_ENTRY:
        raise ValueError(f"a message index of {length} bytes that notes {size}")
    last = layout.chunks[-1].offset if layout.chunks else 0
    if layout.damage and layout.damage[-1].start > last:
        return  # of a chunk that was not filed
    counts = layout.chunks[-1].counts
    counts[channel] = counts.get(channel, 0) + size // _INDEX_ENTRY


def _file_end(file: BinaryIO, layout: Layout) -> None:
    """Verify what is behind the data: the summary, whole, torn or damaged."""
    layout.data_end = layout.walked
    start = layout.walked + _DATA_END
    end = _end_of_footer(file, start, layout.size)
    if end is None:
        file.seek(max(start, layout.size - len(MAGIC)))
        if file.read() != MAGIC:
            layout.cut = Cut(len(layout.chunks), start, layout.size)
            return
        why = "the summary must end with its footer, got something else"
        layout.damage.append(Damage(start, layout.size, why, "nothing"))
        return
    computed = checksum_of(file, start, end - CRC.size)
    (noted,) = CRC.unpack(file.read(CRC.size))
    layout.summarized = noted == computed
    if not layout.summarized:
        why = f"the summary must have checksum {noted:#010x}, got {computed:#010x}"
        layout.damage.append(Damage(start, end, why, "nothing"))
    end += len(MAGIC)
    if end < layout.size:
        why = f"the file must end behind its footer, got {layout.size - end} bytes more"
        layout.damage.append(Damage(end, layout.size, why, "nothing"))


def _end_of_footer(file: BinaryIO, start: int, size: int) -> int | None:
    """Return where the footer ends, going from record to record; None if nowhere."""
    with suppress(ValueError):
        for opcode, body, after in heads(file, start, size):
            if opcode == Opcode.FOOTER and after - body == FOOTER.size:
                file.seek(after)
                return after if file.read(len(MAGIC)) == MAGIC else None
            if not opcode:
                break
    return None


def scan(path: Path) -> Layout:
    """Find out what lies where, and verify it; what is damaged is left out and noted.

    Reads the file once. One that is damaged or has no end is unpacked besides.
    """
    layout = scan_index(path)
    with opened(path) as file:
        noted, computed = _sums(file, layout)
        layout.sure = noted is not None and noted != 0 and noted == computed
        if not layout.sure:
            _prove(path, file, layout)
            end = layout.data_end or 0
            explained = any(one.start < end for one in layout.damage)
            if noted and noted != computed and not explained:
                why = (
                    f"the data must have checksum {noted:#010x}, got {computed:#010x}:"
                    " all messages are whole, what is written of them may not be"
                )
                _add_damage(layout, Damage(0, end, why, "nothing"))
    return layout


def _sums(file: BinaryIO, layout: Layout) -> tuple[int | None, int]:
    """Return the checksum of the data as it is noted behind them, and as it is."""
    if layout.data_end is None:
        return None, 0
    computed = checksum_of(file, 0, layout.data_end)
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


def _add_damage(layout: Layout, damage: Damage) -> None:
    bisect.insort(layout.damage, damage, key=lambda one: one.start)
