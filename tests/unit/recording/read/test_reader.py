"""A recording returns what was written; foreign files are refused."""

import os
import random
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import pytest
from mcap.writer import Writer as McapWriter

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.recording.format.chunk_index import unpack
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.format.records import PROFILE, RUN, TOTALS, Chunk, sealed_facts
from neurosnap.recording.read import ticks as module
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import EACH, NOW, delivered, record, traffic

SCHEMA = str(wire.SCHEMA)


def test_payloads_come_back_byte_for_byte(log: Path) -> None:
    spaced = b' {"wave": 1,  "type":"pulse", "source":7,"target":4,"hops":1,"credit":3}'
    record(log, [wire.Delivery("pulse/2/cell/3", 0, NOW, spaced)])
    (read,) = Recording.open(log).messages()
    assert read.payload == spaced


@pytest.mark.parametrize("whole", [True, False])
def test_topics_and_times_select(log: Path, whole: bool) -> None:
    deliveries = traffic(400)
    record(log, deliveries, every=7)
    if not whole:
        last = Recording.open(log).files[0].layout.chunks[-1]
        os.truncate(log, last.offset + last.packed)  # the end, summary and all
    recording = Recording.open(log)
    everything = list(recording.messages())
    assert [recorded.delivery for recorded in everything] == deliveries
    start = NOW + 1000 + 48  # the last of a chunk
    several = ({"observation"}, ["cellreport", "pulse"], {"leave"}, set(wire.TOPICS))
    for topics in several:
        for begin, first in ((0, 0), (start, 48)):
            assert list(recording.messages(topics, start=begin)) == [
                recorded
                for recorded in everything[first:]
                if wire.topic(recorded.message.key) in topics
            ]


def test_chunks_without_the_topic_are_not_unpacked(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(log, traffic(100), every=10)
    recording = Recording.open(log)
    assert recording.files[0].topics[2] == "wiring"  # of that it reads the first
    unpacked: list[int] = []

    def note(log: Path, file: BinaryIO, chunk: Chunk) -> bytes:
        unpacked.append(chunk.number)
        return unpack(log, file, chunk)

    monkeypatch.setattr("neurosnap.recording.format.chunk_index.unpack", note)
    assert len(list(recording.messages({"observation"}))) == 5
    assert unpacked == [1, 3, 5, 7, 9]
    unpacked.clear()
    assert list(recording.messages({"fault"})) == []
    assert list(recording.messages(start=NOW + 10**6)) == []
    assert unpacked == []


def test_a_reader_that_stops_leaves_no_file_open(log: Path) -> None:
    record(log, traffic(100), every=10)
    messages = Recording.open(log).messages()
    assert next(messages)
    assert log not in {path.resolve() for path in Path("/proc/self/fd").iterdir()}
    assert len(list(messages)) == 99


def test_a_finished_recording_says_so_and_an_unknown_topic_is_refused_at_once(
    log: Path,
) -> None:
    record(log, [])
    recording = Recording.open(log)
    assert list(recording.messages()) == []
    assert recording.balance(recording.sequences()) == Completeness(0)
    assert recording.cut is None
    assert recording.metadata == {"seed": "7", "world": "Test-v0", "schema": SCHEMA}
    rule = r"^topics: must be of observation, .*'/wavestart"
    with pytest.raises(InvalidValueError, match=rule):
        recording.messages({"/wavestart"})


def test_a_file_that_changes_meanwhile_is_an_error(log: Path) -> None:
    record(log, delivered(EACH.values()))
    recording = Recording.open(log)
    log.write_bytes(log.read_bytes()[:100])
    with pytest.raises(RecordingError, match="chunk 1 must unpack to"):
        next(recording.messages())
    log.unlink()
    with pytest.raises(RecordingError, match=r"^log: must exist, got"):
        next(recording.messages())


@pytest.mark.parametrize(
    ("make", "rule"),
    [
        (lambda _: None, r"must exist, got '/.*log.mcap'$"),
        (Path.mkdir, r"must be a file, got '/.*'$"),
        (os.mkfifo, r"must be a file, got '/.*'$"),  # it is not waited for
        (lambda log: log.write_bytes(b""), "must be an MCAP recording, got"),
        (lambda log: log.write_bytes(b"\x89MCAP"), "must be an MCAP recording, got"),
        (lambda log: log.write_bytes(b"x" * 10**5), "must be an MCAP recording, got"),
    ],
    ids=["nothing", "folder", "pipe", "empty", "cut", "other"],
)
def test_what_is_no_recording_is_refused(
    log: Path, make: Callable[[Path], object], rule: str
) -> None:
    make(log)
    with pytest.raises(RecordingError, match=rf"^log: {rule}"):
        Recording.open(log)


def test_a_name_that_is_none_is_refused() -> None:
    with pytest.raises(RecordingError, match=r"^log: must be readable, got 'nul"):
        Recording.open("nul\0l")


def write_mcap(
    log: Path,
    *,
    profile: str = PROFILE,
    schema: str | None = SCHEMA,
    topic: str = "/pulse",
    encoding: str = "json",
    payload: bytes = wire.encode(EACH["pulse"]),
    totals: Mapping[str, str] | None = None,
) -> None:
    """Write what our writer would not."""
    with log.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile, "a stranger")
        if schema is not None:
            writer.add_metadata(RUN, sealed_facts(RUN, {"schema": schema}))
        if totals is not None:
            writer.add_metadata(TOTALS, sealed_facts(TOTALS, totals))
        kind = writer.register_schema("neurosnap.Pulse", "jsonschema", b"{}")
        channel = writer.register_channel(topic, encoding, kind)
        writer.add_message(channel, NOW, payload, NOW)
        writer.finish()


def test_a_stranger_who_writes_what_we_write_is_read(log: Path) -> None:
    write_mcap(log)
    (read,) = Recording.open(log).messages()
    assert read.message == EACH["pulse"]


@pytest.mark.parametrize(
    ("made", "rule"),
    [
        *(
            (
                {"schema": schema},
                rf"schema: must be {SCHEMA}, got '{schema[:30]}.*'; read it",
            )
            for schema in (
                *(str(wire.SCHEMA + 1), "0", "01", "", "-1", "one", "\u0661"),
                "9" * 5000,  # more digits than Python makes a number of
            )
        ),
        ({"profile": "ros2", "schema": None}, "profile: must be 'neurosnap', got 'ros"),
        ({"schema": None}, r"metadata: must hold neurosnap.run, got"),
        *(
            (
                {"topic": topic, "payload": payload},
                rf"chunk 1: {topic} must hold its own mess",
            )
            for topic, payload in (
                ("/observation", wire.encode(EACH["pulse"])),
                ("/pulse", b"garbage"),
                ("/leave", b'{"type":"leave","who":"\xff"}'),
                ("/leave", b'{"type":"leave","who":"a","x":' + b"[" * 10_000),
            )
        ),
        ({"topic": "/nothing"}, "channel: must be a topic in json, got /"),
        ({"encoding": "protobuf"}, "channel: must be a topic in json, got /"),
        ({"totals": {"expected": "{}"}}, "must hold completeness and expected, got"),
        ({"totals": {"decision": '{"tick": -1}'}}, "decision: must hold a decision, g"),
    ],
)
def test_what_no_writer_of_ours_writes_is_an_error(
    log: Path, made: dict[str, Any], rule: str
) -> None:
    write_mcap(log, **made)
    with pytest.raises(RecordingError, match=rule):
        recording = Recording.open(log)
        list(recording.messages())
        assert recording.closing is None
        recording.balance(recording.sequences())


# Ticks --------------------------------------------------------------------------------


def messages(tick: int) -> list[wire.Message]:
    return [
        wire.Observation(tick, b"\x01"),
        wire.State(tick, tick, b"\x02", False, 1, 1, 1, 1, 1),
        wire.Decision(tick, 0, "why"),
    ]


def test_ticks_come_in_order_whatever_order_their_messages_came_in(log: Path) -> None:
    sent = [message for tick in range(1, 30) for message in messages(tick)]
    chance = random.Random(1)
    # A sort by tick and a little noise: what is near each other gets mixed.
    sent = [
        sent[k]
        for k in sorted(range(len(sent)), key=lambda k: k + chance.random() * 12)
    ]
    record(log, delivered([wire.Decision(0, -1, "the run begins"), *sent]))
    found = list(ticks(Recording.open(log)))
    assert [tick.number for tick in found] == list(range(1, 30))
    for tick in found:
        assert [tick.observation, tick.state, tick.decision] == messages(tick.number)


def test_a_tick_that_lost_something_comes_in_its_place(log: Path) -> None:
    sent = [*messages(1), messages(2)[1], *messages(3), messages(4)[0]]
    record(log, delivered(sent))
    found = {tick.number: tick.known for tick in ticks(Recording.open(log))}
    assert list(found.items()) == [(1, True), (2, False), (3, True), (4, False)]


@pytest.mark.parametrize("late", [1, 2])
def test_what_comes_after_its_tick_is_an_error(
    log: Path, monkeypatch: pytest.MonkeyPatch, late: int
) -> None:
    """Tick 1 is given out once it is whole, tick 2 once four more are under way."""
    monkeypatch.setattr(module, "WINDOW", 4)
    sent = [*messages(1), *(messages(tick)[0] for tick in range(2, 7))]
    record(log, delivered([*sent, messages(late)[1]]))
    with pytest.raises(
        RecordingError, match=rf"log\.mcap: tick: must come once, .* got {late}$"
    ):
        list(ticks(Recording.open(log)))


def test_a_later_file_begins_with_its_own_first_tick(log: Path) -> None:
    with Writer(log) as writer:
        writer.start({"part": "1", "begins": "6"})
        for delivery in delivered([messages(6)[2], *messages(7)]):
            writer.add(delivery, delivery.sent)
        writer.finish({}, {})
    assert [tick.number for tick in ticks(Recording.open(log))] == [7]
