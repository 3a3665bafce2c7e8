"""Finds the next valid record behind damage.

Surely a record is a chunk whose messages match its checksum, or metadata with a right
checksum of its own. Bytes that merely look like one are passed over.
"""

import re
import struct
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunks import unpack
from neurosnap.recording.format.records import (
    CHUNK_HEAD,
    HEAD,
    LIMIT,
    MALFORMED,
    Chunk,
    heads,
    read_facts,
)

_WINDOW = 1 << 20
_LONGEST = 16  # bytes a compression's name may have
_PACKED = struct.Struct("<Q")
HEAD_OF_CHUNK = CHUNK_HEAD.size + _LONGEST + _PACKED.size
"""Bytes of a chunk's body that stand before what is packed, at most."""
_CANDIDATE = re.compile(
    # A chunk: its length, of which the upper bytes are 0; two times, size, checksum;
    # and its compression. Metadata: its length, and a name of ours.
    rb"\x06(?=.{5}\0\0\0.{28}(?:\x04\0\0\0zstd|\0\0\0\0))"
    rb"|\x0c(?=.{5}\0\0\0.{4}neurosnap\.)",
    re.DOTALL,
)
_NEEDED = 64  # bytes from the start of a candidate that the pattern may look at


def find_record(
    path: Path,
    file: BinaryIO,
    start: int,
    end: int,
    only: Collection[int] = (Opcode.CHUNK, Opcode.METADATA),
) -> int | None:
    """Return where the first sure record starts in a range; None if there is none.

    Time: one pass over the range. What looks like a chunk and is none costs its own
    length; a file that is made of such is given up on after four times its size.

    Args:
        path: The recording.
        file: The same, open.
        start: The first byte a record may start at.
        end: The byte behind the last one it may have.
        only: The kinds of record to look for.
    """
    patience = LIMIT + 4 * max(0, end - start)
    while start < end:
        file.seek(start)
        window = file.read(min(_WINDOW, end - start))
        for match in _CANDIDATE.finditer(window):
            at = start + match.start()
            if window[match.start()] not in only:
                continue
            if is_sure(path, file, at, end):
                return at
            patience -= _claimed(window, match.start())
            if patience < 0:
                return None
        if len(window) < _WINDOW:
            return None
        start += len(window) - _NEEDED
    return None


def is_sure(path: Path, file: BinaryIO, at: int, end: int) -> bool:
    """Tell whether a sure record starts at a place, and ends by `end`."""
    with suppress(RecordingError, *MALFORMED):
        for opcode, body, after in heads(file, at, end):
            length = after - body
            if opcode == Opcode.METADATA:
                read_facts(file.read(length))
                return True
            start = file.read(min(length, HEAD_OF_CHUNK))
            unpack(path, file, chunk_at(0, at, length, start))
            return True
    return False


def chunk_at(number: int, at: int, length: int, body: bytes) -> Chunk:
    """Return the chunk whose record starts at a place.

    Args:
        number: Its own, from 1.
        at: Where the record starts.
        length: Bytes of its body.
        body: The first of them.

    Raises:
        ValueError: No chunk starts so.
        struct.error: Likewise: it is too short.
    """
    start, end, unpacked, _, name = CHUNK_HEAD.unpack_from(body)
    if name > _LONGEST:
        raise ValueError(f"a compression with a name of {name} bytes")
    compression = body[CHUNK_HEAD.size : CHUNK_HEAD.size + name].decode()
    (noted,) = _PACKED.unpack_from(body, CHUNK_HEAD.size + name)
    before = CHUNK_HEAD.size + name + _PACKED.size
    if noted != length - before:
        raise ValueError(f"a chunk of {length - before} bytes that notes {noted}")
    if unpacked > LIMIT:
        raise ValueError(f"a chunk that unpacks to {unpacked} bytes")
    offset = at + HEAD.size + before
    return Chunk(number, offset, noted, unpacked, compression, start, end, {})


def _claimed(window: bytes, at: int) -> int:
    """Return how many bytes it took to find that a candidate is none, about."""
    _, length = HEAD.unpack_from(window.ljust(at + HEAD.size), at)
    return int(min(length, LIMIT))
