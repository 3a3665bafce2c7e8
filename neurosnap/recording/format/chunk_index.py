"""The messages of a chunk: where each lies, once the chunk is unpacked.

A chunk has thousands of messages, most of them pulses, and whoever looks at a run wants
a few hundred of them. The walk from record to record is compiled, and lets other
threads run meanwhile.
"""

import struct
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from neurosnap.recording.format.chunks import unpack
from neurosnap.recording.format.records import HEAD, Chunk, channel_of, damaged_in
from neurosnap.system.compiled import njit

_MESSAGE = int(Opcode.MESSAGE)
_CHANNEL = int(Opcode.CHANNEL)
_SCHEMA = int(Opcode.SCHEMA)
_HEAD = 9  # opcode and length
_BEFORE = 22  # channel, sequence and two times, before a message's payload
FACTS = struct.Struct("<IQQ")
"""Sequence, log time and time sent, which stand right before a message's payload."""


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
    late: frozenset[int]
    """Those of them that have a message before."""

    def payload(self, message: int) -> bytes:
        """Return the payload of a message."""
        return self.data[self.starts[message] : self.stops[message]]

    def sequence(self, message: int) -> int:
        """Return the running number of a message."""
        number: int = FACTS.unpack_from(
            self.data, int(self.starts[message]) - FACTS.size
        )[0]
        return number

    def sent(self, message: int) -> int:
        """Return when a message was sent, nanoseconds since 1970."""
        when: int = FACTS.unpack_from(
            self.data, int(self.starts[message]) - FACTS.size
        )[2]
        return when

    def present(self) -> list[int]:
        """Return the channels that have messages here, ascending."""
        numbers: list[int] = np.flatnonzero(np.bincount(self.channels)).tolist()
        return numbers


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
    if is_message.all():  # as in every chunk of ours but the first
        _, channels, starts, stops = found.T
        return ChunkIndex(data, channels, starts, stops, {}, frozenset())
    is_channel = opcodes == _CHANNEL
    strange = opcodes[~(is_message | is_channel | (opcodes == _SCHEMA))]
    if strange.size:
        rule = "record must be a message or its channel"
        raise damaged_in(path, chunk, rule, strange[0])
    registered: dict[int, Channel] = {}
    late: set[int] = set()
    for row in np.flatnonzero(is_channel).tolist():
        try:
            channel = channel_of(data[found[row, 2] : found[row, 3]])
        except ValueError as error:
            raise damaged_in(path, chunk, "channel must be well-formed", error) from (
                error
            )
        known = registered.setdefault(channel.id, channel)
        if known.topic != channel.topic:
            raise damaged_in(path, chunk, "channel must keep its topic", channel.topic)
        before = found[:row, 1][is_message[:row]]
        if known is channel and (before == channel.id).any():
            late.add(channel.id)
    _, channels, starts, stops = found[is_message].T
    return ChunkIndex(data, channels, starts, stops, registered, frozenset(late))


def _malformed(data: bytes, at: int) -> tuple[str, int]:
    """Return the rule that the record at a place breaks, and what it has."""
    left = len(data) - at
    if left < HEAD.size:
        return "record must have a whole head", left
    _, length = HEAD.unpack_from(data, at)
    if HEAD.size + length > left:
        return f"record must end by {len(data)}", at + HEAD.size + length
    return "message must have a whole head", length


@njit(nogil=True)
def _walk(data: NDArray[np.uint8], found: NDArray[np.int64]) -> int:
    """Note opcode, channel, start and stop of each record, as far as there is room.

    Returns:
        How many records there are; where one ends where it cannot, the place where it
        starts, taken from -1.
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
            start > size
            or length > np.uint64(size - start)
            or (message and length < np.uint64(_BEFORE))
        ):
            return -1 - int(at)
        stop = start + np.int64(length)
        if count < found.shape[0]:
            found[count, 0] = opcode
            found[count, 1] = data[start] | data[start + 1] << 8 if message else 0
            found[count, 2] = start + _BEFORE if message else start
            found[count, 3] = stop
        count += 1
        at = stop
    return count
