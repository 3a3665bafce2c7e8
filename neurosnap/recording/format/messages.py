"""Iterates over the messages of a recording, undecoded."""

from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import numpy as np
from mcap.records import Channel

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunk_index import FACTS, ChunkIndex, index_chunk
from neurosnap.recording.format.records import Chunk, Layout, damaged_in, opened

EVER = 1 << 64
"""Behind every time a recording can hold."""

Raw: TypeAlias = tuple[str, int, int, int, bytes]
"""Topic, sequence, log time, time sent, payload."""


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
            found = index_chunk(path, file, chunk)
            present = found.present()
            _register(path, chunk, found, present, wanted, topics)
            names = {n: topic for n in present if (topic := wanted[n]) is not None}
            yield chunk, _chosen(found, names, start, end)


def _topic(path: Path, channel: Channel, topics: frozenset[str]) -> str | None:
    """Return the topic of a channel, or None where it was not asked for."""
    topic = channel.topic.removeprefix("/")
    if topic not in wire.TOPICS or channel.message_encoding != "json":
        got = f"{channel.topic} in {channel.message_encoding}"
        raise RecordingError(f"{path}: channel: must be a topic in json, got {got}")
    return topic if topic in topics else None


def _register(
    path: Path,
    chunk: Chunk,
    found: ChunkIndex,
    present: list[int],
    wanted: dict[int, str | None],
    topics: frozenset[str],
) -> None:
    """Take note of a chunk's channels, which are known in those after it, too.

    Args:
        path: The recording.
        chunk: Of it.
        found: The messages of the chunk.
        present: Their channels.
        wanted: Of each channel that is known its topic, where it was asked for.
        topics: What was asked for.

    Raises:
        RecordingError: A message is of a channel that is not registered before it.
    """
    for channel in found.registered.values():
        topic = _topic(path, channel, topics)
        if channel.id in found.late and wanted.get(channel.id, "") != topic:
            raise damaged_in(path, chunk, "channel must be registered", channel.id)
        wanted[channel.id] = topic
    for number in present:
        if number not in wanted:
            raise damaged_in(path, chunk, "channel must be registered", number)


def _chosen(
    found: ChunkIndex, names: dict[int, str], start: int, end: int
) -> Iterator[Raw]:
    """Yield the messages of the channels in `names`, in the order they were recorded.

    All that is read passes here, half a million messages a second and more.
    """
    if not names:
        return
    asked = np.zeros(1 << 16, np.bool_)
    asked[list(names)] = True
    chosen = np.flatnonzero(asked[found.channels])
    channels = found.channels[chosen].tolist()
    starts, stops = found.starts[chosen].tolist(), found.stops[chosen].tolist()
    data, facts = found.data, FACTS.unpack_from
    for channel, at, stop in zip(channels, starts, stops, strict=True):
        sequence, log_time, sent = facts(data, at - FACTS.size)
        if start <= log_time < end:
            yield names[channel], sequence, log_time, sent, data[at:stop]
