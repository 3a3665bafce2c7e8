"""Unpacks and verifies chunks, and yields their undecoded messages."""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TypeAlias

import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.records import (
    CHUNK_HEAD,
    HEAD,
    Chunk,
    Layout,
    damaged,
    opened,
    parse,
)

EVER = 1 << 64
"""Behind every time a recording can hold."""

MESSAGE_HEAD = struct.Struct("<BQHIQQ")
"""The head of a message: its record's, then channel, sequence, and two times."""
_MESSAGE_BODY = MESSAGE_HEAD.size - HEAD.size

Raw: TypeAlias = tuple[str, int, int, int, bytes]
"""Topic, sequence, log time, time sent, payload."""


def unpack(path: Path, file: BinaryIO, chunk: Chunk) -> bytes:
    """Return the records of a chunk, verified by the checksum in its own head.

    Raises:
        RecordingError: They are not what was written, or there is no such chunk.
    """
    place = f"chunk {chunk.number}"
    file.seek(chunk.start_offset)
    head, packed = file.read(chunk.head), file.read(chunk.packed)
    if len(head) < chunk.head or head[0] != Opcode.CHUNK:
        rule = f"{place} must start at byte {chunk.start_offset}"
        raise damaged(path, chunk.offset, rule, "another record")
    _, _, unpacked, noted, _ = CHUNK_HEAD.unpack_from(head, HEAD.size)
    if unpacked != chunk.unpacked:
        rule = f"{place} must unpack to {chunk.unpacked} bytes"
        raise damaged(path, chunk.offset, rule, unpacked)
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
    if (checksum := zlib.crc32(data)) != noted or len(data) != chunk.unpacked:
        rule = f"{place} must have checksum {noted:#010x}"
        raise damaged(path, chunk.offset, rule, f"{checksum:#010x}")
    return data


def _unpack_zstd(packed: bytes, size: int) -> bytes:
    # A frame that claims a size gets it, whatever limit the library is called with;
    # -1 says that it claims none, and then the limit holds.
    claimed = zstandard.frame_content_size(packed)
    if claimed not in (-1, size):
        raise ValueError(claimed)
    return zstandard.decompress(packed, max_output_size=size)


def raw_messages(
    path: Path, layout: Layout, topics: frozenset[str], start: int, end: int
) -> Iterator[tuple[Chunk, Iterator[Raw]]]:
    """Return the chunks that may hold messages asked for, and those messages.

    Args:
        path: The recording.
        layout: What lies where in it.
        topics: Only messages of these.
        start: Only those recorded at this time or later.
        end: Only those recorded before this time.

    Raises:
        RecordingError: While iterating: the recording is damaged.
    """
    # For each channel its topic; None where it was not asked for.
    wanted: dict[int, str | None] = {}
    for channel in layout.channels.values():
        wanted[channel.id] = _topic(path, channel, topics)
    skips = layout.indexed and bool(layout.channels)
    with opened(path) as file:
        for chunk in layout.chunks:
            if skips and not (
                chunk.start < end
                and chunk.end >= start
                and any(wanted.get(channel) for channel in chunk.counts)
            ):
                continue
            reader = _ChunkReader(path, chunk, wanted, topics)
            yield chunk, reader.messages(unpack(path, file, chunk), start, end)


def _topic(path: Path, channel: Channel, topics: frozenset[str]) -> str | None:
    """Return the topic of a channel, or None where it was not asked for."""
    topic = channel.topic.removeprefix("/")
    if topic not in wire.TOPICS or channel.message_encoding != "json":
        got = f"{channel.topic} in {channel.message_encoding}"
        raise RecordingError(f"{path}: channel: must be a topic in json, got {got}")
    return topic if topic in topics else None


class _ChunkReader:
    """Reads one chunk; a channel registered in it is known in those after it."""

    def __init__(
        self,
        path: Path,
        chunk: Chunk,
        wanted: dict[int, str | None],
        topics: frozenset[str],
    ) -> None:
        self._path = path
        self._chunk = chunk
        self._wanted = wanted
        self._topics = topics

    def messages(self, data: bytes, start: int, end: int) -> Iterator[Raw]:
        """Return the messages asked for, in the order they were recorded.

        All that is read passes here, half a million messages a second and more.
        """
        wanted, message, head = self._wanted, MESSAGE_HEAD.unpack_from, HEAD.unpack_from
        at, size = 0, len(data)
        try:
            while at < size:
                opcode, length = head(data, at)
                after = at + HEAD.size + length
                if after > size:
                    raise self._damage(f"record must end by {size}", after)
                if opcode != Opcode.MESSAGE:
                    self._register(opcode, data[at + HEAD.size : after])
                elif length < _MESSAGE_BODY:
                    raise self._damage("message must have a whole head", length)
                else:
                    _, _, channel, sequence, log_time, sent = message(data, at)
                    topic = wanted[channel]
                    if topic is not None and start <= log_time < end:
                        payload = data[at + MESSAGE_HEAD.size : after]
                        yield topic, sequence, log_time, sent, payload
                at = after
        except struct.error as error:
            raise self._damage("record must have a whole head", error) from error
        except KeyError as error:
            raise self._damage("channel must be registered", error) from error

    def _register(self, opcode: int, body: bytes) -> None:
        """Take note of a channel; a schema says nothing that is needed here."""
        if opcode == Opcode.SCHEMA:
            return
        if opcode != Opcode.CHANNEL:
            raise self._damage("record must be a message or its channel", opcode)
        try:
            channel: Channel = parse(Channel.read, body)
        except ValueError as error:
            raise self._damage("channel must be well-formed", error) from error
        self._wanted[channel.id] = _topic(self._path, channel, self._topics)

    def _damage(self, rule: str, got: object) -> RecordingError:
        rule = f"chunk {self._chunk.number}: {rule}"
        return damaged(self._path, self._chunk.offset, rule, got)
