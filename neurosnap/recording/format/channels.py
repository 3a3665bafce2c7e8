"""Recovers channels where the chunk that declares them is damaged.

The writer registers all channels in the first chunk, and again in the summary. Without
both, the messages say it: each is of a type that is sent under one topic alone.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO

import msgspec
import numpy as np
from mcap.records import Channel

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunk_index import ChunkIndex, index_chunk
from neurosnap.recording.format.records import Chunk

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
            index = index_chunk(path, file, chunk)
        except RecordingError:
            continue
        _take(index, found)
        if len({channel.topic for channel in found.values()}) >= len(wire.TOPICS):
            break
    return found


def _take(index: ChunkIndex, found: dict[int, Channel]) -> None:
    """Note the channels of a chunk; those registered go before those that show."""
    found.update(index.registered)
    for number in index.present():
        for message in np.flatnonzero(index.channels == number).tolist():
            if number in found:
                break
            _guess(number, index.payload(message), found)


def _guess(number: int, payload: bytes, found: dict[int, Channel]) -> None:
    try:
        topic = wire.topic(_decode(payload).key)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return
    found[number] = Channel(
        id=number, topic=f"/{topic}", message_encoding="json", metadata={}, schema_id=0
    )
