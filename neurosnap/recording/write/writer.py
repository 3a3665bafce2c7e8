"""Writes messages to one MCAP file, as they were on the wire.

What is in the file can be read back: a payload goes in only if it decodes, under its
own key, and only once. Whatever happens after a chunk was flushed (a crash, a full
disk), that chunk stays readable; `finish` adds the index and the totals.

Every payload is decoded in full before it goes in. Reading just the sender out of it
would save a third of a microsecond of five, and would let through what no reader could
decode afterwards.
"""

import io
import logging
import os
import shutil
import zlib
from collections import OrderedDict
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import chain, count
from pathlib import Path
from typing import Self

import msgspec
from mcap.data_stream import RecordBuilder
from mcap.records import ChunkIndex
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from neurosnap import wire
from neurosnap.errors import InvalidValueError, MessageError, RecordingError
from neurosnap.recording.format import schemas
from neurosnap.recording.format.completeness import Completeness, RunningNumbers
from neurosnap.recording.format.records import (
    GAP,
    LIMIT,
    PROFILE,
    RATIO,
    RUN,
    SHARE,
    TOTALS,
    room,
    sealed_facts,
)
from neurosnap.system.distribution import version
from neurosnap.system.durable import OwnFile, sync_folder

_log = logging.getLogger(__name__)
_LARGEST_PAYLOAD = LIMIT // 2
"""A chunk is closed once it is full, so it holds at most one payload beyond its size;
both together stay well below what the reader takes."""
_APART = 1 << 13  # bytes; no block of a disk has the start and what is behind it
_PADDING = 1 << 16  # bytes; more than all channels take
_BEFORE = 31  # bytes of a chunk before each payload
_RECENT = 1 << 14  # messages
_SEQUENCES = 1 << 32
_TIMES = 1 << 64


class Writer:
    """Writes one recording; to be used from one thread.

    A `Writer` left by `with` or `abandon` before `finish` leaves a recording without
    totals and index, readable to its last message. After an error from the file system
    the writer is closed, and the file readable to its last whole chunk.

    Args:
        path: Where to write; must not exist yet. Only the owner may read it.
        packs: Whether chunks are packed, with zstd.
        chunk: Bytes (before packing) after which a chunk is closed, up to 64 MiB.

    Raises:
        RecordingError: The file exists already, or cannot be made; from any method: it
            was not started, is closed already, or cannot be written.
    """

    def __init__(
        self,
        path: Path | str,
        *,
        packs: bool = True,
        chunk: int = 1 << 20,
    ) -> None:
        self.path = Path(path)
        self.sequences = RunningNumbers()
        self.foreign = 0
        self.recent: OrderedDict[tuple[str, int], int] = OrderedDict()  # checksums
        self._twice: set[str] = set()  # senders that are there more than once
        self._gaps = 0  # that were noted
        self._unpacked = _PADDING  # bytes of all chunks, the channels among them
        self._room = room(0)  # bytes that they may have, at least
        self._started = False
        self._facts: dict[str, str] = {}  # of the run
        self._copied = _APART  # bytes from which on they are written once more
        self.file = OwnFile(_create(self.path))
        self._harm = ""
        self._stream = io.BufferedWriter(self.file)
        self._open = True
        # The checksum of the whole data section is the only one that covers metadata,
        # attachments and message indexes.
        self._mcap = McapWriter(
            self._stream,
            chunk_size=chunk,
            compression=CompressionType.ZSTD if packs else CompressionType.NONE,
            enable_data_crcs=True,
        )
        # Under this name the library collects them; under another it goes on to.
        vars(self._mcap)["_Writer__chunk_indices"] = _ChunkIndexes()
        self._mcap.start(PROFILE, f"neurosnap {version()}")
        self._channels = self._register()

    def _register(self) -> dict[str, int]:
        """Register a channel a topic; return the channel of each.

        The library numbers them from 1, and a reader that finds none registered goes by
        the order of `wire.TOPICS`.
        """
        types = dict.fromkeys(wire.TOPICS.values())
        ids = {
            message: self._mcap.register_schema(
                schemas.name(message), schemas.ENCODING, schemas.encoded(message)
            )
            for message in types
        }
        return {
            topic: self._mcap.register_channel(f"/{topic}", "json", ids[message])
            for topic, message in wire.TOPICS.items()
        }

    @property
    def is_open(self) -> bool:
        """More can be written; not after its end, or an error from the file system."""
        return self._open

    @property
    def size(self) -> int:
        """Bytes given to the file, the chunk in progress not among them."""
        return self._stream.tell()

    def start(self, metadata: Mapping[str, str]) -> None:
        """Write what the run is, before its first message; the schema number is added.

        Raises:
            InvalidValueError: A text cannot be written as UTF-8.
        """
        self._demand(self._open and not self._started, "must be started once")
        facts = {**_plain(metadata), "schema": str(wire.SCHEMA)}
        self._started = True
        self._facts = facts
        try:
            self._mcap.add_metadata(RUN, sealed_facts(RUN, facts))
            self._stream.flush()
        except OSError as error:
            raise self._failed(error) from error

    def add(
        self,
        delivery: wire.Delivery,
        log_time: int,
        message: wire.Message | None = None,
    ) -> wire.Message | None:
        """Write one message, unless it is foreign or its number came before.

        Foreign is what does not decode, came under another key than its own, carries
        a number or a time that no sender of ours sends, or is larger than 64 MiB. It
        is counted in `foreign` and touches no sender's running number.

        Args:
            delivery: As it arrived.
            log_time: When it arrived, nanoseconds since the epoch.
            message: What it is, where that is known: from `read`, or from another
                recording.

        Returns:
            The message; None if it is foreign.

        Raises:
            RecordingError: The recording is not open, or the disk does not take what it
                is given.
            InvalidValueError: `log_time` is no time.
        """
        if not (self._started and self._open):
            self._demand(False, "must be started and open")
        if message is None and (message := self.read(delivery)) is None:
            return None
        key, sequence, sent, payload = delivery
        # The library counts a message before it packs it, and leaves half a record
        # behind if a number does not fit: nothing may fail in there.
        if not 0 <= log_time < _TIMES:
            raise InvalidValueError("log_time", "must be in [0, 2^64)", log_time)
        number, checksum = (message.sender, sequence), zlib.crc32(payload)
        if self.sequences.receive(*number):
            self.recent[number] = checksum
            if len(self.recent) > _RECENT:
                self.recent.popitem(last=False)
            channel = self._channels[wire.topic(key)]
            self._unpacked += _BEFORE + len(payload)
            try:
                if self._unpacked > self._room:
                    self._make_room()
                self._mcap.add_message(channel, log_time, payload, sent, sequence)
            except OSError as error:
                raise self._failed(error) from error
        elif self.recent.get(number) != checksum and message.sender not in self._twice:
            # Two parts speak as this one, or it came too long ago to tell.
            self._twice.add(message.sender)
            rule = f"must be there once, got two messages of number {sequence}"
            _log.error("log: %s: %s", message.sender, rule)
            self.write_gap(f"{message.sender}: {rule}")
        return message

    def _make_room(self) -> None:
        """Make the file as long as it must be for what it unpacks to."""
        if (lacking := self._unpacked - room(self.size)) > 0:
            padding = bytes(_PADDING + lacking // RATIO)
            self._mcap.add_attachment(0, 0, "neurosnap.padding", "", padding)
        self._room = room(self.size)

    def read(self, delivery: wire.Delivery) -> wire.Message | None:
        """Return what was delivered; None if it is foreign, and counted as that."""
        key, sequence, sent, payload = delivery
        try:
            message = wire.decode(key, payload)
        except MessageError:
            message = None
        if (
            message is None
            or not 0 <= sequence < _SEQUENCES
            or not 0 <= sent < _TIMES
            or len(payload) > _LARGEST_PAYLOAD
        ):
            self.foreign += 1
            return None
        return message

    def write_share(self) -> None:
        """Write down what numbers the senders' shares of this file begin with."""
        first = msgspec.json.encode(self.sequences.first).decode()
        self._write_metadata(SHARE, {"first": first})

    def write_gap(self, why: str) -> None:
        """Write down that messages are missing here."""
        self._write_metadata(GAP, {"why": why})
        self._gaps += 1

    def _write_metadata(self, name: str, facts: Mapping[str, str]) -> None:
        """Write metadata behind what has come so far."""
        self._demand(self._started and self._open, "must be started and open")
        try:
            self._mcap.flush()
            self._mcap.add_metadata(name, sealed_facts(name, facts))
            self._stream.flush()
        except OSError as error:
            raise self._failed(error) from error

    def flush(self) -> None:
        """Close the chunk in progress and give it to the operating system.

        What was flushed survives the end of this process, and a power cut once it was
        synced, too; see `neurosnap.recording.write.fsync_thread`.
        """
        self._demand(self._open, "must be open")
        try:
            self._mcap.flush()
            if self.size > self._copied:
                self._write_again()
        except OSError as error:
            raise self._failed(error) from error

    def _write_again(self) -> None:
        """Write what the run is once more, and again at 16 times the length.

        Nothing can be derived without it, and any beginning of a file may be lost.
        """
        self._mcap.add_metadata(RUN, sealed_facts(RUN, self._facts))
        self._stream.flush()
        self._copied = 16 * self.size

    def finish(
        self,
        totals: Mapping[str, str],
        expected: Mapping[str, int],
        *,
        saves: bool = True,
    ) -> Completeness:
        """Write the totals and the index; close.

        What was finished survives a power cut; that takes as long as the disk does.

        Args:
            totals: Anything worth keeping of the run as a whole; the balance is added.
            expected: For each sender, how many messages it says it sent.
            saves: Whether to `save` it. If not, that is what is left to do: until then
                it survives the end of this process alone.

        Returns:
            What the recording holds of what was sent.

        Raises:
            RecordingError: The recording was not started, is closed already, or cannot
                be written; it stays readable up to its last whole chunk.
            InvalidValueError: A text cannot be written as UTF-8.
        """
        self._demand(self._started and self._open, "must be started and open")
        completeness = self.balance(expected)
        balance = {"completeness": completeness, "expected": dict(expected)}
        facts = _plain(totals) | {
            name: msgspec.json.encode(value).decode() for name, value in balance.items()
        }
        try:
            self._mcap.flush()
            self._write_again()
            self._mcap.add_metadata(TOTALS, sealed_facts(TOTALS, facts))
            self._mcap.finish()
            self._stream.flush()
        except OSError as error:
            raise self._failed(error) from error
        self._open = False
        if saves:
            self.save()
        return completeness

    def balance(self, expected: Mapping[str, int]) -> Completeness:
        """Return the completeness so far; `expected` as in `finish`."""
        balance = self.sequences.completeness(expected, foreign=self.foreign)
        return msgspec.structs.replace(balance, gaps=self._gaps)

    def save(self) -> None:
        """Wait until the disk has all; read it back for `harm`; close. Any thread."""
        try:
            os.fsync(self._stream.fileno())
            self.file.read_back(whole=True)
            self._harm = self.harm
            self._rescue()
            with suppress(FileNotFoundError):  # then the folder was moved, or deleted
                sync_folder(self.path.parent)
            self._stream.close()
        except OSError as error:
            raise self._failed(error) from error

    @property
    def harm(self) -> str:
        """Damage to the file by other programs or its disk; empty if none."""
        if self._stream.closed:
            return self._harm
        is_there = False
        with suppress(OSError):
            is_there = os.path.samestat(self.path.stat(), os.fstat(self.file.fileno()))
        if not is_there:
            return "deleted, moved or replaced"
        if self.file.is_as_written():
            return ""
        if not self._harm:
            self._copied = 0  # its start, which says what the run is, may be lost
            self._harm = "cut short, appended to or written over"
        return self._harm

    def abandon(self) -> None:
        """Close without totals and index; do nothing if closed already."""
        if not self._open:
            return
        try:
            self._mcap.flush()
            self._stream.flush()
            self._rescue()
            self._stream.close()
        except OSError as error:
            raise self._failed(error) from error
        self._open = False

    def _rescue(self) -> None:
        """Copy what was written if the file was deleted meanwhile.

        The system keeps what a program has open, whatever becomes of its name, and
        drops it with the last name once it is closed. The copy goes where the file was,
        or beside what is there now.
        """
        descriptor = self._stream.fileno()
        if os.fstat(descriptor).st_nlink:
            return
        stem, suffix, shown = self.path.stem, self.path.suffix, repr(str(self.path))
        names = (self.path.with_name(f"{stem}.recovered-{n}{suffix}") for n in count(1))
        free = next(path for path in chain([self.path], names) if not path.exists())
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            copy = os.fdopen(_create(free), "wb")
            try:
                with copy, Path(f"/proc/self/fd/{descriptor}").open("rb") as old:
                    shutil.copyfileobj(old, copy, 1 << 20)
                    copy.flush()
                    os.fsync(copy.fileno())
            except OSError:
                free.unlink(missing_ok=True)
                raise
        except (OSError, RecordingError) as error:
            got = f"{error} for {shown}"
            _log.error("log: what was deleted must be copied, got %s", got)
        else:
            _log.error("log: %s was deleted; copied to %r", shown, str(free))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.abandon()

    def _demand(self, held: bool, rule: str) -> None:
        if not held:
            raise RecordingError(f"log: {rule}, got {str(self.path)!r}")

    def _failed(self, error: OSError) -> RecordingError:
        """Close without writing another byte; return the error to raise.

        The buffer is dropped with the descriptor: the library has lost what it was
        about to write, and anything after it would stand in the wrong place.
        """
        self._open = False
        # Closed all the same if that fails, and the first error is the one that says.
        with suppress(OSError):
            self._stream.raw.close()
        return RecordingError(
            f"log: must take what is recorded, got {error.strerror}"
            f" for {str(self.path)!r}"
        )


class _ChunkIndexes:
    """The index of all chunks, packed: as objects they take eight times the memory."""

    def __init__(self) -> None:
        self._packed = RecordBuilder()

    def append(self, index: ChunkIndex) -> None:
        """Add the next chunk."""
        index.write(self._packed)

    def __iter__(self) -> Iterator[Self]:
        yield self

    def write(self, summary: RecordBuilder) -> None:
        """Write all to a summary, as a single index would be."""
        summary.write(self._packed.end())


def _create(path: Path) -> int:
    """Create the file for its owner alone; return its descriptor."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
    try:
        return os.open(path, flags, 0o600)
    except FileExistsError as error:
        raise RecordingError(f"log: must not exist yet, got {str(path)!r}") from error
    except FileNotFoundError as error:
        # /proc is there, and yet no file can be made in it.
        there = path.parent.is_dir()
        rule = f"must be in a folder that {'takes files' if there else 'exists'}"
        raise RecordingError(f"log: {rule}, got {str(path)!r}") from error
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name
        raise RecordingError(
            f"log: must be writable, got {str(path)!r} ({error})"
        ) from error


def _plain(texts: Mapping[str, str]) -> dict[str, str]:
    """Return `texts`, once it is sure that each can be written.

    Names from the command line may hold bytes that are no text; the library would
    notice in the middle of a record.
    """
    for name, value in texts.items():
        try:
            f"{name}{value}".encode()
        except UnicodeEncodeError as error:
            raise InvalidValueError(name, "must be text in UTF-8", value) from error
    return dict(texts)
