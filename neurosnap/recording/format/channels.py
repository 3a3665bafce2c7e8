"""Recovers channels where the chunk that declares them is damaged.

The writer registers all channels in the first chunk, and again in the summary. Without
both, the messages say it: each is of a type that is sent under one topic alone.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import msgspec
from mcap.opcode import Opcode
from mcap.records import Channel

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunks import MESSAGE_HEAD, unpack
from neurosnap.recording.format.records import HEAD, Chunk, parse

_MESSAGE = MESSAGE_HEAD.size
_decode = msgspec.json.Decoder(wire.Message).decode


def channels_in(
    path: Path, file: BinaryIO, chunks: Iterable[Chunk]
) -> dict[int, Channel]:
    """Return the channels that some chunks have messages of; damaged ones are skipped.

    Time: O(1) once the first chunk has registered them, else one walk through all
    messages, one of each channel decoded.
    """
    found: dict[int, Channel] = {}
    for chunk in chunks:
        try:
            data = unpack(path, file, chunk)
        except RecordingError:
            continue
        _take(data, found)
        if len({channel.topic for channel in found.values()}) >= len(wire.TOPICS):
            break
    return found


def _take(data: bytes, found: dict[int, Channel]) -> None:
    """Note the channels of a chunk; those registered go before those that show."""
    at = 0
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        after = at + HEAD.size + length
        if opcode == Opcode.CHANNEL:
            try:
                channel: Channel = parse(Channel.read, data[at + HEAD.size : after])
            except ValueError:  # said where its messages are read
                return
            found[channel.id] = channel
        elif opcode == Opcode.MESSAGE and length >= _MESSAGE - HEAD.size:
            number = MESSAGE_HEAD.unpack_from(data, at)[2]
            if number not in found:
                _guess(number, data[at + _MESSAGE : after], found)
        at = after


def _guess(number: int, payload: bytes, found: dict[int, Channel]) -> None:
    try:
        topic = wire.topic(_decode(payload).key)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return
    found[number] = Channel(
        id=number, topic=f"/{topic}", message_encoding="json", metadata={}, schema_id=0
    )
