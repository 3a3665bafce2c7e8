"""Reads the messages of an MCAP file that another program wrote, as a table.

Each field of a message is a signal: ``/arm.joint[0].angle`` of the topic ``/arm``. A
row is what every signal said last at a tick of the clock; what was said longer ago than
three of its topic's usual periods is unknown. A message that cannot be decoded is an
error of its channel, told once, and none of the file. JSON and CDR are decoded.

The file is gone through twice, a chunk at a time: once to see what the signals say,
once to read them.
"""

import logging
import re
import struct
from collections import Counter, defaultdict, deque
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import BinaryIO, NamedTuple

import msgspec
import numpy as np
import zstandard
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from neurosnap.errors import InvalidValueError, within
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.cuts import signals_in, with_cuts
from neurosnap.sources.meaning import Heard, Reader, Wanted, as_text, refused
from neurosnap.sources.message_fields import Term, fields
from neurosnap.sources.readings import Readings, utc
from neurosnap.sources.ros2.message_types import Decoder, cdr_decoder

MAGIC = b"\x89MCAP0\r\n"
_OURS = "neurosnap"
_LIMIT = 256 * 2**20
"""Bytes of a record or an unpacked chunk, at most: a file may claim any size."""
_FLOOR, _RATIO = 64 * 2**20, 512
"""Bytes that a file may unpack to in all, and more for each byte read."""
_STALE = 3  # usual periods
_SHORTEST = 0.001  # seconds between two rows
_PERIODS = 1024  # of a topic that are looked at
_MALFORMED = (
    *(struct.error, ValueError, IndexError, EOFError, RuntimeError, OSError),
    zstandard.ZstdError,
)
_DIGITS = re.compile(r"(\d+)")
_logger = logging.getLogger(__name__)


def _files(path: str) -> list[Path]:
    """Return a file, or those of a folder as a bag of ROS 2 numbers them."""
    given = Path(path)
    if not given.is_dir():
        return [given]

    def order(file: Path) -> list[tuple[int, str]]:
        # Digits and other letters take turns, so like is compared with like.
        return [
            (int(s), "") if s.isdigit() else (0, s) for s in _DIGITS.split(file.name)
        ]

    return sorted(given.glob("*.mcap"), key=order)


def is_foreign(path: str) -> bool:
    """Return whether a file or folder holds MCAP, and no recording of ours."""
    files = _files(path)
    if not files or not files[0].is_file():
        return False
    try:
        with files[0].open("rb") as file:
            first = next(iter(StreamReader(file, record_size_limit=_LIMIT).records))
    except (McapError, *_MALFORMED):  # what it is then, others say
        return False
    return isinstance(first, Header) and first.profile != _OURS


def read_mcap(path: str, wanted: Wanted) -> Readings:
    """Return the readings in a file, a row for each period of a clock.

    Args:
        path: Where it is, or the folder of a bag of several files.
        wanted: Which signals, or topics with all of theirs, are read. Without `every`
            the clock has the usual period of the topics, the median.

    Raises:
        InvalidValueError: It cannot be read to its end, lacks a signal that is wanted,
            or a value cannot be read; or rows are wanted too often.
    """
    if wanted.every and not wanted.every >= _SHORTEST:  # nor is it no number
        raise InvalidValueError("every", f"must be {_SHORTEST} s or more", wanted.every)
    wanted = wanted.parsed()
    survey = _Survey(path, wanted)
    values = survey.values()
    wanted = with_cuts(wanted, values, lenient=True)
    deque(values, 0)  # also where the cuts were chosen already
    wanted.check([*survey.signals, *survey.times], path, messages=True)
    if not survey.signals:
        raise InvalidValueError(path, "must hold messages that can be read", "none")
    return _Clock(path, wanted, survey).readings()


class Topic(NamedTuple):
    """A topic of a file."""

    topic: str
    messages: int
    """How many of them can be decoded."""
    every: float
    """Usual seconds between two of them; 0 of a single one."""


class Field(NamedTuple):
    """A field of the messages of a topic."""

    field: str
    says: str
    """The words or numbers that it had."""
    sensors: tuple[str, ...]
    """What it gives by itself; none if it is left out."""


def describe_mcap(path: str) -> tuple[list[Topic], list[Field]]:
    """Return the topics and fields of a file, in the order in which they came first.

    Raises:
        InvalidValueError: It cannot be read to its end.
    """
    survey = _Survey(path, Wanted())
    signals = signals_in(survey.values())
    periods, counts = survey.periods(), survey.counts
    topics = [Topic(topic, counts[topic], each) for topic, each in periods.items()]
    return topics, [
        Field(
            name,
            signal.says(),
            (name,)
            if signal.is_plain
            else tuple(cut.name for cut in signal.cuts(name, Wanted.bins)),
        )
        for name, signal in signals.items()
    ]


class _Survey:
    """What a file holds.

    Attributes:
        counts: Of each topic, how many messages can be decoded.
        signals: The topic of each signal, in the order in which they came first.
        times: Of each topic, its first times.
    """

    def __init__(self, path: str, wanted: Wanted) -> None:
        self._path, self._wanted = path, wanted
        self.signals: dict[str, str] = {}
        self.times: defaultdict[str, list[float]] = defaultdict(list)
        self.counts = Counter[str]()

    def values(self) -> Iterator[tuple[str, str, bool]]:
        """Yield what the signals say that are taken as they are, for `with_cuts`."""
        size = sum(file.stat().st_size for file in _files(self._path))
        last = self._wanted.learned * size
        for at, topic, said, offset in _messages(self._path, self._wanted.terms()):
            self.counts[topic] += 1
            if len(self.times[topic]) <= _PERIODS:
                self.times[topic].append(at)
            for name, value in said:
                self.signals.setdefault(name, topic)
                if self._wanted.takes(name, topic=topic):
                    yield name, _text(value), offset <= last

    def periods(self) -> dict[str, float]:
        """Return the usual seconds between two messages of each topic."""
        return {
            topic: float(median(np.diff(sorted(times)))) if len(times) > 1 else 0.0
            for topic, times in self.times.items()
        }


class _Clock:
    """Makes a row of what was said last, for each period."""

    def __init__(self, path: str, wanted: Wanted, survey: _Survey) -> None:
        self._path = path
        periods = survey.periods()
        usual = [period for period in periods.values() if period > 0]
        self._every = wanted.every or (median(usual) if usual else 1.0)
        self._fresh = {
            topic: _STALE * max(period, self._every)
            for topic, period in periods.items()
        }
        self._readers: dict[str, list[tuple[int, Reader]]] = {}
        names: list[str] = []
        self._topics: set[str] = set()
        for name, topic in survey.signals.items():
            self._readers[name] = found = []
            for reader in wanted.readers(name, topic=topic):
                self._topics.add(topic)
                found.append((len(names), reader))
                names.append(reader.name)
        heard = [each for each in wanted.conditions if isinstance(each, Heard)]
        self._heard: dict[str, list[tuple[int, float]]] = {}  # by topic
        for each in heard:
            topic = survey.signals.get(each.source, each.source)
            self._topics.add(topic)
            self._heard.setdefault(topic, []).append((len(names), each.within))
            names.append(each.name)
        self._presence = np.arange(len(names)) >= len(names) - len(heard)
        # While nothing at all comes for so long, nothing was recorded.
        self._silence = max((each.within for each in heard), default=0.0)
        self._silence += max(self._fresh.values(), default=0.0)
        self._wanted, self._columns = wanted, GrowingColumns(Sensorium(names))
        self._bits = np.zeros(len(names), np.bool_)
        self._known = np.zeros(len(names), np.bool_)
        self._until = np.zeros(len(names))  # when each reading is too old
        self._last = 0.0  # when any message came
        self._times: list[str] = []

    def readings(self) -> Readings:
        """Return the rows; O(N) a row, and O(1) a field that is read."""
        now = due = None
        terms = self._wanted.terms()
        for at, topic, said, _ in _messages(self._path, terms, self._topics):
            now = at if now is None else max(now, at)  # a clock that is put back stands
            due = now + self._every if due is None else due
            while due <= now:
                # What follows a long silence is not preceded by rows of nothing.
                due = due + self._every if self._row(due) else now + self._every
            for name, value in said:
                for column, reader in self._readers[name]:
                    self._read(column, reader, name, value)
                    self._until[column] = now + self._fresh[topic]
            for column, span in self._heard.get(topic, ()):
                self._until[column] = now + span
            self._last = now
        if due is not None:
            self._row(due)
        return Readings(self._columns.columns(), self._times, wanted=self._wanted)

    def _read(self, column: int, reader: Reader, name: str, value: object) -> None:
        try:
            on = reader.read(value)
        except ValueError as error:
            raise refused(self._path, name, error, _text(value)) from None
        self._bits[column], self._known[column] = on is True, on is not None

    def _row(self, at: float) -> bool:
        """Add the row of a moment, if anything is known then; tell whether it is."""
        fresh = self._until > at
        self._known &= fresh
        # Silence is silence only once it was listened to for that long.
        self._bits[self._presence] = fresh[self._presence]
        self._known |= self._presence & (fresh | (self._until > 0))
        if at > self._last + self._silence:
            self._known[:] = False
        if not self._known.any():
            return False
        self._columns.append(self._bits & self._known, self._known.copy())
        self._times.append(utc(at))
        return True


def _text(value: object) -> str:
    """Return what a field says; texts stand without quotes."""
    if isinstance(value, str):
        return value
    return repr(value) if type(value) is float else as_text(value)


def _messages(
    path: str, terms: Sequence[Term], topics: Container[str] | None = None
) -> Iterator[tuple[float, str, list[tuple[str, object]], int]]:
    """Yield time, topic, fields and place in the data of messages.

    Args:
        path: Where they are.
        terms: Signals of their lists.
        topics: Of which they are; None: of all, and topics in which some cannot be
            decoded are told of.

    Raises:
        InvalidValueError: While iterating: a file is cut, damaged or too large.
    """
    told: set[str] = set()
    before = 0
    for file in _files(path):
        decoders = _Decoders(file, topics, told, terms)
        for at, topic, said, place in _messages_in(file, decoders):
            yield at, topic, said, before + place
        before += file.stat().st_size


def _messages_in(
    path: Path, decoders: "_Decoders"
) -> Iterator[tuple[float, str, list[tuple[str, object]], int]]:
    """Yield the messages of one file."""
    with path.open("rb") as file:
        try:
            for record in _records(file, path):
                if not isinstance(record, Message):
                    decoders.take(record)
                elif (said := decoders.fields(record)) is not None:
                    at = (record.publish_time or record.log_time) / 1e9
                    yield at, *said, file.tell()
        except InvalidValueError:
            raise
        except (McapError, KeyError, *_MALFORMED) as error:
            rule = "must be whole MCAP, as far as it is read"
            where = f"{type(error).__name__} before byte {file.tell()}"
            raise InvalidValueError(str(path), rule, where) from error


def _records(file: BinaryIO, path: Path) -> Iterator[McapRecord]:
    unpacked = 0
    reader = StreamReader(file, emit_chunks=True, record_size_limit=_LIMIT)
    for record in reader.records:
        if not isinstance(record, Chunk):
            yield record
            continue
        unpacked += record.uncompressed_size
        most = _FLOOR + _RATIO * file.tell()
        claimed = record.uncompressed_size
        if record.compression == "zstd":  # it would get as much room as it says
            claimed = max(claimed, zstandard.frame_content_size(record.data))
        if claimed > _LIMIT or unpacked > most:
            rule = f"must unpack to at most {most:,} bytes by byte {file.tell()}"
            raise InvalidValueError(str(path), rule, unpacked)
        if record.compression == "lz4":  # `mcap` unpacks it to whatever it comes to
            lz4 = LZ4FrameDecompressor()
            data = lz4.decompress(record.data, max_length=claimed)
            if not lz4.eof:
                rule = f"must unpack to what it says by byte {file.tell()}"
                raise InvalidValueError(str(path), rule, claimed)
            record = replace(record, compression="", data=data)
        yield from breakup_chunk(record, validate_crc=True)


class _Decoders:
    """Decode the messages of each channel; one that cannot be is told of once.

    Args:
        path: The file.
        topics: As for `_messages`.
        told: The topics that were told of.
        terms: As for `_messages`.
    """

    def __init__(
        self,
        path: Path,
        topics: Container[str] | None,
        told: set[str],
        terms: Sequence[Term],
    ) -> None:
        self._path, self._topics, self._told = path, topics, told
        self._all_terms = terms
        self._terms: dict[str, list[Term]] = {}  # by topic
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._decoders: dict[tuple[str, int], Decoder | ValueError] = {}

    def take(self, record: McapRecord) -> None:
        """Take in what the messages behind it are."""
        if isinstance(record, Schema):
            self._schemas[record.id] = record
        elif isinstance(record, Channel):
            self._channels[record.id] = record

    def fields(self, message: Message) -> tuple[str, list[tuple[str, object]]] | None:
        """Return topic and fields of a message; None if it is left out."""
        channel = self._channels[message.channel_id]
        if self._topics is not None and channel.topic not in self._topics:
            return None
        kind = channel.message_encoding, channel.schema_id
        if kind not in self._decoders:
            try:
                self._decoders[kind] = _decoder(channel, self._schemas.get(kind[1]))
            except ValueError as error:
                self._decoders[kind] = error
        decode = self._decoders[kind]
        if isinstance(decode, ValueError):
            self._tell(channel.topic, decode)  # not raised: each raise lengthens it
            return None
        try:
            said = decode(message.data)
        except (ValueError, RecursionError) as error:
            self._tell(channel.topic, error)
            return None
        try:
            return channel.topic, fields(channel.topic, said, self._of(channel.topic))
        except InvalidValueError as error:
            raise within(str(self._path), error) from None

    def _of(self, topic: str) -> list[Term]:
        """Return the terms of a topic."""
        if topic not in self._terms:
            self._terms[topic] = [each for each in self._all_terms if each.is_of(topic)]
        return self._terms[topic]

    def _tell(self, topic: str, error: Exception) -> None:
        if self._topics is None and topic not in self._told:
            self._told.add(topic)
            _logger.warning("%s: %s: left out: %s", self._path, topic, error)


def _decoder(channel: Channel, schema: Schema | None) -> Decoder:
    """Return what decodes the messages of a channel.

    Raises:
        ValueError: Nothing does.
    """
    if channel.message_encoding == "json":
        return msgspec.json.decode
    if channel.message_encoding == "cdr" and schema is not None:
        return cdr_decoder(schema)
    raise ValueError(f"{channel.message_encoding or 'nothing'} is not understood")
