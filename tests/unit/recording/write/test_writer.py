import resource
import tracemalloc
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
import pytest
from mcap.reader import make_reader

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.recording.format.chunk_index import index_chunk
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write import writer
from neurosnap.recording.write.writer import Writer
from tests.support.recordings import EACH, NOW, delivered, record, sent_by, traffic

PULSE = next(delivered([EACH["pulse"]]))


@contextmanager
def no_file_beyond(size: int) -> Iterator[None]:
    """Let the operating system refuse to make any file larger, as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_what_is_kept_of_each_chunk_is_little_and_in_the_index(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(writer, "_RECENT", 1)  # these are bounded
    each, numbers = [*delivered(EACH.values())], Counter[str]()
    with Writer(log) as new:
        new.start({})
        tracemalloc.start()
        before = 0
        for number in range(400):
            if number == 100:
                before, _ = tracemalloc.get_traced_memory()
            for one in each:
                sender = wire.decode(one.key, one.payload).sender
                new.add(one._replace(sequence=numbers[sender]), NOW)
                numbers[sender] += 1
            new.flush()
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        new.finish({}, {})
    assert grown / 300 < 1000  # its index alone was 3 kB
    with log.open("rb") as file:
        summary = make_reader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 400


def test_any_mcap_reader_reads_it(log: Path) -> None:
    deliveries = list(delivered(EACH.values()))
    record(log, deliveries, every=4)
    with log.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "neurosnap"
        assert reader.get_header().library.startswith("neurosnap ")
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert metadata["neurosnap.run"]["seed"] == "7"
        assert metadata["neurosnap.run"]["schema"] == str(wire.SCHEMA)
        assert metadata["neurosnap.totals"]["ticks"] == "3"
        read = list(reader.iter_messages(log_time_order=False))
    for (schema, channel, message), delivery in zip(read, deliveries, strict=True):
        assert schema is not None
        assert schema.encoding == "jsonschema"
        assert channel.topic == f"/{wire.topic(delivery.key)}"
        assert channel.message_encoding == "json"
        assert message.data == delivery.payload
        assert message.sequence == delivery.sequence
        assert message.publish_time == delivery.sent
        assert message.log_time == delivery.sent + 1000


def test_a_file_of_one_message_has_all_channels_and_only_its_owner_reads_it(
    log: Path,
) -> None:
    record(log, [PULSE])
    (file,) = Recording.open(log).files
    # In this order: a reader that has lost what says so goes by it.
    with log.open("rb") as data:
        found = index_chunk(log, data, file.layout.chunks[0]).registered
    topics = {n: channel.topic for n, channel in found.items()}
    assert topics == {n: f"/{topic}" for n, topic in enumerate(wire.TOPICS, start=1)}
    assert log.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("name", "rule"),
    [
        ("there", "must not exist yet, got"),
        ("link", "must not exist yet, got"),
        ("below/log.mcap", "must be in a folder that exists"),
        ("there/below", "must be writable, got"),
        ("nul\0l", "must be writable, got"),
        ("x" * 300, "must be writable, got"),
    ],
)
def test_a_place_that_takes_no_file_is_refused(
    tmp_path: Path, name: str, rule: str
) -> None:
    (tmp_path / "there").write_bytes(b"precious")
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    with pytest.raises(RecordingError, match=rf"^log: {rule}"):
        Writer(tmp_path / name)
    assert (tmp_path / "there").read_bytes() == b"precious"


def test_duplicates_are_left_out_and_gaps_named(log: Path) -> None:
    deliveries = traffic(200)
    lost = [deliveries[50], deliveries[120], deliveries[-1]]
    kept = [delivery for delivery in deliveries if delivery not in lost]
    with Writer(log) as writer:
        writer.start({})
        for delivery in (*kept, *kept[:7]):
            writer.add(delivery, delivery.sent)
        completeness = writer.finish({"ticks": "9"}, sent_by(deliveries))
    totals = Recording.open(log).totals
    assert totals is not None
    assert totals["ticks"] == "9"
    noted = msgspec.json.decode(totals["completeness"], type=Completeness)
    assert noted == completeness == Completeness(197, sent_by(lost), duplicates=7)
    recording = Recording.open(log)
    assert [recorded.delivery for recorded in recording.messages()] == kept
    assert recording.balance(recording.sequences()) == completeness


def test_two_messages_of_one_number_are_no_duplicates(
    log: Path, caplog: pytest.LogCaptureFixture
) -> None:
    same = next(delivered([EACH["pulse"]]))
    other = same._replace(payload=wire.encode(wire.Pulse(1, 7, 4, 1, 2)))
    with Writer(log) as writer:
        writer.start({})
        for one in (same, same, other, other):
            writer.add(one, NOW)
        completeness = writer.finish({}, {"cell/3": 1})
    assert completeness == Completeness(1, duplicates=3, gaps=1)
    assert not completeness.whole
    why = "cell/3: must be there once, got two messages of number 0"
    assert caplog.messages == [f"log: {why}"]
    recording = Recording.open(log)
    assert recording.damage == (f"{log}: messages are missing: {why}",)
    assert not recording.whole


def test_a_message_that_came_too_long_ago_to_be_known_counts_as_another(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("neurosnap.recording.write.writer._RECENT", 2)
    deliveries = traffic(4)
    with Writer(log) as writer:
        writer.start({})
        for one in (*deliveries, deliveries[3], deliveries[0]):
            writer.add(one, NOW)
        assert writer.finish({}, {}).gaps == 1


@pytest.mark.parametrize(
    "foreign",
    [
        PULSE._replace(payload=b""),
        PULSE._replace(payload=b"[" * 100_000),
        PULSE._replace(payload=wire.encode(EACH["observation"])),
        PULSE._replace(key="nothing/of/ours"),
        PULSE._replace(sequence=-1),
        PULSE._replace(sequence=2**32),
        PULSE._replace(sent=-1),
        PULSE._replace(sent=2**64),
        next(delivered([wire.KeyFrame(1, bytes(200_000))])),  # too large to be read
    ],
    ids=lambda one: repr(one)[:80],
)
def test_what_is_no_message_is_counted_and_left_out(
    log: Path, foreign: wire.Delivery, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("neurosnap.recording.write.writer._LARGEST_PAYLOAD", 200_000)
    with Writer(log) as writer:
        writer.start({})
        writer.add(foreign, NOW)
        with pytest.raises(
            InvalidValueError, match=r"^log_time: must be in \[0, 2\^64"
        ):
            writer.add(PULSE, -1)
        writer.add(PULSE, NOW)
        completeness = writer.finish({}, {"cell/3": 1})
    assert completeness == Completeness(1, foreign=1)
    (read,) = Recording.open(log).messages()
    assert read.delivery == PULSE


def test_what_was_flushed_is_there_while_it_is_written(log: Path) -> None:
    deliveries = traffic(60)
    with Writer(log) as writer:
        writer.start({"seed": "1"})
        assert Recording.open(log).metadata["seed"] == "1"
        for count, delivery in enumerate(deliveries, start=1):
            writer.add(delivery, delivery.sent)
            if count % 20 == 0:
                writer.flush()
                assert len(list(Recording.open(log).messages())) == count
                size = log.stat().st_size
                writer.flush()
                assert log.stat().st_size == size


@pytest.mark.parametrize("started", [False, True])
def test_abandoned_it_stays_readable_and_takes_nothing_more(
    log: Path, started: bool
) -> None:
    writer = Writer(log)
    if started:
        writer.start({})
        writer.add(PULSE, NOW)
    writer.abandon()
    writer.abandon()
    with pytest.raises(RecordingError, match=r"^log: must be started and open, got"):
        writer.add(PULSE, NOW)
    with pytest.raises(RecordingError, match=r"^log: must be open, got"):
        writer.flush()
    with pytest.raises(RecordingError, match=r"^log: must be started once"):
        writer.start({})
    with pytest.raises(RecordingError, match=r"^log: must be started and open, got"):
        writer.finish({}, {})
    recording = Recording.open(log)
    assert len(list(recording.messages())) == started
    assert recording.cut is not None
    assert recording.totals is None


def test_text_that_cannot_be_written_is_refused_whole(log: Path) -> None:
    with Writer(log) as writer:
        with pytest.raises(InvalidValueError, match=r"^command: must be text in UTF-8"):
            writer.start({"seed": "1", "command": "\udcff"})
        writer.start({"seed": "2"})
        with pytest.raises(InvalidValueError, match=r"^why: must be text in UTF-8"):
            writer.finish({"why": "\udcff"}, {})
        writer.finish({}, {})
    assert Recording.open(log).metadata["seed"] == "2"


@pytest.mark.parametrize("at", ["add", "flush", "finish", "abandon"])
def test_a_full_disk_is_an_error_and_what_was_written_stays(log: Path, at: str) -> None:
    deliveries = traffic(3000)
    writer = Writer(log, packs=False, chunk=4096)
    writer.start({})
    for delivery in deliveries[:1000]:
        writer.add(delivery, NOW)
    writer.flush()
    room = {"add": 50_000, "flush": 10, "finish": 10, "abandon": 10}[at]
    with (
        no_file_beyond(log.stat().st_size + room),
        pytest.raises(
            RecordingError, match=r"^log: must take what is recorded, got Fi"
        ),
    ):
        for delivery in deliveries[1000 : 3000 if at == "add" else 1010]:
            writer.add(delivery, NOW)
        {
            "add": writer.flush,
            "flush": writer.flush,
            "finish": lambda: writer.finish({}, {}),
            "abandon": writer.abandon,
        }[at]()
    with pytest.raises(RecordingError, match=r"^log: must be started and open"):
        writer.add(deliveries[0], NOW)
    writer.abandon()
    recording = Recording.open(log)
    read = [recorded.delivery for recorded in recording.messages()]
    assert len(read) >= 1000
    assert read == deliveries[: len(read)]
    assert recording.cut is not None


@pytest.mark.parametrize("packs", [True, False])
def test_chunks_are_closed_when_full(log: Path, packs: bool) -> None:
    deliveries = traffic(2000)
    with Writer(log, packs=packs, chunk=30_000) as writer:
        writer.start({})
        for delivery in deliveries:
            writer.add(delivery, NOW)
        writer.finish({}, {})
    recording = Recording.open(log)
    assert len(recording.files[0].layout.chunks) > 5
    assert all(chunk.unpacked < 31_000 for chunk in recording.files[0].layout.chunks)
    assert [recorded.delivery for recorded in recording.messages()] == deliveries


def test_a_noted_gap_is_never_whole(log: Path) -> None:
    with Writer(log) as writer:
        writer.start({})
        writer.write_gap("bytes 5 to 9 of another file: damaged")
        balance = writer.finish({}, {})
    assert (balance.missing, balance.gaps, balance.whole) == ({}, 1, False)
    recording = Recording.open(log)
    assert recording.balance(recording.sequences()) == balance
