"""One file of a recording: its metadata, its messages, what is missing.

What is handed out is what was written: of a file that is damaged, all but what the
damage took. A file may be looked at in part: some chunks, one behind the other, behind
a place where messages are missing.
"""

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
from mcap.records import Channel

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.recording.format.chunk_index import index_chunk
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.cuts_and_damage import scan, scan_index
from neurosnap.recording.format.records import (
    RUN,
    SHARE,
    TOTALS,
    Chunk,
    Cut,
    Layout,
    damaged_in,
    opened,
)
from neurosnap.recording.read.chunk_messages import ChunkMessages, Recorded, decoded

_AS_WRITTEN = dict(enumerate(wire.TOPICS, start=1))
"""For each channel its topic, as our writer numbers them."""


class Noted(msgspec.Struct, frozen=True):
    """The writer's final note on completeness."""

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
        RecordingError: It says nothing of its run, or is of another schema; from what
            looks into it: it says there what no writer writes.
    """

    def __init__(
        self, path: Path, layout: Layout, *, begins: int | None = None, lost: str = ""
    ) -> None:
        self.path = path
        self.layout = layout
        self.lost = lost
        self._begins = begins
        self._topics: dict[int, str] | None = None
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
        """Which of the files of its run it is, from 0; None if it is the only one."""
        return self._number("part") if "part" in self.metadata else None

    @property
    def begins(self) -> int:
        """The tick of the key-frame it begins with; 0 if it begins with the run."""
        if self._begins is not None:
            return self._begins
        return self._number("begins") if self.part else 0

    @property
    def share(self) -> dict[str, int] | None:
        """The number each sender's share of a later file begins with.

        None where the file was cut before all were known, or of a piece behind a place
        where messages are missing.
        """
        if self.lost:
            return None
        noted = self.layout.metadata.get(SHARE)
        if not self.part:
            return {}
        if noted is None:
            return None
        rule = "must hold a number for each sender"
        where = f"{self.path}: {SHARE}"
        return decoded(noted.get("first"), dict[str, int], where, rule)

    def _number(self, name: str) -> int:
        text = self.metadata.get(name, "")
        # Not of any length: Python refuses to read one of thousands of digits.
        if not (text.isascii() and text.isdecimal() and len(text) < 10):
            rule = "must be a number"
            raise RecordingError(f"{self.path}: {name}: {rule}, got {text[:40]!r}")
        return int(text)

    @property
    def totals(self) -> dict[str, str] | None:
        """What was written at the end; None if the recording did not get there."""
        return self.layout.metadata.get(TOTALS)

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
        """It has its end, no damage, and lacks no message; never of a piece."""
        return (
            self._begins is None
            and self.cut is None
            and not self.damage
            and self.noted().completeness.whole
        )

    def noted(self) -> Noted:
        """Return the balance as the writer noted it; empty if it did not get there."""
        if self.totals is None:
            return Noted(Completeness(0), {})
        where = f"{self.path}: {TOTALS}", "must hold completeness and expected"
        completeness = self.totals.get("completeness")
        expected = self.totals.get("expected")
        return Noted(
            decoded(completeness, Completeness, *where),
            decoded(expected, dict[str, int], *where),
        )

    def messages(
        self,
        topics: Collection[str] | None = None,
        *,
        start: int = 0,
    ) -> Iterator[Recorded]:
        """Return the messages in the order they were recorded.

        Args:
            topics: Only these, named as in `wire.TOPICS`; if None, all. The others are
                not decoded, and in a finished recording chunks without any of them
                are not even unpacked.
            start: Those before the first that was recorded at this time or later,
                nanoseconds, are left out. What follows may be older by a clock that
                was put back.

        Raises:
            InvalidValueError: A topic is unknown.
            RecordingError: While iterating: the recording is not any more what was
                opened, or holds a message under a topic that is not its own.
        """
        wanted = frozenset(wire.TOPICS if topics is None else topics)
        for topic in wanted - wire.TOPICS.keys():
            rule = f"must be of {', '.join(wire.TOPICS)}"
            raise InvalidValueError("topics", rule, topic)
        return self._selected(wanted, start)

    def _selected(self, topics: frozenset[str], start: int) -> Iterator[Recorded]:
        layout, known = self.layout, self.topics
        skips, asked = layout.indexed, {None, *topics}
        for chunk in layout.chunks:
            if not skips or (
                chunk.end >= start
                and any(known.get(channel) in asked for channel in chunk.counts)
            ):
                # Opened for each chunk: a reader that stops leaves no file open.
                yield from self.chunk(chunk).recorded(topics, start)
            start = 0 if start <= chunk.end else start

    def chunk(self, chunk: Chunk) -> ChunkMessages:
        """Return the messages of a chunk of this file.

        Raises:
            RecordingError: It is not any more what was opened, or holds what no chunk
                of ours holds.
        """
        with opened(self.path) as file:
            found = index_chunk(self.path, file, chunk)
        # Channels that are registered in it go first.
        topics = {**self.topics, **self._named(found.registered.values())}
        for number in np.flatnonzero(np.bincount(found.channels)).tolist():
            if number not in topics:
                raise damaged_in(self.path, chunk, "channel must be registered", number)
        return ChunkMessages(self.path, chunk, found, topics)

    @property
    def topics(self) -> dict[int, str]:
        """For each channel its topic, by the first chunk.

        Where that is damaged, channels are numbered as the writer numbers them.

        Raises:
            RecordingError: One is not of ours.
        """
        if self._topics is None and self.layout.first is not None:
            registered: Iterable[Channel] = ()
            with suppress(RecordingError), opened(self.path) as file:
                found = index_chunk(self.path, file, self.layout.first)
                registered = found.registered.values()
            self._topics = self._named(registered) or _AS_WRITTEN
        return self._topics or _AS_WRITTEN

    def _named(self, channels: Iterable[Channel]) -> dict[int, str]:
        """Return for each channel its topic."""
        topics = {}
        for channel in channels:
            topic = channel.topic.removeprefix("/")
            if topic not in wire.TOPICS or channel.message_encoding != "json":
                got = f"{channel.topic} in {channel.message_encoding}"
                rule = "must be a topic in json"
                raise RecordingError(f"{self.path}: channel: {rule}, got {got}")
            topics[channel.id] = topic
        return topics


def identity(path: Path) -> tuple[int, int]:
    """Return what tells a file from another of the same name.

    Raises:
        RecordingError: It cannot be read.
    """
    with opened(path) as file:
        found = os.fstat(file.fileno())
    return found.st_dev, found.st_ino
