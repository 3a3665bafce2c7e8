"""Reads the messages of an MCAP file that another program wrote, as a table.

Each field of a message is a signal: ``/arm.joint[0].angle`` of the topic ``/arm``. A
row is what every signal said last at a tick of the clock; what was said longer ago than
three of its topic's usual periods is unknown. A message that cannot be decoded is an
error of its channel, told once, and none of the file. JSON and CDR are decoded.

The file is gone through twice, a chunk at a time: once to see what the signals say,
once to read them.
"""

import logging
from collections import Counter, defaultdict, deque
from collections.abc import Container, Iterator
from functools import cache
from pathlib import Path
from statistics import median
from typing import NamedTuple

import msgspec
import numpy as np
from mcap.exceptions import McapError
from mcap.records import Channel, McapRecord, Message, Schema

from neurosnap.errors import InvalidValueError, within
from neurosnap.poc.learning.columns import GrowingColumns
from neurosnap.sensorium import Sensorium
from neurosnap.sources.bag_records import bag_files, records_in
from neurosnap.sources.conditions import Heard
from neurosnap.sources.cuts import signals_in, with_cuts
from neurosnap.sources.meaning import Numbers, Reader, as_text, refused
from neurosnap.sources.message_fields import Term, fields
from neurosnap.sources.readings import Readings, utc
from neurosnap.sources.ros2.message_types import Decoder, cdr_decoder
from neurosnap.sources.wanted import Wanted
from neurosnap.system.distribution import must_have

_STALE = 3  # usual periods
_SHORTEST = 0.001  # seconds between two rows
_PERIODS = 1024  # of a topic that are looked at
_logger = logging.getLogger(__name__)


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

    def values(self) -> Iterator[tuple[str, object, bool]]:
        """Yield what the signals say that are taken as they are, for `with_cuts`."""
        size = sum(file.stat().st_size for file in bag_files(self._path))
        last = self._wanted.learned * size
        takes = cache(lambda name, topic: self._wanted.takes(name, topic=topic))
        for at, topic, said, offset in _messages(self._path, self._wanted):
            self.counts[topic] += 1
            if len(self.times[topic]) <= _PERIODS:
                self.times[topic].append(at)
            for name, value in said:
                self.signals.setdefault(name, topic)
                if takes(name, topic):
                    yield name, value, offset <= last

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
        readers: list[Reader] = []
        self._topics: set[str] = set()
        for name, topic in survey.signals.items():
            self._readers[name] = found = []
            for reader in wanted.readers(name, topic=topic):
                self._topics.add(topic)
                found.append((len(names), reader))
                names.append(reader.name)
                readers.append(reader)
        self._numbers, self._said = Numbers(readers), list[bytes]()
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
        for at, topic, said, _ in _messages(self._path, self._wanted, self._topics):
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
        made = self._columns.columns(), self._times
        return Readings(*made, said=self._said, wanted=self._wanted, every=self._every)

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
        if said := self._numbers.packed(self._known):
            self._said.append(said)
        return True


def _text(value: object) -> str:
    """Return what a field says; texts stand without quotes."""
    if isinstance(value, str):
        return value
    return repr(value) if type(value) is float else as_text(value)


def _messages(
    path: str, wanted: Wanted, topics: Container[str] | None = None
) -> Iterator[tuple[float, str, list[tuple[str, object]], int]]:
    """Yield time, topic, fields and place in the data of messages.

    Args:
        path: Where they are.
        wanted: Which fields are; of a topic of which none is, the first message has all
            of them, and others have the terms.
        topics: Of which they are; None: of all, and topics in which some cannot be
            decoded are told of.

    Raises:
        InvalidValueError: While iterating: a file is cut, damaged or too large.
    """
    told: set[str] = set()
    before = 0
    for file in bag_files(path):
        decoders = _Decoders(file, topics, told, wanted)
        for at, topic, said, place in _messages_in(file, decoders):
            yield at, topic, said, before + place
        before += file.stat().st_size


def _messages_in(
    path: Path, decoders: "_Decoders"
) -> Iterator[tuple[float, str, list[tuple[str, object]], int]]:
    """Yield the messages of one file."""
    for record, place in records_in(path):
        if not isinstance(record, Message):
            decoders.take(record)
        elif (said := decoders.fields(record)) is not None:
            yield (record.publish_time or record.log_time) / 1e9, *said, place


class _Decoders:
    """Decode the messages of each channel; one that cannot be is told of once.

    Args:
        path: The file.
        topics: As for `_messages`.
        told: The topics that were told of.
        wanted: As for `_messages`.
    """

    def __init__(
        self,
        path: Path,
        topics: Container[str] | None,
        told: set[str],
        wanted: Wanted,
    ) -> None:
        self._path, self._topics, self._told = path, topics, told
        self._wanted, self._all_terms = wanted, wanted.terms()
        self._asked: dict[str, tuple[list[Term], bool]] = {}  # of each topic
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
        channel = self._channels.get(message.channel_id)
        if channel is None:
            rule = "must say of what channel a message is, before it"
            raise InvalidValueError(str(self._path), rule, message.channel_id)
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
            return channel.topic, self._found(channel.topic, said)
        except InvalidValueError as error:
            raise within(str(self._path), error) from None

    def _found(self, topic: str, message: object) -> list[tuple[str, object]]:
        """Return what is asked for of a message."""
        if topic not in self._asked:
            terms = [each for each in self._all_terms if each.is_of(topic)]
            self._asked[topic] = terms, self._wanted.looks_into(topic)
            return fields(topic, message, terms)
        return fields(topic, message, *self._asked[topic])

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
    if channel.message_encoding == "protobuf" and schema is not None:
        return _protobuf_decoder(schema)
    if channel.message_encoding == "cdr" and schema is not None:
        return cdr_decoder(schema)
    raise ValueError(f"{channel.message_encoding or 'nothing'} is not understood")


def _protobuf_decoder(schema: Schema) -> Decoder:
    """Return what decodes the messages of a type of Protocol Buffers.

    Raises:
        ValueError: It cannot be read, or `mcap-protobuf-support` is not installed.
            While decoding: the message is none of that type.
    """
    try:
        from google.protobuf.json_format import MessageToDict
        from google.protobuf.message import DecodeError
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError as error:
        raise ValueError(must_have("mcap-protobuf-support", "protobuf")) from error
    try:
        decode = DecoderFactory().decoder_for("protobuf", schema)
    except (McapError, DecodeError, TypeError, RecursionError) as error:
        why = type(error).__name__
        raise ValueError(f"types of {schema.name} cannot be read ({why})") from error
    if decode is None:
        raise ValueError(f"types in {schema.encoding or 'nothing'} are not understood")

    def decoded(data: bytes) -> object:
        try:
            return MessageToDict(
                decode(data),
                preserving_proto_field_name=True,
                always_print_fields_with_no_presence=True,
            )
        except (DecodeError, TypeError, RecursionError) as error:
            rule = f"must be a message of {schema.name} ({type(error).__name__})"
            raise ValueError(rule) from error

    return decoded
