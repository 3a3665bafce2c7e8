"""Messages of ROS 2 are decoded by the types in the file, whatever else is in it."""

import struct
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.records import Schema
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from neurosnap.sources.message_fields import fields
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.ros2.message_types import TypesByHash, cdr_decoder
from neurosnap.sources.wanted import Wanted

STORE: Any = get_typestore(Stores.ROS2_JAZZY)
STATUS, BOOL = "diagnostic_msgs/msg/DiagnosticArray", "std_msgs/msg/Bool"


def schema(name: str, text: str = "", encoding: str = "ros2msg") -> Schema:
    text = text or STORE.generate_msgdef(name, ros_version=2)[0]
    return Schema(id=1, name=name, encoding=encoding, data=text.encode())


def status(*levels: int, at: int = 1) -> bytes:
    kinds = STORE.types
    header = kinds["std_msgs/msg/Header"](
        stamp=kinds["builtin_interfaces/msg/Time"](sec=at, nanosec=5), frame_id="ab"
    )
    value = kinds["diagnostic_msgs/msg/KeyValue"](key="k", value="v")
    each = kinds["diagnostic_msgs/msg/DiagnosticStatus"]
    said = [each(level, "door", "stuck", "h", [value]) for level in levels]
    return bytes(STORE.serialize_cdr(kinds[STATUS](header, said), STATUS))


def test_a_message_is_its_fields_without_times_and_constants() -> None:
    status_of_door = {
        "level": 1,
        "message": "stuck",
        "hardware_id": "h",
        "values": {"k": "v"},
    }
    decode = cdr_decoder(schema(STATUS))
    said = {"header": {"frame_id": "ab"}, "status": {"door": status_of_door}}
    assert decode(status(1)) == said
    data = bytearray(status(1))
    data[19] = 0xE5  # the padding of real ROS 2 is garbage
    assert decode(bytes(data)) == said


def test_bytes_have_no_sign_and_what_stands_behind_a_message_is_passed_over() -> None:
    decode = cdr_decoder(schema("test/msg/A", "byte x\nbyte[2] y\nbyte[] z\nint8 w\n"))
    data = b"\0\1\0\0" + bytes([255, 254, 3, 0, 1, 0, 0, 0, 128, 255])
    said: Any = decode(data + b"\xf2\x9d\x8f\xcd")
    assert (said["x"], said["w"]) == (255, -1)
    assert [*said["y"].tolist(), *said["z"].tolist()] == [254, 3, 128]


def test_a_type_without_fields_has_none() -> None:
    assert cdr_decoder(schema("std_msgs/msg/Empty"))(b"\0\1\0\0\0") == {}


def test_char_has_the_hash_of_a_number(tmp_path: Path) -> None:
    # As real ROS 2 has it.
    hashed = "RIHS01_3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9"
    file = tmp_path / "test" / "msg" / "Char.msg"
    file.parent.mkdir(parents=True)
    file.write_text("char data\n")
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("uint8 data", "test/msg/Char"))
    for types, name, its in (
        (TypesByHash(), "std_msgs/msg/Char", hashed),
        (TypesByHash([str(file)]), "test/msg/Char", store.hash_rihs01("test/msg/Char")),
    ):
        decoder = types.find(name, its)
        assert decoder is not None, name
        assert decoder(b"\0\1\0\0\xff") == {"data": 255}


def test_of_an_array_there_are_as_many_items() -> None:
    decode = cdr_decoder(schema("test/msg/A", "float32[] x\nuint8[2] y\n"))
    numbers = np.arange(1000, dtype="<f4")
    data = (
        b"\0\1\0\0"
        + len(numbers).to_bytes(4, "little")
        + numbers.tobytes()
        + bytes([7, 9])
    )
    said = decode(data)
    assert isinstance(said, dict)
    assert [said["x"].tolist(), said["y"].tolist()] == [[*range(1000)], [7, 9]]
    assert [name for name, _ in fields("/a", said)][62:] == [
        *("/a.x[62]", "/a.x[63]", "/a.y[0]", "/a.y[1]")
    ]


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        (
            schema(BOOL, "bool[ data"),
            r"types of std_msgs/msg/Bool cannot be read \(TypesysError\)",
        ),
        (schema(BOOL, encoding="protobuf"), "types in protobuf are not understood"),
        (schema("a/msg/B", "a/B b"), r"must be a message of a/msg/B \("),
        (schema("a/msg/B", "c/D d"), r"must be a message of a/msg/B \("),
        (schema(BOOL), r"must be a message of std_msgs/msg/Bool \("),
    ],
)
def test_types_and_messages_that_are_none_are_refused(wrong: Schema, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        cdr_decoder(wrong)(b"\0\1\0")


def test_without_the_package_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(ValueError, match=r"rosbags installed .*\[ros2\]"):
        cdr_decoder(schema(BOOL))


def test_a_bag_is_read_beside_channels_that_cannot_be(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        topics = {}
        for topic, one in [
            ("/diagnostics", schema(STATUS)),
            ("/service", schema("a/srv/B_Event", "int64 a\n---\nint64 b")),
        ]:
            kind = writer.register_schema(one.name, one.encoding, one.data)
            topics[topic] = writer.register_channel(topic, "cdr", kind)
        for tick in range(9):
            at = tick * 10**9
            for topic, data in (
                ("/diagnostics", status(tick % 3 // 2)),
                ("/service", b"x"),
            ):
                writer.add_message(topics[topic], at, data, at)
        writer.finish()
    readings = open_readings(str(path), Wanted(("/diagnostics",)))
    assert readings.columns.sensorium.names == ("/diagnostics.status.door.level",)
    assert readings.columns.ticks == 9
    assert sum("/service: left out: types of" in said for said in caplog.messages) == 1


def test_what_is_no_number_is_unknown_and_what_has_no_end_is_compared(
    tmp_path: Path,
) -> None:
    numbers = [4, 2, 3, 1, 7, float("nan"), float("inf"), float("-inf"), 5]
    path = tmp_path / "bag.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        kind = writer.register_schema("a/msg/F", "ros2msg", b"float64 x")
        channel = writer.register_channel("/f", "cdr", kind)
        for at, number in enumerate(numbers, 1):
            data = b"\0\1\0\0" + struct.pack("<d", number)
            writer.add_message(channel, at * 10**9, data, at * 10**9)
        writer.finish()
    columns = open_readings(str(path), Wanted(bins=2)).columns
    assert columns.sensorium.names == ("/f.x>4",)
    seen = zip(columns.reading(0).tolist(), columns.known(0).tolist(), strict=True)
    assert "".join("10"[not on] if known else "?" for on, known in seen) == "00001101"
