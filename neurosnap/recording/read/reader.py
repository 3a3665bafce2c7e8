"""Reads a recording: its messages, its facts, and what is missing.

A recording is verified when it is opened. What is handed out is what was written: of a
file that is damaged, all but what the damage took; `Recording.damage` says where that
is, and `Recording.whole` that nothing is missing. One that was cut short (by a crash, a
full disk, a lost machine) is read to its last whole chunk, and `Recording.cut` says so.

To derive anything one must know where messages are missing: see
`neurosnap.recording.read.stretches`.
"""

from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple, Self

import msgspec
from mcap.records import Attachment

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.location import Place
from neurosnap.recording.format.completeness import Completeness, RunningNumbers
from neurosnap.recording.format.full_scan import scan
from neurosnap.recording.format.messages import EVER, raw_messages
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


class Recording:
    """One recording, open for reading; it holds no file open between reads."""

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path = path
        self.layout = layout

    @classmethod
    def open(cls, path: Path | str) -> Self:
        """Find out what is in a recording, and verify it as far as it goes.

        Reads the file once: two seconds a gigabyte, once cached. One that is damaged
        or has no end is unpacked besides, which takes as long as to read its messages.

        Raises:
            RecordingError: There is no such file, or it is no recording of ours, or of
                a newer kind.
        """
        path = Path(path)
        return cls.seen(path, scan(path))

    @classmethod
    def seen(cls, path: Path, layout: Layout) -> Self:
        """Return a recording of which somebody found out what lies where.

        Args:
            path: The recording.
            layout: By `neurosnap.recording.format.full_scan` or
                `neurosnap.recording.format.index_scan`.

        Raises:
            RecordingError: It says nothing of its run, or is of another schema.
        """
        recording = cls(path, layout)
        recording._verify_run()  # its own
        return recording

    def _verify_run(self) -> None:
        """Refuse a recording that says nothing of its run, or is of another schema."""
        if RUN not in self.layout.metadata:
            if self.layout.chunks or self.finished or self.layout.damage:
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
        """The tick of the key-frame that it begins with; 0: it begins with the run.

        Raises:
            RecordingError: What it says of that is no number.
        """
        return self._number("begins") if self.part else 0

    @property
    def share(self) -> dict[str, int] | None:
        """The number each sender's share of a later file begins with.

        None where the file was cut before all were known.

        Raises:
            RecordingError: What it says of that is not what a writer writes.
        """
        noted = self._believed(SHARE)
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
        for who, text in (self._believed(PLACES) or {}).items():
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
        return self._believed(TOTALS)

    def _believed(self, name: str) -> dict[str, str] | None:
        """Return metadata, unless it may be wrong."""
        return None if self.layout.doubts(name) else self.layout.metadata.get(name)

    def demand_facts(self) -> None:
        """Refuse a recording of whose run nothing is known for sure.

        Raises:
            RecordingError: It is damaged, and so may be what is written of its run.
        """
        if self.layout.doubts(RUN):
            rule = "must have a checksum of their own where a recording is damaged"
            raise RecordingError(
                f"{self.path}: options: {rule}, got none: they may be wrong"
            )

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
    def finished(self) -> bool:
        """The file has its end."""
        return self.layout.cut is None

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
        """It has its end, no damage, and lacks no message.

        Raises:
            RecordingError: The totals are not what a writer writes.
        """
        return self.finished and not self.damage and self.noted().completeness.whole

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

    def blank_sequences(self) -> RunningNumbers:
        """Return the senders' running numbers before any message has come."""
        share = self.share
        return RunningNumbers(share or {}, anywhere=share is None)

    def sequences(self) -> RunningNumbers:
        """Read all messages and return every sender's running numbers.

        Raises:
            RecordingError: As `messages`.
        """
        sequences = self.blank_sequences()
        for recorded in self.messages():
            sequences.receive(recorded.message.sender, recorded.sequence)
        return sequences

    @property
    def gaps(self) -> int:
        """At how many places its writer noted that messages are missing."""
        return len(self.layout.gaps)

    def completeness(self) -> Completeness:
        """Read all messages and return whether any is missing.

        In a finished recording that includes what senders say they sent after the last
        that was recorded, and counts what the writer left out.

        Raises:
            RecordingError: As `messages`, or the totals are not what a writer writes.
        """
        return self.balance(self.sequences())

    def balance(self, sequences: RunningNumbers) -> Completeness:
        """Return `completeness`, by running numbers that were read already.

        Raises:
            RecordingError: The totals are not what a writer writes.
        """
        noted = self.noted()
        balance = sequences.completeness(
            noted.expected, foreign=noted.completeness.foreign
        )
        duplicates = balance.duplicates + noted.completeness.duplicates
        return msgspec.structs.replace(balance, duplicates=duplicates, gaps=self.gaps)

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

    def _decoded(
        self, topics: frozenset[str], start: int, end: int
    ) -> Iterator[Recorded]:
        decoders = {
            topic: msgspec.json.Decoder(wire.TOPICS[topic]).decode for topic in topics
        }
        for chunk, raws in raw_messages(self.path, self.layout, topics, start, end):
            for topic, sequence, log_time, sent, payload in raws:
                try:
                    message = decoders[topic](payload)
                except _UNREADABLE as error:
                    raise self._wrong(chunk, topic, error) from error
                # The type fits the topic, and yet a pulse that excites is not one
                # that inhibits.
                if wire.topic(message.key) != topic:
                    raise self._wrong(chunk, topic, f"one for {message.key}")
                yield Recorded(message, payload, sequence, sent, log_time)

    def _wrong(self, chunk: Chunk, topic: str, got: object) -> RecordingError:
        rule = f"/{topic} must hold its own messages"
        return damaged_in(self.path, chunk, rule, got)
