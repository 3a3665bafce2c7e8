"""Full scan: the layout of a recording, with every checksum verified.

In a finished file the data section and the summary have a checksum each: where both are
right, all is. Where one is missing or wrong, every chunk is unpacked and held against
its own checksum, and what does not match is damage. So of what is handed out here
nothing can be wrong but metadata without a checksum of its own: see `Layout.doubts`.
"""

import bisect
import zlib
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode

from neurosnap.errors import RecordingError
from neurosnap.recording.format.channels import channels_in
from neurosnap.recording.format.chunks import unpack
from neurosnap.recording.format.index_scan import scan_index
from neurosnap.recording.format.records import (
    HEAD,
    Attached,
    Chunk,
    Cut,
    Damage,
    Layout,
    opened,
)

_BLOCK = 1 << 20
_CRC = 4  # bytes of a checksum
_ZEROS = 8  # bytes that no packed chunk ends with, if all of them are 0


def scan(path: Path) -> Layout:
    """Find out what lies where, and verify it; what is damaged is left out and noted.

    Reads the file once. One that is damaged or has no end is unpacked besides.

    Raises:
        RecordingError: The file cannot be read, or is no recording of ours.
    """
    layout = scan_index(path).layout
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
                _note(layout, Damage(0, layout.data_end or 0, why, "nothing"))
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
    record = file.read(HEAD.size + _CRC)
    if len(record) < HEAD.size + _CRC:
        return None, computed
    opcode, length = HEAD.unpack_from(record)
    if (opcode, length) != (Opcode.DATA_END, _CRC):
        why = "the data must end with a record that says so, got another"
        end = layout.data_end
        _note(layout, Damage(end, end + len(record), why, "nothing"))
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
            _note(layout, spoiled)
        else:
            good.append(chunk)
    layout.chunks = good
    for attached in list(layout.attachments.values()):
        if not _is_attached(file, attached):
            del layout.attachments[attached.name]
            why = f"attachment {attached.name!r} must match its checksum, got another"
            start, stop = attached.offset - HEAD.size, attached.offset + attached.length
            _note(layout, Damage(start, stop, why, "nothing"))
    if layout.data_end is None:
        _cut_behind(file, layout)
    if layout.damage and not layout.summarized:
        layout.channels = channels_in(path, file, layout.chunks)


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
    noted = int.from_bytes(body[-_CRC:], "little")
    return len(body) == attached.length and zlib.crc32(body[:-_CRC]) == noted


def _note(layout: Layout, damage: Damage) -> None:
    bisect.insort(layout.damage, damage, key=lambda one: one.start)


def _explained(layout: Layout) -> bool:
    """Tell whether some damage before the end of the data was found."""
    end = layout.data_end or 0
    return any(one.start < end for one in layout.damage)
