"""Offsets of the messages in an unpacked chunk.

A chunk has thousands of messages, most of them pulses, and whoever looks at a run wants
a few hundred of them. The walk from record to record is compiled, and lets other
threads run meanwhile.
"""

import struct
from typing import NamedTuple

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from neurosnap.recording.format.records import parse
from neurosnap.system.compiled import njit

_MESSAGE = int(Opcode.MESSAGE)
_CHANNEL = int(Opcode.CHANNEL)
_SCHEMA = int(Opcode.SCHEMA)
_HEAD = 9  # opcode and length
_BEFORE = 22  # channel, sequence and two times, before a message's payload
_SEQUENCE = struct.Struct("<I")


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

    def payload(self, message: int) -> bytes:
        """Return the payload of a message."""
        return self.data[self.starts[message] : self.stops[message]]

    def sequence(self, message: int) -> int:
        """Return the running number of a message."""
        at = int(self.starts[message]) - _BEFORE + 2
        number: int = _SEQUENCE.unpack_from(self.data, at)[0]
        return number


def sieve(data: bytes) -> ChunkIndex:
    """Walk through the records of a chunk.

    Raises:
        ValueError: They are not records, or are of a kind that no chunk of ours holds.
    """
    octets = np.frombuffer(data, np.uint8)
    count = _walk(octets, np.empty((0, 4), np.int64))
    if count < 0:
        raise ValueError("a record that is longer than it can be")
    found = np.empty((count, 4), np.int64)
    _walk(octets, found)
    opcodes = found[:, 0]
    if not np.isin(opcodes, (_MESSAGE, _CHANNEL, _SCHEMA)).all():
        raise ValueError("a record that is no message and no channel")
    registered = {}
    for start, stop in found[opcodes == _CHANNEL, 2:].tolist():
        channel: Channel = parse(Channel.read, data[start:stop])
        registered[channel.id] = channel
    _, channels, starts, stops = found[opcodes == _MESSAGE].T
    return ChunkIndex(data, channels, starts, stops, registered)


@njit(nogil=True)
def _walk(data: NDArray[np.uint8], found: NDArray[np.int64]) -> int:
    """Note opcode, channel, start and stop of each record, as far as there is room.

    Returns:
        How many records there are; -1 if one of them ends where it cannot.
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
            return -1
        stop = start + np.int64(length)
        if count < found.shape[0]:
            found[count, 0] = opcode
            found[count, 1] = data[start] | data[start + 1] << 8 if message else 0
            found[count, 2] = start + _BEFORE if message else start
            found[count, 3] = stop
        count += 1
        at = stop
    return count
