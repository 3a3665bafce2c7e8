"""Bags of ROS 2, read back by other programs and compared with what was recorded."""

import random
import re
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML

from neurosnap import wire
from neurosnap.apps import library
from neurosnap.apps.export.rosbag2 import topic_names, write_bag
from neurosnap.apps.export.table import Exported
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.protocol.anomaly_report import NamedAnomaly, anomaly_line
from neurosnap.recording.read.recorded_readings import readings_of
from neurosnap.recording.read.recording import Recording
from neurosnap.sensorium import Sensorium
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.wanted import Wanted
from tests.support.recorded_messages import of_type
from tests.support.recorded_runs import recorded, ternary, without_states
from tests.support.rewritten_recordings import rewritten
from tests.support.run_options import options_for

NAMES = ("front/door", "front door", "lamp")
TOPICS = tuple(
    f"/neurosnap/readings/{name}" for name in ("front_door", "front_door_1", "lamp")
)
TICKS, BROKEN, UNREAD, SECOND = 40, 33, 20, 10**9
ARRAY = "diagnostic_msgs/msg/DiagnosticArray"


def run_of(folder: Path, unread: int = UNREAD) -> Path:
    """Record a run in which the first sensor implies the second, but for one tick."""
    chance = random.Random(3)
    lines = [",".join(("time", *NAMES))]
    for tick in range(1, TICKS + 1):
        a = chance.random() < 0.5
        either = a or chance.random() < 0.5
        cells = "1,0,0" if tick == BROKEN else f"{a:d},{either:d},{tick // 10 % 2}"
        cells = "1,,1" if tick == unread else cells
        lines.append(f"2026-03-01T12:00:{tick:02d}Z,{cells}")
    path = folder / "rows.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    options = options_for(
        str(path), 5, {}, ticks=TICKS, threshold=0.1, watch=True, support=1
    )
    return recorded(options, folder / "log.mcap")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_of(tmp_path_factory.mktemp("run"))


def exported(log: Path, out: Path) -> Exported:
    return write_bag(Recording.open(log), out)


def read_bag(bag: Path) -> list[tuple[str, int, Any]]:
    with AnyReader([bag]) as reader:  # by the types that the bag brings with it
        return [
            (to.topic, at, reader.deserialize(data, to.msgtype))
            for to, at, data in reader.messages()
        ]


def read_at(log: Path) -> dict[int, list[int | None]]:
    """Return what each sensor read, by the time of the tick."""
    found: dict[int, list[int | None]] = {}
    for one in of_type(log, wire.Observation):
        bits, known = one.bits[0], one.known[0] if one.known else 7
        found[round(one.at * 1000) * 10**6] = [
            bits >> k & 1 if known >> k & 1 else None for k in range(3)
        ]
    return found


def test_its_readings_are_those_of_the_ticks(log: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.rosbag2"
    assert exported(log, out) == Exported(str(out), TICKS, 0, True)
    want = read_at(log)
    assert len(want) == TICKS
    assert {None} < {bit for row in want.values() for bit in row}
    got: dict[int, list[int | None]] = {at: [None] * 3 for at in want}
    for topic, at, message in read_bag(out):
        if topic in TOPICS:
            assert got[at][TOPICS.index(topic)] is None  # once a tick
            got[at][TOPICS.index(topic)] = int(message.data)
    assert got == want


def test_its_diagnostics_say_what_is_believed_and_what_is_wrong(
    log: Path, tmp_path: Path
) -> None:
    exported(log, tmp_path / "a.rosbag2")
    words = {None: "unknown", 1: "on", 0: "off"}
    reads = read_at(log)
    states = {
        at: ternary(bool(one.literals[0] >> k & 1) for k in range(6))
        for at, one in zip(reads, of_type(log, wire.State), strict=True)
    }
    wrong = {
        [*reads][told.tick - 1]: told
        for told in library.Recording(log).anomalies()
        if isinstance(told, NamedAnomaly)
    }
    assert [*reads][BROKEN - 1] in wrong
    last: list[Any] = []
    told: set[int] = set()
    for topic, at, message in read_bag(tmp_path / "a.rosbag2"):
        if topic != "/diagnostics":
            continue
        stamp = message.header.stamp
        assert stamp.sec * SECOND + stamp.nanosec == at
        assert [one.hardware_id for one in message.status] == [*NAMES]
        said = [[one.value for one in status.values] for status in message.status]
        named = wrong[at].culprits if at in wrong else ()
        assert [each.level == 2 for each in message.status] == [
            name in named for name in NAMES
        ]
        assert [one[0] for one in said] == [words[bit] for bit in reads[at]]
        assert [one[1] for one in said] == [words[bit] for bit in states[at]]
        why = anomaly_line(wrong[at]) if at in wrong else ""
        assert {one[3] for one in said} <= {"", why}
        assert message.status != last  # only what is new is said
        last = message.status
        told.update(each.level for each in message.status)
    assert told >= {0, 2, 3}


def test_it_has_all_that_rosbag2_asks_for(log: Path, tmp_path: Path) -> None:
    exported(log, tmp_path / "a.rosbag2")
    store = get_typestore(Stores.ROS2_KILTED)
    about = YAML(typ="safe").load(
        (tmp_path / "a.rosbag2" / "metadata.yaml").read_text()
    )
    about = about["rosbag2_bagfile_information"]
    with (tmp_path / "a.rosbag2" / "a_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        (record,) = reader.iter_metadata()
    assert record.name == "rosbag2"
    assert YAML(typ="safe").load(record.metadata["serialized_metadata"]) == about
    assert {one.compression for one in summary.chunk_indexes} == {"lz4"}
    counts = summary.statistics.channel_message_counts
    told = {
        one["topic_metadata"]["name"]: one
        for one in about.pop("topics_with_message_count")
    }
    assert len(told) == len(summary.channels) == 4
    for number, channel in summary.channels.items():
        schema = summary.schemas[channel.schema_id]
        metadata = told[channel.topic]["topic_metadata"]
        hashed = store.hash_rihs01(schema.name)
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        assert (
            schema.data.decode() == store.generate_msgdef(schema.name, ros_version=2)[0]
        )
        assert channel.metadata["topic_type_hash"] == hashed
        assert metadata["type_description_hash"] == hashed
        assert metadata["type"] == schema.name
        qos = YAML(typ="safe").load(channel.metadata["offered_qos_profiles"])
        assert metadata["offered_qos_profiles"] == qos
        assert told[channel.topic]["message_count"] == counts[number]
    total, begins = sum(counts.values()), summary.statistics.message_start_time
    lasts = summary.statistics.message_end_time - begins
    where = {
        "starting_time": {"nanoseconds_since_epoch": begins},
        "duration": {"nanoseconds": lasts},
        "message_count": total,
    }
    assert lasts == (TICKS - 1) * SECOND
    assert about == {
        **where,
        "version": 9,
        "storage_identifier": "mcap",
        "relative_file_paths": ["a_0.mcap"],
        "files": [{"path": "a_0.mcap", **where}],
        "compression_format": "",
        "compression_mode": "",
        "ros_distro": "unknown",
        "custom_data": dict(zip(TOPICS, NAMES, strict=True)),
    }


def test_what_is_learned_of_it_is_what_is_learned_of_the_recording(
    tmp_path: Path,
) -> None:
    log = run_of(tmp_path, unread=0)
    exported(log, tmp_path / "a.rosbag2")
    wanted = Wanted(patterns=("/neurosnap/readings/*",))
    bag = open_readings(str(tmp_path / "a.rosbag2"), wanted)
    recording = Recording.open(log)
    own = readings_of(recording, Sensorium(NAMES), TICKS)
    assert bag.columns.ticks == own.columns.ticks == TICKS
    for k, topic in enumerate(TOPICS):
        assert bag.columns.sensorium.names[k] == f"{topic}.data"
        assert (bag.columns.reading(k) == own.columns.reading(k)).all()


def test_names_are_legal_and_never_two_to_one() -> None:
    sensors = ["a b", "a_b", "a__b", "a_b_2", "9", "é", "ü", "_", "", "A" * 300]
    sensors += ["A" * 299, "α∧a", "/x/", "sensor", "a" * 127 + "-b"]
    names = topic_names(sensors)
    assert len({*names}) == len(sensors)
    for name in names:
        assert re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name)
        assert "__" not in name
        assert len(f"/neurosnap/readings/{name}") <= 200


def test_nothing_is_replaced_and_nothing_is_left_behind(
    log: Path, tmp_path: Path
) -> None:
    out = tmp_path / "a.rosbag2"
    out.mkdir()
    for place, rule in (
        (out, "must not exist yet"),
        (tmp_path / "none" / "a.rosbag2", "must be in a folder that exists"),
    ):
        with pytest.raises(InvalidValueError, match=f"^out: {rule}"):
            exported(log, place)
    out.rmdir()

    none = partial(filter, lambda each: not isinstance(each.message, wire.Observation))
    rewritten(log, tmp_path / "empty.mcap", none)
    with pytest.raises(RecordingError, match="must hold a reading to be a bag"):
        exported(tmp_path / "empty.mcap", out)
    assert [path.name for path in tmp_path.iterdir()] == ["empty.mcap"]


def test_it_is_as_private_as_the_recording(log: Path, tmp_path: Path) -> None:
    own, out = tmp_path / "log.mcap", tmp_path / "a.rosbag2"
    own.write_bytes(log.read_bytes())
    own.chmod(0o640)
    exported(own, out)
    modes = [path.stat().st_mode & 0o777 for path in (out, *out.iterdir())]
    assert modes == [0o750, 0o640, 0o640]


def test_what_the_recording_lacks_is_left_out_and_counted(
    log: Path, tmp_path: Path
) -> None:
    without_states(log, tmp_path / "log.mcap", (BROKEN,))
    done = exported(tmp_path / "log.mcap", tmp_path / "a.rosbag2")
    assert (done.ticks, done.incomplete, done.whole) == (TICKS, 1, False)
    at = list(read_at(log))[BROKEN - 1]
    topics = [
        topic for topic, when, _ in read_bag(tmp_path / "a.rosbag2") if when == at
    ]
    assert topics == [*TOPICS]
