"""Unpacks and verifies chunks, and finds the messages in them.

Surely a record is a chunk whose messages match its checksum, or metadata with a right
checksum of its own. Bytes that merely look like one are passed over.

A chunk has thousands of messages, most of them pulses, and a reader of a run wants a
few hundred of them. The walk from record to record is compiled, and lets other threads
run meanwhile.
"""

import re
import struct
import zlib
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from neurosnap.errors import RecordingError
from neurosnap.recording.format.records import (
    CHUNK_HEAD,
    HEAD,
    LIMIT,
    MALFORMED,
    Chunk,
    Layout,
    damaged,
    damaged_in,
    heads,
    parse,
    read_facts,
)
from neurosnap.system.compiled import njit

_MESSAGE = int(Opcode.MESSAGE)
_CHANNEL = int(Opcode.CHANNEL)
_SCHEMA = int(Opcode.SCHEMA)
_HEAD = 9  # opcode and length
_BEFORE = 22  # channel, sequence and two times, before a message's payload
FACTS = struct.Struct("<IQQ")
"""Sequence, log time and time sent, which stand right before a message's payload."""
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


def unpack(path: Path, file: BinaryIO, chunk: Chunk) -> bytes:
    """Return the records of a chunk, verified by its checksum.

    Raises:
        RecordingError: They are not what was written, or there is no such chunk.
    """
    place = f"chunk {chunk.number}"
    file.seek(chunk.offset)
    packed = file.read(chunk.packed)
    match chunk.compression:
        case "":
            data = packed
        case "zstd":
            try:
                data = _unpack_zstd(packed, chunk.unpacked)
            except (zstandard.ZstdError, ValueError) as error:
                rule = f"{place} must unpack to {chunk.unpacked} bytes"
                raise damaged(path, chunk.offset, rule, error) from error
        case other:
            rule = f"{place} must be packed with zstd or not at all"
            raise damaged(path, chunk.offset, rule, repr(other))
    # Not even a checksum of 0, which says that none was computed, is let through.
    if (checksum := zlib.crc32(data)) != chunk.checksum or len(data) != chunk.unpacked:
        rule = f"{place} must have checksum {chunk.checksum:#010x}"
        raise damaged(path, chunk.offset, rule, f"{checksum:#010x}")
    return data


def _unpack_zstd(packed: bytes, size: int) -> bytes:
    # A frame that claims a size gets it, whatever limit the library is called with;
    # -1 says that it claims none, and then the limit holds.
    claimed = zstandard.frame_content_size(packed)
    if claimed not in (-1, size):
        raise ValueError(claimed)
    return zstandard.decompress(packed, max_output_size=size)


class ChunkIndex(NamedTuple):
    """The messages of a chunk, in the order they were recorded."""

    data: bytes
    channels: NDArray[np.int64]
    """``(n,)``: of each message its channel."""
    starts: NDArray[np.int64]
    """``(n,)``: where its payload starts in `data`."""
    stops: NDArray[np.int64]
    """``(n,)``: where that stops."""
    registered: dict[int, Channel]
    """The channels that are registered in the chunk."""


def index_chunk(path: Path, file: BinaryIO, chunk: Chunk) -> ChunkIndex:
    """Unpack and verify a chunk, and find its messages.

    Raises:
        RecordingError: The chunk is not what was written, or does not hold records of
            the kinds that a chunk of ours holds.
    """
    data = unpack(path, file, chunk)
    octets = np.frombuffer(data, np.uint8)
    count = _walk(octets, np.empty((0, 4), np.int64))
    if count < 0:
        raise damaged_in(path, chunk, *_malformed(data, -1 - count))
    found = np.empty((count, 4), np.int64)
    _walk(octets, found)
    opcodes = found[:, 0]
    is_message = opcodes == _MESSAGE
    registered: dict[int, Channel] = {}
    for row in np.flatnonzero(~is_message).tolist():
        try:
            channel = parse(Channel.read, data[found[row, 2] : found[row, 3]])
        except ValueError as error:
            rule = "channel must be well-formed"
            raise damaged_in(path, chunk, rule, error) from error
        known = registered.setdefault(channel.id, channel)
        if known.topic != channel.topic:
            raise damaged_in(path, chunk, "channel must keep its topic", channel.topic)
    _, channels, starts, stops = found[is_message].T
    return ChunkIndex(data, channels, starts, stops, registered)


def _malformed(data: bytes, at: int) -> tuple[str, int]:
    """Return the rule that the record at a place breaks, and what it has."""
    left = len(data) - at
    if left < HEAD.size:
        return "record must have a whole head", left
    opcode, length = HEAD.unpack_from(data, at)
    if opcode not in (_MESSAGE, _CHANNEL, _SCHEMA):
        return "record must be a message or its channel", opcode
    if HEAD.size + length > left:
        return f"record must end by {len(data)}", at + HEAD.size + length
    return "message must have a whole head", length


@njit(nogil=True)
def _walk(data: NDArray[np.uint8], found: NDArray[np.int64]) -> int:
    """Note opcode, channel, start and stop of each record, as far as there is room.

    Returns:
        How many there are, schemas left out; where one is not of ours, or ends where
        it cannot, the place where it starts, taken from -1.
    """
    at, count, size = np.int64(0), 0, data.size
    while at < size:
        length = np.uint64(0)
        if at + _HEAD <= size:
            for k in range(8):
                length |= np.uint64(data[at + 1 + k]) << np.uint64(8 * k)
        start = at + _HEAD
        opcode = data[at]
        message = opcode == _MESSAGE
        if (
            not (message or opcode in (_CHANNEL, _SCHEMA))
            or start > size
            or length > np.uint64(size - start)
            or (message and length < np.uint64(_BEFORE))
        ):
            return -1 - int(at)
        stop = start + np.int64(length)
        at = stop
        if opcode == _SCHEMA:
            continue
        if count < found.shape[0]:
            found[count, 0] = opcode
            found[count, 1] = data[start] | data[start + 1] << 8 if message else 0
            found[count, 2] = start + _BEFORE if message else start
            found[count, 3] = stop
        count += 1
    return count


# Behind damage ------------------------------------------------------------------------


def find_record(
    path: Path,
    file: BinaryIO,
    layout: Layout,
    start: int,
    only: Collection[int] = (Opcode.CHUNK, Opcode.METADATA),
) -> int | None:
    """Return where the next sure record starts in a file; None if there is none.

    Time: one pass over what is behind `start`. What looks like a record is unpacked
    only as long as there is room for that.
    """
    while start < layout.size:
        file.seek(start)
        window = file.read(min(_WINDOW, layout.size - start))
        for match in _CANDIDATE.finditer(window):
            at = start + match.start()
            if window[match.start()] not in only:
                continue
            if _is_sure(path, file, layout, at):
                return at
        if len(window) < _WINDOW:
            return None
        start += len(window) - _NEEDED
    return None


def _is_sure(path: Path, file: BinaryIO, layout: Layout, at: int) -> bool:
    """Tell whether a sure record starts at a place of a file."""
    before = layout.unpacked
    with suppress(RecordingError, StopIteration, *MALFORMED):
        opcode, body, after = next(heads(file, at, layout.size))
        length = after - body
        if layout.claim(length, after):
            return False
        if opcode == Opcode.METADATA:
            read_facts(file.read(length))
        else:
            start = file.read(min(length, HEAD_OF_CHUNK))
            chunk = chunk_at(0, at, length, start)
            if layout.claim(chunk.unpacked, after):
                return False
            unpack(path, file, chunk)
        layout.unpacked = before  # it counts once it is filed
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
    start, end, unpacked, checksum, name = CHUNK_HEAD.unpack_from(body)
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
    packed = noted, unpacked, checksum, compression
    return Chunk(number, at, offset, *packed, start, end, {})
