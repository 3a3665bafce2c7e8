"""The messages of one chunk: decoded, in order or by topic."""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.chunk_index import FACTS, ChunkIndex
from neurosnap.recording.format.records import Chunk, damaged_in

M = TypeVar("M")
_DECODED = 5
"""Bytes of memory for each byte of a message that is decoded and kept; 2 to 8 were
measured, by topic."""
_DECODERS = {topic: msgspec.json.Decoder(kind) for topic, kind in wire.TOPICS.items()}
UNREADABLE = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""What decoding raises; deep nesting is the last."""


def decoded(text: str | None, kind: type[M], where: str, rule: str) -> M:
    """Return what a text says in JSON; None if there is no text, which is refused.

    Raises:
        RecordingError: It is not what a writer writes.
    """
    if text is None:
        raise RecordingError(f"{where}: {rule}, got nothing")
    try:
        return msgspec.json.decode(text, type=kind)
    except UNREADABLE as error:
        raise RecordingError(f"{where}: {rule}, got {error}") from error


class Recorded(NamedTuple):
    """A message as it was recorded."""

    message: wire.Message
    payload: bytes
    """Its JSON, byte for byte as on the wire."""
    sequence: int
    """The sender's running number."""
    sent: int
    """The sender's clock, nanoseconds since the epoch."""
    log_time: int
    """The recorder's clock when it arrived, nanoseconds since the epoch."""

    @property
    def delivery(self) -> wire.Delivery:
        """The message as it came to the recorder."""
        return wire.Delivery(self.message.key, self.sequence, self.sent, self.payload)


class ChunkMessages:
    """One chunk, unpacked; messages are decoded when they are asked for.

    Args:
        path: The file.
        chunk: The chunk, for errors.
        found: Its messages.
        topics: For each channel, the topic.
    """

    def __init__(
        self, path: Path, chunk: Chunk, found: ChunkIndex, topics: dict[int, str]
    ) -> None:
        self.size = len(found.data)
        """Bytes of memory it takes by now, about: more for each topic asked for."""
        self._path = path
        self._chunk = chunk
        self._found = found
        self._topics = topics
        self._kept: dict[str, list[Recorded]] = {}

    def recorded(self, topics: Collection[str], start: int = 0) -> Iterator[Recorded]:
        """Yield the messages of some topics in the order they were recorded.

        All that is read passes here, half a million messages a second and more.

        Args:
            topics: Named as in `wire.TOPICS`.
            start: Those before the first that was recorded at this time or later are
                left out.

        Raises:
            RecordingError: While iterating: one is under a topic that is not its own.
        """
        names = {n: topic for n, topic in self._topics.items() if topic in topics}
        asked = np.zeros(1 << 16, np.bool_)
        asked[list(names)] = True
        found = self._found
        chosen = np.flatnonzero(asked[found.channels])
        channels = found.channels[chosen].tolist()
        starts, stops = found.starts[chosen].tolist(), found.stops[chosen].tolist()
        data, facts = found.data, FACTS.unpack_from
        for channel, at, stop in zip(channels, starts, stops, strict=True):
            sequence, log_time, sent = facts(data, at - FACTS.size)
            if log_time < start:
                continue
            start = 0
            topic, payload = names[channel], data[at:stop]
            try:
                message = _DECODERS[topic].decode(payload)
            except UNREADABLE as error:
                raise self._wrong(topic, error) from error
            # The type fits the topic, and yet a pulse that excites is not one
            # that inhibits.
            if wire.topic(message.key) != topic:
                raise self._wrong(topic, f"one for {message.key}")
            yield Recorded(message, payload, sequence, sent, log_time)

    def of_topic(self, topic: str) -> list[Recorded]:
        """Return the messages of a topic; they are kept.

        Raises:
            RecordingError: As from `recorded`.
        """
        if topic not in self._kept:
            kept = self._kept[topic] = [*self.recorded((topic,))]
            self.size += _DECODED * sum(len(one.payload) for one in kept)
        return self._kept[topic]

    def all(self, topic: str, kind: type[M]) -> list[M]:
        """Return the messages of a topic that are of one kind; see `of_topic`."""
        several = (one.message for one in self.of_topic(topic))
        return [message for message in several if isinstance(message, kind)]

    def _wrong(self, topic: str, got: object) -> RecordingError:
        rule = f"/{topic} must hold its own messages"
        return damaged_in(self._path, self._chunk, rule, got)
