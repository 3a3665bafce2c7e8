"""The journal: keeps the readings of a live source on disk until they are recorded.

What comes from outside comes once. So each row, the readings of one tick, is written
here before it is used, and a run that goes on after a death reads it again; and so is
what was taken in since, before its sender is told that it arrived. A row's number is
its tick; what was done at a tick is noted before it is done, so that it is never done
twice.

The journal is a folder of files, each a few records long: first what the file begins
with, then rows. Nothing is ever written into a file again that another process began,
so a record cut in half can only be the last of its file. Files are deleted from the
oldest on (`cut`), once all their rows are on the disk in the recording, behind the last
key-frame but one; one without rows once another has begun.

A record stands behind its length and a checksum of both. A reader takes what is whole
and right from the start of a file, and stops at the first record that is neither: bytes
that are cut off, flipped or zeroed can hide records behind them, but never change one.

A row that was written survives the death of any process. A power cut costs what was
written since the last `Journal.sync`.

It is no SQLite: that survives kills and power cuts as well, but a bit that flips on the
disk changes readings there without a word, or makes all of it unreadable; and a row is
4 KiB of its log, of some 20 bytes here.
"""

import contextlib
import itertools
import os
import secrets
import shutil
import struct
import threading
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Self, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.errors import InvalidValueError, NeurosnapError
from neurosnap.sensorium import pack, unpack
from neurosnap.sources.protocol import Observed
from neurosnap.system.durable import sync_folder

SUFFIX = ".journal"
"""What a journal's name ends with, after that of its recording."""
_ROWS = 256  # rows after which another file begins
_SIZE = 1 << 18  # bytes after which one begins that is not for a row
_NAME = "rows"
_LONGEST = 1 << 26  # bytes of a record at most; a longer one is damage
_HEAD = struct.Struct("<II")  # length and checksum
Number: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]
Readings: TypeAlias = dict[int, tuple[bool | None, float]]
"""By sensor: what was read last, and when, in seconds since the epoch."""


class Taken(msgspec.Struct, frozen=True, array_like=True, tag="taken"):
    """The readings received since the last row."""

    received: wire.Received = wire.Received()
    """What has been received up to it."""
    readings: Readings = {}
    outages: tuple[wire.Outage, ...] = ()
    """When nothing was listened to since that row."""
    deaf: tuple[float, str] | None = None
    """Since when nothing is listened to, in seconds since the epoch, and why."""


class Begin(msgspec.Struct, frozen=True, array_like=True, tag="begin"):
    """The first record of a journal file."""

    sensors: tuple[str, ...]
    first: Number
    """The number of its first row."""
    acted: int
    """The last tick of which the action was carried out, or begun to be; -1: none."""
    received: wire.Received = wire.Received()
    """What had been received before it."""
    taken: Taken = Taken()
    """What had been taken in since the row before it."""
    run: str = ""
    """What a broker knows the run by."""


class JournalRow(msgspec.Struct, frozen=True, array_like=True, tag="row"):
    """The readings of one tick, as they are kept and handed over."""

    number: Number
    """The tick."""
    bits: bytes
    """What the sensors read, packed."""
    known: bytes
    """Which of the readings are known, packed; empty if all are."""
    begins: bool = False
    """It follows no action: readings before it were missed."""
    received: wire.Received = wire.Received()
    """What has been received up to it."""
    outages: tuple[wire.Outage, ...] = ()
    """When nothing was listened to since the row before."""
    said: bytes = b""
    """The numbers behind it; see `wire.Observation`."""
    due: float = 0
    """When it was there to be given; handed over, as in `wire.Observation`."""
    waiting: int = 0
    """Handed over, as in `wire.Observation`."""

    @classmethod
    def of(cls, seen: Observed, number: int = 0) -> Self:
        """Return the row of an observation."""
        return cls(
            number,
            pack(seen.bits),
            pack_known(seen.known),
            seen.begins,
            seen.received,
            seen.outages,
            seen.said,
            seen.due,
            seen.waiting,
        )

    def observed(self, sensors: int) -> Observed:
        """Return the observation; what is live has no ends, so it was cut off."""
        known = unpack(self.known, sensors) if self.known else None
        bits = unpack(self.bits, sensors)
        return Observed(
            bits,
            known,
            self.begins,
            self.begins,
            self.received,
            self.outages,
            said=self.said,
            due=self.due,
            waiting=self.waiting,
        )


def pack_known(known: NDArray[np.bool_] | None) -> bytes:
    """Return which readings are known as bits; nothing if all are."""
    return b"" if known is None else pack(known)


class Acted(msgspec.Struct, frozen=True, array_like=True, tag="acted"):
    """The record that a tick's action is about to be carried out."""

    tick: Number


Record: TypeAlias = Begin | JournalRow | Taken | Acted
_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[Record] = msgspec.msgpack.Decoder(Record)


class Content(msgspec.Struct, frozen=True):
    """The content of a journal."""

    sensors: tuple[str, ...]
    rows: tuple[JournalRow, ...]
    """In order; numbers are missing where a file was damaged."""
    last: Number
    """The number of its last row, or of the tick that its first is to follow."""
    acted: int
    began: wire.Received
    """What was received before its first row."""
    taken: Taken
    """What was taken in after its last row."""
    run: str

    @property
    def received(self) -> wire.Received:
        """What was received up to its last row."""
        return self._received(self.rows)

    def shown_after(self, tick: int) -> int:
        """Return how many readings the rows after a tick are made of."""
        before = self._received([row for row in self.rows if row.number <= tick])
        return self.received.shown - before.shown

    def _received(self, rows: Sequence[JournalRow]) -> wire.Received:
        return rows[-1].received if rows else self.began


def journal_of(log: Path) -> Path:
    """Return where the journal of a run is, by where it is recorded."""
    return log.with_name(f"{log.name}{SUFFIX}")


def read_journal(folder: Path) -> Content:
    """Return what a journal holds, as far as it is right. O(all of it).

    Raises:
        NeurosnapError: A file of it cannot be read.
    """
    sensors: tuple[str, ...] = ()
    rows: list[JournalRow] = []
    last, acted, began, taken, run = 0, -1, wire.Received(), Taken(), ""
    for path in _files(folder):
        for record in _read(path):
            match record:
                case Begin():
                    sensors, acted = record.sensors, max(acted, record.acted)
                    # Who begun it had no use for what was there from this row on.
                    while rows and rows[-1].number >= record.first:
                        del rows[-1]
                    began = began if rows else record.received
                    last, taken, run = record.first - 1, record.taken, record.run
                case JournalRow():
                    rows.append(record)
                    last = record.number
                    taken = Taken(record.received, deaf=taken.deaf)
                case Taken():
                    taken = _joined(taken, record)
                case Acted():
                    acted = max(acted, record.tick)
    return Content(sensors, tuple(rows), last, acted, began, taken, run)


def _joined(taken: Taken, more: Taken) -> Taken:
    """Return what was taken in by the second of two records since one row."""
    return msgspec.structs.replace(more, readings=taken.readings | more.readings)


def framed(record: bytes) -> bytes:
    """Return a record as it stands in a file, behind its length and checksum."""
    return _HEAD.pack(len(record), _checksum(record)) + record


def records(data: bytes) -> Iterator[bytes]:
    """Yield the records that `data` begins with, up to the first that is not right."""
    at = 0
    while at + _HEAD.size <= len(data):
        length, checksum = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        record = data[at : at + length]
        if length > _LONGEST or len(record) < length or checksum != _checksum(record):
            return
        yield record
        at += length


def _checksum(record: bytes) -> int:
    """Return the checksum of the length, too: zeros are no record."""
    return zlib.crc32(record, zlib.crc32(len(record).to_bytes(4, "little")))


def decoded(data: bytes) -> Iterator[Record]:
    """Yield the records of one file, up to the first that is not right."""
    expected: int | None = None
    for raw in records(data):
        try:
            record = _decoder.decode(raw)
        except (msgspec.MsgspecError, UnicodeDecodeError):  # msgspec lets that through
            return
        if isinstance(record, Begin):
            expected = record.first
        elif expected is None:
            return
        elif isinstance(record, JournalRow):
            if record.number != expected:
                return
            expected += 1
        yield record


def cut(folder: Path, tick: int) -> None:
    """Delete the files of a journal that hold no row after a tick.

    The journal need not exist. All rows up to the tick are where they are safe.

    Raises:
        NeurosnapError: A file cannot be read, or deleted.
    """
    if not folder.is_dir():
        return
    files = _files(folder)
    for path, following in itertools.pairwise(files):
        begin = next(iter(_read(following)), None)
        if not isinstance(begin, Begin) or begin.first > tick + 1:
            return
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise _failed("deletable", error, path) from error


def remove(folder: Path) -> None:
    """Delete a journal, if it is there."""
    with contextlib.suppress(FileNotFoundError):
        shutil.rmtree(folder)


class Journal:
    """Writes a journal; not to be used from two threads at once, `sync` excepted.

    Args:
        folder: Where it is, or is to be. Only the owner may read it.
        sensors: The sensors' names.
        deaf: Why the process that wrote it before is gone, in the midst of a run.
        run: What a broker knows the run by; if empty, and new, it is drawn.

    Raises:
        InvalidValueError: What is there is of other sensors.
        NeurosnapError: It cannot be read, or the disk does not take it; so do the
            methods that read or write.
    """

    def __init__(
        self, folder: Path, sensors: Sequence[str], deaf: str = "", run: str = ""
    ) -> None:
        self.folder = folder
        self._sensors = tuple(sensors)
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
        except OSError as error:
            raise _failed("writable", error, folder) from error
        there = read_journal(folder)
        touched = max((path.stat().st_mtime for path in _files(folder)), default=0.0)
        died = (touched, deaf) if deaf and there.sensors else None
        self.follows = died is not None
        """Another process of the same run wrote it before."""
        self.deaf = there.taken.deaf or died
        """Since when nothing was listened to, in seconds since the epoch, and why."""
        if there.sensors and there.sensors != self._sensors:
            rule = f"must be of the sensors {', '.join(there.sensors)}"
            raise InvalidValueError("journal", rule, str(folder))
        self.last = there.last
        """The number of the last row."""
        self.acted = there.acted
        self.received = there.received
        """What was received up to its last row."""
        self.taken = msgspec.structs.replace(there.taken, deaf=self.deaf)
        """What was taken in since."""
        self.run = there.run or run or secrets.token_hex(8)
        """What a broker knows the run by."""
        self._path: Path | None = None
        self._descriptor = -1
        self._changing = threading.Lock()  # of the file, while another thread syncs it
        self._size = self._rows = 0
        self._dirty = False
        self._begin()

    def write(self, row: JournalRow) -> JournalRow:
        """Write down a row as the next one, whatever its number; return it so."""
        if self._rows >= _ROWS:
            self._begin()
        row = msgspec.structs.replace(row, number=self.last + 1)
        self._append(row)
        self.last += 1
        self.received = row.received
        self.taken = Taken(row.received, deaf=self.taken.deaf)
        self._rows += 1
        return row

    def take(self, taken: Taken) -> None:
        """Write down what is taken in until a row shows it."""
        if self._size >= _SIZE:
            self._begin()
        self._append(taken)
        self.taken = _joined(self.taken, taken)

    def begin_action(self, tick: int) -> bool:
        """Write down that the action of a tick is about to be carried out.

        Returns:
            It may be: it was not begun before.
        """
        if tick <= self.acted:
            return False
        self._append(Acted(tick))
        self.acted = tick
        return True

    def rows_after(
        self, tick: int
    ) -> tuple[JournalRow | None, Sequence[JournalRow], int]:
        """Return the rows after a tick; the next one to come follows them.

        Where they do not follow on that tick, since some were lost, those there are get
        the numbers that do.

        Returns:
            The tick's own row, where it is still there; the rows; and how many more
            there should be.
        """
        there = read_journal(self.folder)
        before = next((row for row in there.rows if row.number == tick), None)
        rows = [row for row in there.rows if row.number > tick]
        numbers = range(tick + 1, tick + 1 + len(rows))
        if self.last >= tick and [row.number for row in rows] == [*numbers]:
            return before, rows, 0
        missing = rows[-1].number - tick - len(rows) if rows else 0
        received = there.began if before is None else before.received
        return before, self.restart(tick, rows, received), missing

    def restart(
        self,
        tick: int,
        rows: Sequence[JournalRow],
        received: wire.Received | None = None,
        taken: Taken | None = None,
    ) -> list[JournalRow]:
        """Let `rows` follow on a tick, and nothing else; return them as numbered then.

        Args:
            tick: The tick.
            rows: What follows.
            received: What was received up to that tick; None if that is known here.
            taken: What was taken in after them; None if that is known here.
        """
        self.last, taken = tick, taken or self.taken
        self.received = received or self.received
        self.taken = Taken(self.received)
        self._begin()
        kept = [self.write(row) for row in rows]
        if taken.received.total > self.received.total or taken.outages or taken.deaf:
            self.take(taken)
        self.sync()
        return kept

    def sync(self) -> None:
        """Let what was written survive a power cut; note the time. From any thread."""
        with self._changing:
            if self._descriptor < 0:
                return
            os.utime(self._descriptor)
            if not self._dirty:
                return
            self._dirty = False
            descriptor = os.dup(self._descriptor)  # another file may begin meanwhile
        try:
            os.fsync(descriptor)
        except OSError as error:
            raise _failed("writable", error, self.folder) from error
        finally:
            os.close(descriptor)

    def close(self) -> None:
        """Close the file; may be called twice, and from any thread."""
        with self._changing:
            if self._descriptor >= 0:
                os.close(self._descriptor)
                self._descriptor = -1

    def _begin(self) -> None:
        """Begin another file."""
        if self._descriptor >= 0:
            self.sync()
        over = self._path if not self._rows else None
        files = _files(self.folder)
        number = int(files[-1].stem) + 1 if files else 0
        path = self.folder / f"{number:010}.{_NAME}"
        flags = os.O_CREAT | os.O_EXCL | os.O_WRONLY | os.O_CLOEXEC
        try:
            descriptor = os.open(path, flags, 0o600)
            sync_folder(self.folder)
        except OSError as error:
            raise _failed("writable", error, path) from error
        self.close()
        self._descriptor = descriptor
        self._path = path
        self._size = self._rows = 0
        first, told = self.last + 1, (self.acted, self.received, self.taken, self.run)
        self._append(Begin(self._sensors, first, *told))
        if over is not None:
            over.unlink(missing_ok=True)

    def _append(self, record: Record) -> None:
        """Write a record, or nothing of it."""
        data = framed(_encoder.encode(record))
        written = 0
        try:
            while written < len(data):  # what is left over says why, the next time
                written += os.write(self._descriptor, data[written:])
        except OSError as error:
            with contextlib.suppress(OSError):
                # What follows half a record is never read.
                os.ftruncate(self._descriptor, self._size)
                os.lseek(self._descriptor, self._size, os.SEEK_SET)
            raise _failed("writable", error, self.folder) from error
        self._size += len(data)
        self._dirty = True


def _files(folder: Path) -> list[Path]:
    """Return the files of a journal, the oldest first."""
    try:
        return sorted(
            path for path in folder.glob(f"*.{_NAME}") if path.stem.isdecimal()
        )
    except OSError as error:
        raise _failed("readable", error, folder) from error


def _read(path: Path) -> Iterator[Record]:
    try:
        data = path.read_bytes()
    except FileNotFoundError:  # the recorder has just cut it off
        return
    except OSError as error:
        raise _failed("readable", error, path) from error
    yield from decoded(data)


def _failed(what: str, error: OSError, path: Path) -> NeurosnapError:
    rule = f"must be {what}, got {error.strerror}"
    return NeurosnapError(f"journal: {rule} for {str(path)!r}")
