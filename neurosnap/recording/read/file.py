"""One file of a recording: what was written of its run, its messages, what is missing.

What is handed out is what was written: of a file that is damaged, all but what the
damage took. A file may be looked at in part: some chunks, one behind the other, behind
a place where messages are missing.
"""

import os
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Self

import msgspec
import numpy as np
from mcap.records import Attachment, Channel

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.location import Place
from neurosnap.recording.format.chunks import FACTS, ChunkIndex, index_chunk
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.records import (
    CLOSING,
    PLACES,
    RUN,
    SHARE,
    SNAPSHOT,
    TOTALS,
    Chunk,
    Cut,
    Layout,
    damaged,
    damaged_in,
    opened,
    parse,
)
from neurosnap.recording.format.scan import scan, scan_growth, scan_index

EVER = 1 << 64
"""Behind every time a recording can hold."""
_UNREADABLE = (msgspec.MsgspecError, UnicodeDecodeError, RecursionError)
"""What decoding raises; deep nesting is the last."""


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


class Noted(msgspec.Struct, frozen=True):
    """What the writer noted at the end about completeness."""

    completeness: Completeness
    """The balance it came to."""
    expected: dict[str, int]
    """For each sender, how many messages it says it sent."""


class RecordingFile:
    """One file of a recording, or some chunks of it; it is not held open between reads.

    Args:
        path: The file.
        layout: What lies where in it.
        begins: Of a piece of a file, the tick of the key-frame that it begins with, 0
            for the start of the run, -1 if there is none; None for the whole file.
        lost: Why messages are missing before a piece; empty if none are.

    Raises:
        RecordingError: It says nothing of its run, or is of another schema.
    """

    def __init__(
        self, path: Path, layout: Layout, *, begins: int | None = None, lost: str = ""
    ) -> None:
        self.path = path
        self.layout = layout
        self.lost = lost
        self._begins = begins
        self._verify_run()

    @classmethod
    def open(cls, path: Path, *, verify: bool = True) -> Self:
        """Find out what is in a file.

        Args:
            path: The file.
            verify: Whether to hold all of it against its checksums: that reads the file
                once, two seconds a gigabyte. One that is damaged or has no end is
                unpacked besides, which takes as long as to read its messages. Else
                each chunk is verified when it is read.

        Raises:
            RecordingError: There is no such file, or it is no recording of ours.
        """
        return cls(path, scan(path) if verify else scan_index(path))

    def grow(self) -> bool:
        """Look at what the file has gained; return whether that is anything.

        Raises:
            RecordingError: The file cannot be read.
        """
        return scan_growth(self.path, self.layout)

    def _verify_run(self) -> None:
        """Refuse a recording that says nothing of its run, or is of another schema."""
        if RUN not in self.layout.metadata:
            if self.layout.chunks or self.cut is None or self.layout.damage:
                raise RecordingError(
                    f"{self.path}: metadata: must hold {RUN}, got none"
                )
            return
        schema = self.metadata.get("schema", "")
        # Not as numbers: Python refuses to read one of thousands of digits.
        if schema != str(wire.SCHEMA):
            advice = "read it with the version of neurosnap that wrote it, or run again"
            raise RecordingError(
                f"{self.path}: schema: must be {wire.SCHEMA}, got {schema[:40]!r};"
                f" {advice}"
            )

    @property
    def metadata(self) -> dict[str, str]:
        """What was written of the run at its start; empty if it was cut before that."""
        return self.layout.metadata.get(RUN, {})

    @property
    def part(self) -> int | None:
        """Which of the files of its run it is, from 0; None: it is the only one.

        Raises:
            RecordingError: What it says of that is no number.
        """
        return self._number("part") if "part" in self.metadata else None

    @property
    def begins(self) -> int:
        """The tick of the key-frame that it begins with; 0 if it begins with the run.

        Raises:
            RecordingError: What it says of that is no number.
        """
        if self._begins is not None:
            return self._begins
        return self._number("begins") if self.part else 0

    @property
    def share(self) -> dict[str, int] | None:
        """The number each sender's share of a later file begins with.

        None where the file was cut before all were known, or of a piece behind a place
        where messages are missing.

        Raises:
            RecordingError: What it says of that is not what a writer writes.
        """
        if self.lost:
            return None
        noted = self.layout.metadata.get(SHARE)
        if not self.part:
            return {}
        if noted is None:
            return None
        try:
            return msgspec.json.decode(noted["first"], type=dict[str, int])
        except (KeyError, *_UNREADABLE) as error:
            rule = "must hold a number for each sender"
            raise RecordingError(
                f"{self.path}: {SHARE}: {rule}, got {error}"
            ) from error

    @property
    def places(self) -> dict[str, Place]:
        """Where the parts are that said so: those of a swarm on several machines.

        Raises:
            RecordingError: What is noted of that is not what a writer writes.
        """
        places = {}
        for who, text in self.layout.metadata.get(PLACES, {}).items():
            place = Place.read(text)
            if place is None:
                rule = "must hold a place for each part"
                raise RecordingError(
                    f"{self.path}: {PLACES}: {rule}, got {text[:40]!r}"
                )
            places[who] = place
        return places

    def _number(self, name: str) -> int:
        text = self.metadata.get(name, "")
        # Not of any length: Python refuses to read one of thousands of digits.
        if not (text.isascii() and text.isdecimal() and len(text) < 10):
            rule = "must be a number"
            raise RecordingError(f"{self.path}: {name}: {rule}, got {text[:40]!r}")
        return int(text)

    @property
    def swarm(self) -> str:
        """The id of the swarm that was recorded."""
        return self.metadata.get("swarm", "recorded")

    @property
    def totals(self) -> dict[str, str] | None:
        """What was written at the end; None if the recording did not get there."""
        return self.layout.metadata.get(TOTALS)

    @property
    def closing(self) -> wire.Decision | None:
        """The decision of a file's last tick, where that opens the file after it.

        None where no file follows, or it was written before that was noted.

        Raises:
            RecordingError: What is noted there is no decision.
        """
        noted = (self.totals or {}).get(CLOSING)
        if noted is None:
            return None
        try:
            return msgspec.json.decode(noted, type=wire.Decision)
        except _UNREADABLE as error:
            rule = "must hold a decision"
            raise RecordingError(f"{self.path}: {CLOSING}: {rule}, got {error}") from (
                error
            )

    @property
    def cut(self) -> Cut | None:
        """Where the file was cut short; None for a finished one."""
        return self.layout.cut

    @property
    def damage(self) -> tuple[str, ...]:
        """What cannot be read or is known to be missing, a line each; empty: nothing.

        That a file was cut short is not in here, nor what was lost on the way to it.
        """
        damage, gaps = self.layout.damage, self.layout.gaps
        spoiled = (f"bytes {one.start} to {one.stop}: {one.why}" for one in damage)
        missing = (f"messages are missing: {gap.why}" for gap in gaps)
        return tuple(f"{self.path}: {line}" for line in (*spoiled, *missing))

    @property
    def whole(self) -> bool:
        """It has its end, no damage, and lacks no message; never of a piece.

        Raises:
            RecordingError: The totals are not what a writer writes.
        """
        return (
            self._begins is None
            and self.cut is None
            and not self.damage
            and self.noted().completeness.whole
        )

    @property
    def snapshot(self) -> bytes | None:
        """The final snapshot; None if there was none, or it was not written.

        Raises:
            RecordingError: The file cannot be read any more.
        """
        attached = self.layout.attachments.get(SNAPSHOT)
        if attached is None:
            return None
        with opened(self.path) as file:
            file.seek(attached.offset)
            body = file.read(attached.length)
        try:
            attachment: Attachment = parse(Attachment.read, body)
        except ValueError as error:
            rule = "must still be what was opened"
            raise damaged(self.path, attached.offset, rule, error) from error
        return attachment.data

    @property
    def gaps(self) -> int:
        """At how many places its writer noted that messages are missing."""
        return len(self.layout.gaps)

    def noted(self) -> Noted:
        """Return the balance as the writer noted it; empty if it did not get there.

        Raises:
            RecordingError: The totals are not what a writer writes.
        """
        if self.totals is None:
            return Noted(Completeness(0), {})
        try:
            return Noted(
                msgspec.json.decode(self.totals["completeness"], type=Completeness),
                msgspec.json.decode(self.totals["expected"], type=dict[str, int]),
            )
        except (KeyError, *_UNREADABLE) as error:
            rule = "must hold completeness and expected"
            raise RecordingError(
                f"{self.path}: {TOTALS}: {rule}, got {error}"
            ) from error

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int = 0,
        end: int = EVER,
    ) -> Iterator[Recorded]:
        """Return the messages in the order they were recorded.

        Args:
            topics: Only these, named as in `wire.TOPICS`; None: all. The others are
                not decoded, and in a finished recording chunks without any of them
                are not even unpacked.
            start: Only those recorded at this time or later, nanoseconds.
            end: Only those recorded before this time, nanoseconds.

        Raises:
            InvalidValueError: A topic is unknown.
            RecordingError: While iterating: the recording is not any more what was
                opened, or holds a message under a topic that is not its own.
        """
        wanted = frozenset(wire.TOPICS if topics is None else topics)
        for topic in wanted - wire.TOPICS.keys():
            rule = f"must be of {', '.join(wire.TOPICS)}"
            raise InvalidValueError("topics", rule, topic)
        return self._decoded(wanted, start, end)

    def _decoded(
        self, topics: frozenset[str], start: int, end: int
    ) -> Iterator[Recorded]:
        decoders = {
            topic: msgspec.json.Decoder(wire.TOPICS[topic]).decode for topic in topics
        }
        for chunk, found, names in self._chunks_with(topics, start, end):
            for topic, sequence, log_time, sent, payload in _chosen(found, names):
                if not start <= log_time < end:
                    continue
                try:
                    message = decoders[topic](payload)
                except _UNREADABLE as error:
                    raise self._wrong(chunk, topic, error) from error
                # The type fits the topic, and yet a pulse that excites is not one
                # that inhibits.
                if wire.topic(message.key) != topic:
                    raise self._wrong(chunk, topic, f"one for {message.key}")
                yield Recorded(message, payload, sequence, sent, log_time)

    def _chunks_with(
        self, topics: frozenset[str], start: int, end: int
    ) -> Iterator[tuple[Chunk, ChunkIndex, dict[int, str]]]:
        """Yield the chunks that may hold messages asked for, and those channels."""
        layout = self.layout
        # For each channel its topic; None where it was not asked for.
        wanted: dict[int, str | None] = {}
        for channel in layout.channels.values():
            wanted[channel.id] = self._topic(channel, topics)
        skips = layout.indexed and bool(layout.channels)
        with opened(self.path) as file:
            for chunk in layout.chunks:
                if skips and not (
                    chunk.start < end
                    and chunk.end >= start
                    and any(wanted.get(channel) for channel in chunk.counts)
                ):
                    continue
                found = index_chunk(self.path, file, chunk)
                present = found.present()
                self._register(chunk, found, present, wanted, topics)
                names = {n: topic for n in present if (topic := wanted[n]) is not None}
                if names:
                    yield chunk, found, names

    def _topic(self, channel: Channel, topics: frozenset[str]) -> str | None:
        """Return the topic of a channel, or None where it was not asked for."""
        topic = channel.topic.removeprefix("/")
        if topic not in wire.TOPICS or channel.message_encoding != "json":
            got = f"{channel.topic} in {channel.message_encoding}"
            rule = "must be a topic in json"
            raise RecordingError(f"{self.path}: channel: {rule}, got {got}")
        return topic if topic in topics else None

    def _register(
        self,
        chunk: Chunk,
        found: ChunkIndex,
        present: list[int],
        wanted: dict[int, str | None],
        topics: frozenset[str],
    ) -> None:
        """Add a chunk's channels to `wanted`; they hold for the chunks after it, too.

        Args:
            chunk: Of this file.
            found: The messages of the chunk.
            present: Their channels.
            wanted: Of each channel that is known its topic, where it was asked for.
            topics: What was asked for.

        Raises:
            RecordingError: A message is of a channel that is not registered before it.
        """
        for channel in found.registered.values():
            topic = self._topic(channel, topics)
            if channel.id in found.late and wanted.get(channel.id, "") != topic:
                rule = "channel must be registered"
                raise damaged_in(self.path, chunk, rule, channel.id)
            wanted[channel.id] = topic
        for number in present:
            if number not in wanted:
                rule = "channel must be registered"
                raise damaged_in(self.path, chunk, rule, number)

    def _wrong(self, chunk: Chunk, topic: str, got: object) -> RecordingError:
        rule = f"/{topic} must hold its own messages"
        return damaged_in(self.path, chunk, rule, got)


def _chosen(
    found: ChunkIndex, names: dict[int, str]
) -> Iterator[tuple[str, int, int, int, bytes]]:
    """Yield topic, sequence, log time, time sent and payload of each message.

    Those of the channels in `names`, in the order they were recorded. All that is read
    passes here, half a million messages a second and more.
    """
    asked = np.zeros(1 << 16, np.bool_)
    asked[list(names)] = True
    chosen = np.flatnonzero(asked[found.channels])
    channels = found.channels[chosen].tolist()
    starts, stops = found.starts[chosen].tolist(), found.stops[chosen].tolist()
    data, facts = found.data, FACTS.unpack_from
    for channel, at, stop in zip(channels, starts, stops, strict=True):
        sequence, log_time, sent = facts(data, at - FACTS.size)
        yield names[channel], sequence, log_time, sent, data[at:stop]


def identity(path: Path) -> tuple[int, int]:
    """Return what tells a file from another of the same name.

    Raises:
        RecordingError: It cannot be read.
    """
    with opened(path) as file:
        found = os.fstat(file.fileno())
    return found.st_dev, found.st_ino
