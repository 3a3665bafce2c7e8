"""Reads the records in the files of a bag: MCAP, or the SQLite of older ROS 2.

Records come as those of MCAP from either. A file is gone through in bounded memory, and
unpacks to no more than its size allows.
"""

import re
import struct
from collections.abc import Iterator
from dataclasses import replace
from io import BufferedReader
from pathlib import Path

import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.system.distribution import must_have

MAGIC = b"\x89MCAP0\r\n"
_OURS = "neurosnap"
_SQLITE = ".db3"
_LIMIT = 256 * 2**20
"""Bytes of a record or an unpacked chunk, at most: a file may claim any size."""
_FLOOR, _RATIO = 64 * 2**20, 512
"""Bytes that a file may unpack to in all, and more for each byte read."""
_MALFORMED = (
    *(struct.error, ValueError, IndexError, EOFError, RuntimeError, OSError),
    zstandard.ZstdError,
)
_DIGITS = re.compile(r"(\d+)")


def bag_files(path: str) -> list[Path]:
    """Return a file, or those of a folder as a bag of ROS 2 numbers them."""
    given = Path(path)
    if not given.is_dir():
        return [given]

    def order(file: Path) -> list[tuple[int, str]]:
        # Digits and other letters take turns, so like is compared with like.
        return [
            (int(s), "") if s.isdigit() else (0, s) for s in _DIGITS.split(file.name)
        ]

    found = [*given.glob("*.mcap")] or [*given.glob(f"*{_SQLITE}")]
    return sorted(found, key=order)


def is_bag(path: str) -> bool:
    """Return whether a file or folder is a bag, and no recording of ours."""
    files = bag_files(path)
    if not files or not files[0].is_file():
        return False
    if files[0].suffix == _SQLITE:
        return True
    try:
        with files[0].open("rb") as file:
            first = next(iter(StreamReader(file, record_size_limit=_LIMIT).records))
    except (McapError, *_MALFORMED):  # what it is then, others say
        return False
    return isinstance(first, Header) and first.profile != _OURS


def records_in(path: Path) -> Iterator[tuple[McapRecord, int]]:
    """Yield the records of a file, and how many of its bytes were read by then.

    Raises:
        MissingExtraError: `rosbags` is needed, and not installed.
        InvalidValueError: While iterating: it is cut, damaged or too large.
    """
    if path.suffix == _SQLITE:
        yield from _rows(path)
        return
    with _Bounded(path.open("rb", buffering=0)) as file:
        try:
            for record in _records(file, path):
                yield record, file.tell()
        except InvalidValueError:
            raise
        except (McapError, KeyError, *_MALFORMED) as error:
            rule = "must be whole MCAP, as far as it is read"
            where = f"{type(error).__name__} before byte {file.tell()}"
            raise InvalidValueError(str(path), rule, where) from error


class _Bounded(BufferedReader):
    """Reads no more at once than a record may have: else room is made for any size."""

    def read(self, size: int | None = -1) -> bytes:
        return super().read(_LIMIT if size is None else min(size, _LIMIT))


def _records(file: BufferedReader, path: Path) -> Iterator[McapRecord]:
    unpacked = 0
    reader = StreamReader(file, emit_chunks=True, record_size_limit=_LIMIT)
    for record in reader.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        unpacked += record.uncompressed_size
        most = _FLOOR + _RATIO * file.tell()
        claimed = record.uncompressed_size
        if record.compression == "zstd":  # it would get as much room as it says
            claimed = max(claimed, zstandard.frame_content_size(record.data))
        if claimed > _LIMIT or unpacked > most:
            rule = f"must unpack to at most {most:,} bytes by byte {file.tell()}"
            raise InvalidValueError(str(path), rule, unpacked)
        if record.compression == "lz4":  # `mcap` unpacks it to whatever it comes to
            lz4 = LZ4FrameDecompressor()
            data = lz4.decompress(record.data, max_length=claimed)
            if not lz4.eof:
                rule = f"must unpack to what it says by byte {file.tell()}"
                raise InvalidValueError(str(path), rule, claimed)
            record = replace(record, compression="", data=data)
        yield from breakup_chunk(record, validate_crc=True)


def _rows(path: Path) -> Iterator[tuple[McapRecord, int]]:
    """Yield what an SQLite file holds, as records."""
    try:
        import apsw
        from rosbags.rosbag2 import Reader, ReaderError
    except ImportError as error:
        raise MissingExtraError(f"{path}: {must_have('rosbags', 'ros2')}") from error
    size = path.stat().st_size
    try:
        with Reader(path) as reader:
            for number, one in enumerate(reader.connections, start=1):
                text = one.msgdef.data.encode()
                kind = "ros2idl" if one.msgdef.format.name == "IDL" else "ros2msg"
                yield Schema(number, text, kind if text else "", one.msgtype), 0
                encoding = getattr(one.ext, "serialization_format", "cdr")
                yield Channel(one.id, one.topic, encoding, {}, number), 0
            for count, (one, at, data) in enumerate(reader.messages()):
                place = size * count // max(1, reader.message_count)
                yield Message(one.id, at, data, at, 0), place
    except (ReaderError, apsw.Error, *_MALFORMED) as error:
        rule = "must be a whole bag of ROS 2, as far as it is read"
        raise InvalidValueError(str(path), rule, type(error).__name__) from error
