"""One walk through a recording: finds what lies where, and whether it was damaged.

Nothing is believed that a checksum does not cover. In a finished file the data section
and the summary have one each, so every flipped bit is found here, before the first
message is read. In a file that was cut short only the chunks have: their content is
verified when they are unpacked, but neither the run's metadata nor the message indexes
between the chunks can be, and the indexes are not used.

The records are walked here and not by `mcap.stream_reader`: that one cannot tell a torn
record from a damaged one, skips the checksums of attachments, skips what it does not
know, and unpacks whatever size a chunk claims for itself. What the records hold is
parsed by `mcap.records`.
"""

import io
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata

from neurosnap.errors import RecordingError
from neurosnap.record.chunks import unpack
from neurosnap.record.layout import (
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
    Layout,
    check_magic,
    damaged,
    library_of,
    opened,
    parse,
)

_SIZE = struct.Struct("<Q")
_CRC = struct.Struct("<I")
_REPEATED = frozenset(
    (
        Opcode.SCHEMA,
        Opcode.STATISTICS,
        Opcode.CHUNK_INDEX,
        Opcode.ATTACHMENT_INDEX,
        Opcode.METADATA_INDEX,
        Opcode.SUMMARY_OFFSET,
    )
)
"""What the summary says of the records before it, and the walk knows already; and the
schemas, since what a message holds is for `neurosnap.wire` to say."""

_Parsed = TypeVar("_Parsed")


class _Record(NamedTuple):
    opcode: int
    head: bytes
    body: bytes


_TORN = _Record(0, b"", b"")
"""No record has this kind."""


def scan(path: Path) -> Layout:
    """Walk the records of a recording, reading each byte once.

    Raises:
        RecordingError: The file cannot be read, is no recording of ours, or is damaged.
    """
    with opened(path) as file:
        return _Scan(path, file).run()


class _Scan:
    """The walk: reads forward only, but for the search for a damaged chunk."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        self._layout = Layout()
        # Of the data section up to the record in hand; behind it, of the summary.
        self._checksum = 0
        self._data_sealed = False
        self._in_summary = False
        self._finished = False
        # Where the record in hand starts.
        self._at = 0

    def run(self) -> Layout:
        """Walk to the end, or to where the file was cut."""
        self._read_start()
        while not self._finished and (record := self._next()) is not None:
            self._take(record)
        self._layout.size = self._file.seek(0, io.SEEK_END)
        if not self._finished:
            self._read_cut()
        return self._layout

    def _read_start(self) -> None:
        """Read the magic and the header."""
        magic = self._file.read(len(MAGIC))
        check_magic(self._path, magic)
        self._checksum = zlib.crc32(magic)
        record = self._next() or _TORN
        self._layout.library = library_of(self._path, record.opcode, record.body)
        self._sum(record)

    def _next(self) -> _Record | None:
        """Return the next record; None where it is torn, or there is none."""
        self._at = self._file.tell()
        head = self._file.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        if length > LIMIT:
            raise self._damage(f"a record must have at most {LIMIT} bytes", length)
        body = self._file.read(length)
        return _Record(opcode, head, body) if len(body) == length else None

    def _take(self, record: _Record) -> None:
        """File one record behind the header."""
        if record.opcode == Opcode.DATA_END:
            self._end_data(record)
            return
        if record.opcode == Opcode.FOOTER:
            self._end_file(record)
            return
        self._sum(record)
        if not self._in_summary:
            self._take_data(record)
        elif record.opcode == Opcode.CHANNEL:
            channel: Channel = self._parse(Channel.read, record.body)
            self._layout.channels[channel.id] = channel
        elif record.opcode not in _REPEATED:
            raise self._damage("the summary must hold no such record", record.opcode)

    def _take_data(self, record: _Record) -> None:
        """File one record of the data section.

        A kind of record that no writer of ours writes there is not skipped: it may be
        a chunk whose kind was damaged.
        """
        match record.opcode:
            case Opcode.CHUNK:
                self._take_chunk(record.body)
            case Opcode.MESSAGE_INDEX:
                self._take_index(record.body)
            case Opcode.METADATA:
                metadata: Metadata = self._parse(Metadata.read, record.body)
                self._layout.metadata[metadata.name] = metadata.metadata
            case Opcode.ATTACHMENT:
                self._take_attachment(record.body)
            case opcode:
                raise self._damage("the data must hold no such record", opcode)

    def _take_chunk(self, body: bytes) -> None:
        try:
            start, end, unpacked, checksum, length = CHUNK_HEAD.unpack_from(body)
            before = CHUNK_HEAD.size + length
            (packed,) = _SIZE.unpack_from(body, before)
            compression = body[CHUNK_HEAD.size : before].decode()
        except (struct.error, UnicodeDecodeError) as error:
            raise self._damage("a chunk must have a whole header", error) from error
        before += _SIZE.size
        if packed != len(body) - before:
            raise self._damage(f"a chunk must have {packed} bytes", len(body) - before)
        if unpacked > LIMIT:
            raise self._damage(f"a chunk must unpack to at most {LIMIT}", unpacked)
        chunk = Chunk(
            number=len(self._layout.chunks) + 1,
            offset=self._at + HEAD.size + before,
            packed=packed,
            unpacked=unpacked,
            checksum=checksum,
            compression=compression,
            start=start,
            end=end,
            counts={},
        )
        self._layout.chunks.append(chunk)

    def _take_index(self, body: bytes) -> None:
        entries = len(body) - INDEX_HEAD.size
        if entries < 0 or entries % INDEX_ENTRY or not self._layout.chunks:
            raise self._damage("a message index must follow its chunk", "no index")
        channel, length = INDEX_HEAD.unpack_from(body)
        if length != entries:
            raise self._damage(f"a message index must have {length} bytes", entries)
        counts = self._layout.chunks[-1].counts
        counts[channel] = counts.get(channel, 0) + entries // INDEX_ENTRY

    def _take_attachment(self, body: bytes) -> None:
        attachment: Attachment = self._parse(Attachment.read, body)
        (checksum,) = _CRC.unpack(body[-_CRC.size :])
        if checksum and zlib.crc32(memoryview(body)[: -_CRC.size]) != checksum:
            raise self._damage("an attachment must match its checksum", "another")
        self._layout.attachments[attachment.name] = Attached(
            name=attachment.name,
            media_type=attachment.media_type,
            size=len(attachment.data),
            offset=self._at + HEAD.size,
            length=len(body),
        )

    def _end_data(self, record: _Record) -> None:
        """Compare the checksum of the data section, if the writer computed one."""
        if self._in_summary or len(record.body) != _CRC.size:
            raise self._damage("the data must end once", "another end")
        (checksum,) = _CRC.unpack(record.body)
        if checksum and checksum != self._checksum:
            for chunk in self._layout.chunks:
                unpack(self._path, self._file, chunk)  # names the place, if it is one
            rule = "the data before must have the checksum noted here, outside chunks"
            raise self._damage(rule, "another")
        self._data_sealed = checksum != 0
        self._in_summary = True
        self._checksum = 0

    def _end_file(self, record: _Record) -> None:
        """Compare the checksum of the summary, and see that the file ends here."""
        if not self._in_summary or len(record.body) != FOOTER.size:
            raise self._damage("the footer must follow the data", "another footer")
        _, _, checksum = FOOTER.unpack(record.body)
        covered = record.head + record.body[: -_CRC.size]
        if checksum and zlib.crc32(covered, self._checksum) != checksum:
            raise self._damage("the summary must have the checksum noted here", "other")
        end = self._file.read(len(MAGIC) + 1)
        if not MAGIC.startswith(end):
            raise self._damage("the file must end behind its footer", "something else")
        # A torn magic is a torn file, if only just.
        self._finished = end == MAGIC
        sealed = self._data_sealed and checksum != 0
        self._layout.sealed = self._finished and sealed

    def _read_cut(self) -> None:
        """Note where the file was cut, unless its end is there."""
        size = self._layout.size
        self._file.seek(max(0, size - len(MAGIC)))
        if self._file.read() == MAGIC and size > len(MAGIC):
            raise self._damage("a record must end before the file does", "a longer one")
        self._layout.cut = Cut(len(self._layout.chunks), self._at, size)

    def _sum(self, record: _Record) -> None:
        self._checksum = zlib.crc32(
            record.body, zlib.crc32(record.head, self._checksum)
        )

    def _parse(self, read: Callable[[ReadDataStream], _Parsed], body: bytes) -> _Parsed:
        try:
            return parse(read, body)
        except ValueError as error:
            raise self._damage("a record must be well-formed", error) from error

    def _damage(self, rule: str, got: object) -> RecordingError:
        return damaged(self._path, self._at, rule, got)
