"""Journal records: length, checksum, bytes.

A reader takes what is whole and right from the start, and stops at the first record
that is neither: bytes that are cut off, flipped or zeroed can hide records behind them,
but never change one. The checksum covers the length, too, so zeros are no record.
"""

import struct
import zlib
from collections.abc import Iterator

LONGEST = 1 << 26
"""Bytes of a record at most; a longer one is damage."""
HEAD = struct.Struct("<II")
"""Length and checksum."""


def frame(record: bytes) -> bytes:
    """Return a record as it stands among others.

    Args:
        record: Up to `LONGEST` bytes.
    """
    return HEAD.pack(len(record), _checksum(len(record), record)) + record


def records(data: bytes) -> Iterator[bytes]:
    """Yield the records that `data` begins with, up to the first that is not right."""
    at = 0
    while at + HEAD.size <= len(data):
        length, checksum = HEAD.unpack_from(data, at)
        at += HEAD.size
        record = data[at : at + length]
        if length > LONGEST or len(record) < length:
            return
        if checksum != _checksum(length, record):
            return
        yield record
        at += length


def is_right(head: bytes, record: bytes) -> bool:
    """Tell whether a record is the one that `head` was made for."""
    length, checksum = HEAD.unpack(head)
    return length == len(record) and bool(checksum == _checksum(length, record))


def _checksum(length: int, record: bytes) -> int:
    return zlib.crc32(record, zlib.crc32(length.to_bytes(4, "little")))
