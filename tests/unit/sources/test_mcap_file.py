"""Messages of other programs become rows by the clock, and bad ones are said."""

import json
import sqlite3
import struct
from collections.abc import Callable, Iterable
from contextlib import closing
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
import zstandard
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosWriter

from neurosnap.apps.export.relations import open_data
from neurosnap.errors import InvalidValueError
from neurosnap.poc.order.literal_sets import from_words
from neurosnap.sources import bag_records, mcap_file, message_fields
from neurosnap.sources.bag_records import is_bag
from neurosnap.sources.conditions import parse_condition
from neurosnap.sources.open import open_source, settle
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.readings import Readings, regular_period
from neurosnap.sources.ros2.message_types import stock_types
from neurosnap.sources.wanted import Wanted
from tests.support.command_line import call, happy

Said = tuple[float, str, Any]


def write(path: Path, said: Iterable[Said], *, encoding: str = "json") -> Path:
    """Write messages: time, topic, and what is encoded; bytes stay as they are."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=512, compression=CompressionType.ZSTD)
        writer.start()
        channels: dict[tuple[str, str], int] = {}
        for at, topic, value in said:
            kind = "cdr" if isinstance(value, bytes) and encoding == "cdr" else encoding
            if (topic, kind) not in channels:
                channels[topic, kind] = writer.register_channel(topic, kind, 0)
            data = value if isinstance(value, bytes) else json.dumps(value).encode()
            nanoseconds = round(at * 1e9)
            writer.add_message(
                channels[topic, kind], nanoseconds + 7, data, nanoseconds
            )
        writer.finish()
    return path


def shown(readings: Readings) -> dict[str, str]:
    """Return what each sensor read: 1, 0 or ?."""
    columns, names = readings.columns, readings.columns.sensorium.names
    on, off = (
        [from_words(row, columns.ticks) for row in rows]
        for rows in (columns.on, columns.off)
    )
    return {
        name: "".join(
            "1" if a else "0" if b else "?"
            for a, b in zip(on[k].tolist(), off[k].tolist(), strict=True)
        )
        for k, name in enumerate(names)
    }


def test_only_what_is_named_is_looked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[Said] = [(n // 2, f"/{n % 2}", {"r": [n], "on": 1}) for n in range(2, 8)]
    path, spy = str(write(tmp_path / "a.mcap", said)), Mock(wraps=message_fields.fields)
    monkeypatch.setattr(mcap_file, "fields", spy)
    readings = open_readings(
        path, Wanted(("min(/0.r[0:2]) > 3", "/0 heard within 2 s"))
    )
    assert shown(readings) == {"min(/0.r[0:2])>3": "011", "/0 heard within 2 s": "111"}
    # Of each topic the first message has all, and others have what is named.
    none = (False,)
    passes = [(), (), none, none, none, none], [(), none, none]
    assert [each.args[3:] for each in spy.call_args_list] == [*passes[0], *passes[1]]
    whole = "/a", "/a.x", "[/]a.x", "*x", "/a.x heard within 1 s", "/a = on"
    assert all(Wanted((name,)).parsed().looks_into("/a") for name in whole)
    others = "/b.x", "max(/a.x)", "max(/a.x) > 1", "/a heard within 1 s"
    assert not any(
        Wanted((name,)).parsed().parsed().looks_into("/a") for name in others
    )


def test_rows_are_what_was_said_last_and_what_is_too_old_is_unknown(
    tmp_path: Path,
) -> None:
    said: list[Said] = [(at, "/a", {"on": at % 2 == 0}) for at in range(1, 13)]
    said += [(1.5, "/b", {"x": [{"y": 5}, 0.5]}), (2.5, "/b", {"x": [{"y": 7}]})]
    path = write(tmp_path / "a.mcap", sorted(said, key=lambda each: each[0]))
    readings = open_readings(str(path))
    # The clock's period is that of the topics, 1 s; /b is unknown after 3 s.
    assert shown(readings) == {
        "/a.on": "010101010101",
        "/b.x[0].y>5": "0111?" + "?" * 7,
    }
    assert readings.times is not None
    assert readings.times[0] == "1970-01-01 00:00:02Z"
    slower = open_readings(str(path), Wanted(("/a",), every=3.0))
    assert shown(slower) == {"/a.on": "0101"}
    assert (regular_period(readings), regular_period(slower)) == (1.0, 3.0)


def test_topics_signals_and_conditions_are_chosen(tmp_path: Path) -> None:
    said = [
        (at / 4, "/m", {"mode": "a" if at < 9 else "b", "v": at}) for at in range(20)
    ]
    path = str(write(tmp_path / "m.mcap", said))
    when = (parse_condition("/m.v > 9, off < 5"), parse_condition("/m.mode = b"))
    assert [*shown(open_readings(path, Wanted((), when)))] == ["/m.mode=b", "/m.v>9"]
    assert [*shown(open_readings(path, Wanted(("/m.mode",))))] == [
        "/m.mode=a",
        "/m.mode=b",
    ]
    assert len(shown(open_readings(path, Wanted(("/m",))))) == 5
    with pytest.raises(InvalidValueError, match=r"must have this sensor, got '/x'"):
        open_readings(path, Wanted(("/x",)))
    for every in (1e-9, float("nan")):
        with pytest.raises(
            InvalidValueError, match=r"^every: must be 0\.001 s or more"
        ):
            open_readings(path, Wanted(every=every))
    settled = settle(path, {"sensors": "/m"})
    early, whole = open_source(path, 0, settled).sensors, shown(open_readings(path))
    assert len(early) == len(whole) == 5
    assert early[2:] != tuple(whole)[2:]  # the first quarter has smaller numbers


def test_a_stretch_of_a_list_a_change_and_presence_are_sensors(tmp_path: Path) -> None:
    ranges = [[9.0] * 80 + [at / 4] * 80 for at in range(8)]
    said: list[Said] = [
        (at, "/scan", {"ranges": each}) for at, each in enumerate(ranges, start=1)
    ]
    said += [(at + 1.5, "/mode", {"now": "ab"[at > 2]}) for at in range(4)]
    path = str(write(tmp_path / "a.mcap", sorted(said, key=lambda each: each[0])))
    wanted = (
        "min(/scan.ranges[80:160]) < 1",
        "min(/scan.ranges[:80]) < 1",
        *("/mode.now changes", "/mode heard within 1500 ms", "/mode heard within .4 s"),
        *("max(/scan.ranges) falls", "mean(/scan.ranges[80:]) rises"),
    )
    found = open_readings(path, Wanted(wanted, every=1))
    assert shown(found) == {
        "/mode.now changes": "?00111??",
        "min(/scan.ranges[80:160])<1": "11110000",
        "min(/scan.ranges[:80])<1": "00000000",
        "max(/scan.ranges) falls": "?0000000",
        "mean(/scan.ranges[80:]) rises": "?1111111",
        "/mode heard within 1.5 s": "11110000",
        "/mode heard within 0.4 s": "00000000",
    }
    settled = settle(path, {"sensors": json.dumps(wanted), "every": 1.0})
    assert open_source(path, 0, settled).sensors == tuple(shown(found))
    with pytest.raises(
        InvalidValueError, match=r"rages\): must have the field .rages \("
    ):
        open_readings(path, Wanted(("min(/scan.rages)",)))
    with pytest.raises(InvalidValueError, match=r"must have this sensor.*'min\(/scam"):
        open_readings(path, Wanted(("min(/scam.ranges) > 1",)))


def test_after_a_silence_rows_go_on_and_a_clock_put_back_stands(tmp_path: Path) -> None:
    times = (1, 2, 3, 1e9, 1e9 + 1, 5, 6, 1e9 + 2, *range(7, 12))
    said = [(at, "/a", {"on": True, "note": f"at {at}"}) for at in times]
    readings = open_readings(str(write(tmp_path / "a.mcap", said)), Wanted(every=1))
    assert set(shown(readings)["/a.on"]) == {"1"}
    assert readings.columns.ticks == 7


def test_what_cannot_be_decoded_is_told_of_its_channel_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    deep: Any = 1
    for _ in range(40):
        deep = {"a": deep}
    said = [
        *(
            (at, "/a", {"on": at > 2, "deep": deep, "many": [0] * 10**4})
            for at in range(5)
        ),
        *((at, "/bad", b'{"on": tru') for at in range(5)),
    ]
    path = write(tmp_path / "a.mcap", said)
    readings = open_readings(str(path), Wanted(every=1))
    assert shown(readings)["/a.on"] == "0011?"[: readings.columns.ticks]
    assert len(shown(readings)) == 1 + 64  # not ten thousand, and not what is deep
    told = [message for message in caplog.messages if "/bad: left out" in message]
    assert len(told) == 1
    cdr = write(tmp_path / "cdr.mcap", [(1, "/a", b"\0\1")], encoding="cdr")
    with pytest.raises(InvalidValueError, match="must hold messages that can be read"):
        open_readings(str(cdr))
    assert "cdr is not understood" in caplog.text


def cut(data: bytes) -> bytes:
    return data[: len(data) // 2]


def lying(data: bytes) -> bytes:
    """Let a chunk claim to unpack to more than it may."""
    at = data.index(b"\x06") if data[0] == 6 else data.index(b"zstd")
    head = at - 4 - 4 - 8
    return data[:head] + struct.pack("<Q", 2**40) + data[head + 8 :]


def bomb(data: bytes) -> bytes:
    """Let a frame claim more than its chunk does."""
    real = zstandard.compress(bytes(1 << 20))
    at = data.index(b"zstd") + 4 + 8
    return data[:at] + real[: len(data) - at] + data[at + len(real) :]


@pytest.mark.parametrize(
    ("damage", "rule"),
    [(cut, "be whole"), (lying, "unpack to at most"), (bomb, "unpack to at most")],
)
def test_a_file_that_lies_is_refused_at_its_place(
    tmp_path: Path,
    damage: Callable[[bytes], bytes],
    rule: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = write(tmp_path / "a.mcap", [(at, "/a", {"on": at}) for at in range(200)])
    path.write_bytes(damage(path.read_bytes()))
    monkeypatch.setattr(bag_records, "_LIMIT", 1 << 19)
    with pytest.raises(InvalidValueError, match=rf"a\.mcap: must {rule}.* byte \d+"):
        open_readings(str(path))


def test_an_lz4_chunk_is_unpacked_to_what_it_says_and_no_further(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.LZ4)
        writer.start()
        channel = writer.register_channel("/a", "json", 0)
        for at in range(1, 9):
            data = json.dumps({"on": at % 2 == 0, "note": "x" * 999}).encode()
            writer.add_message(channel, at * 10**9, data, at * 10**9)
        writer.finish()
    assert shown(open_readings(str(path), Wanted(("/a.on",)))) == {"/a.on": "01010101"}
    data = path.read_bytes()
    size = data.index(b"lz4") - 16  # its length, the checksum, and the size before
    path.write_bytes(data[:size] + struct.pack("<Q", 99) + data[size + 8 :])
    with pytest.raises(InvalidValueError, match="must unpack to what it says by byte"):
        open_readings(str(path))


def test_a_recording_of_ours_is_none_of_another_program(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [(1, "/a", {"on": True})])
    assert isinstance(open_data(path), Readings)
    assert not is_bag(__file__)
    ours = "tests/golden/runs/cells.mcap"
    assert not is_bag(ours)
    with pytest.raises(InvalidValueError, match="must not be a run's own recording"):
        open_readings(ours)


def test_info_tells_topics_fields_and_the_sensors_they_give(tmp_path: Path) -> None:
    said: list[Said] = [
        (at / 2, "/m", {"on": at % 2 == 0, "v": -at % 9, "note": f"at {at}", "n": None})
        for at in range(20)
    ]
    path = write(tmp_path / "m.mcap", [*said, (10, "/one", {"mode": "Auto"})])
    facts = happy("info", path)
    assert facts["topics"] == [
        {"topic": "/m", "messages": 20, "every": 0.5},
        {"topic": "/one", "messages": 1, "every": 0},
    ]
    fields = {
        each["field"]: (each["says"], each["sensors"]) for each in facts["fields"]
    }
    assert fields == {
        "/m.on": ("false, true", ["/m.on"]),
        "/m.v": ("0 to 8", ["/m.v>2", "/m.v>4", "/m.v>7"]),
        "/m.note": ("text", []),
        "/m.n": ("nothing", ["/m.n"]),
        "/one.mode": ("auto", []),
    }
    assert "/m.note    text         left out" in call("info", path).stdout


def test_a_folder_of_files_is_read_in_the_order_of_their_numbers(
    tmp_path: Path,
) -> None:
    bag = tmp_path / "bag"
    bag.mkdir()
    said = [[(at, "/a", {"on": at % 2 == 0}), (at, "/b", b"no")] for at in range(1, 13)]
    for at in range(12):
        write(bag / f"bag_{at}.mcap", said[at])
    whole = shown(open_readings(str(bag), Wanted(every=1)))
    assert whole == {"/a.on": "010101010101"}
    source = open_source(str(bag), 0, settle(str(bag), {"every": 1.0}))
    assert source.sensors == ("/a.on",)
    assert happy("info", bag)["topics"] == [{"topic": "/a", "messages": 12, "every": 1}]
    assert happy("learn", bag)["sensors"] == 1
    (bag / "bag_11.mcap").write_bytes(b"")
    with pytest.raises(InvalidValueError, match=r"bag_11\.mcap: must be whole MCAP"):
        open_readings(str(bag))
    with pytest.raises(InvalidValueError, match="folder"):
        open_source(str(tmp_path), 0, {})


# Bags of other kinds ------------------------------------------------------------------


@pytest.mark.parametrize("described", [True, False])
def test_a_bag_in_sqlite_is_read_like_one_in_mcap(
    tmp_path: Path, described: bool
) -> None:
    types = stock_types()
    truth = types.types["std_msgs/msg/Bool"]
    folder = tmp_path / "bag"
    with RosWriter(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        channel = writer.add_connection("/door", "std_msgs/msg/Bool", typestore=types)
        for at in range(1, 9):
            data = types.serialize_cdr(truth(at > 4), "std_msgs/msg/Bool")
            writer.write(channel, at * 10**9, data)
    (file,) = folder.glob("*.db3")
    if not described:
        with closing(sqlite3.connect(file)) as database, database:
            database.execute("DELETE FROM message_definitions")
    for path in (folder, file):
        assert is_bag(str(path))
        found = open_readings(str(path), Wanted(every=1))
        assert shown(found) == {"/door.data": "00001111"}
        assert found.times is not None
        assert found.times[0] == "1970-01-01 00:00:02Z"
    file.write_bytes(file.read_bytes()[:5000])
    with pytest.raises(InvalidValueError, match=r"db3: must be a whole bag of ROS 2"):
        open_readings(str(folder))


def test_messages_of_protocol_buffers_are_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for at in range(1, 9):
            writer.write_message(
                "/value",
                FieldDescriptorProto(name="ab"[at > 4], number=at),
                at * 10**9,
                at * 10**9,
            )
    found = shown(open_readings(str(path), Wanted(("/value.number > 6",), every=1)))
    assert found == {"/value.number>6": "00000011"}
    names = shown(open_readings(str(path), Wanted(("/value.name",), every=1)))
    assert names == {"/value.name=a": "11110000", "/value.name=b": "00001111"}


def test_of_protocol_buffers_only_what_is_right_is_read(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        for topic, schema, data in (
            ("/torn", FileDescriptorSet().SerializeToString(), b"\x0a"),
            ("/lies", b"\xff" * 9, b""),
        ):
            kind = writer.register_schema("a.B", "protobuf", schema)
            channel = writer.register_channel(topic, "protobuf", kind)
            writer.add_message(channel, 1, data, 1)
        truth = writer.register_channel("/a", "json", 0)
        writer.add_message(truth, 1, b'{"on": true}', 1)
        writer.finish()
    assert shown(open_readings(str(path))) == {"/a.on": "1"}
    told = [message.partition("a.mcap: ")[2] for message in caplog.messages]
    assert told == [
        "/torn: left out: types of a.B cannot be read (McapError)",
        "/lies: left out: types of a.B cannot be read (DecodeError)",
    ]
