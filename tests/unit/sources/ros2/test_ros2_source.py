"""Messages of ROS 2 become readings, whatever else is on the topics."""

import math
import time
from collections.abc import Iterator
from contextlib import ExitStack, closing
from itertools import count
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import zenoh

from neurosnap.errors import FabricError, InvalidValueError
from neurosnap.fabric.zenoh.connect_session import configuration
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.tick_schedule import OnChange
from neurosnap.sources.open import ROS2, open_live, ros2_options, settle
from neurosnap.sources.ros2 import ros2_source
from neurosnap.sources.ros2.graph import open_session
from neurosnap.sources.ros2.keys_and_tokens import (
    PUBLISHER,
    SERVICE,
    Attachment,
    Endpoint,
    GraphNode,
    Qos,
    parse_attachment,
)
from neurosnap.sources.ros2.message_types import ANSWERED, ASKED, LARGEST, _service
from neurosnap.sources.ros2.node import RosNode
from tests.support.patience import PATIENCE
from tests.support.ports import free_port
from tests.support.senders import listened_to
from tests.support.sources import readings

pytestmark = pytest.mark.zenoh
BOOL, FLOAT, TEXT = (f"std_msgs/msg/{name}" for name in ("Bool", "Float64", "String"))
BATTERY, SCAN = "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/LaserScan"
LATCHED = Qos(latched=True, depth=1)
Bits = list[bool | None]
domains = count(100)


class Robot:
    """A node, and a source that hears it."""

    def __init__(self, router: str, closes: ExitStack) -> None:
        self.domain, self.router, self._closes = next(domains), router, closes
        self.session = closes.enter_context(open_session(router))
        self.node = RosNode(self.session, "robot", domain=self.domain)
        closes.callback(self.node.close)
        self.types = self.node.types

    def hear(self, *sensors: str, **more: Any) -> LiveSource:
        options = {"sensors": sensors, "router": self.router, "domain": self.domain}
        said = {"tick": {"min_interval": 0}, **options, **more}
        source = open_live(ROS2, {"options": msgspec.json.encode(said).decode()})
        return self._closes.enter_context(closing(source))

    def key(self, topic: str, kind: str, hashed: str = "") -> str:
        hashed = hashed or self.node._store.hash_rihs01(kind)
        node = GraphNode(self.domain, "ab", "0", "stranger")
        return Endpoint(node, "1", PUBLISHER, topic, kind, hashed).key


@pytest.fixture
def robot(router: str) -> Iterator[Robot]:
    with ExitStack() as closes:
        yield Robot(router, closes)


def until(source: LiveSource, wanted: Bits) -> None:
    """Wait for a tick that shows this."""
    while True:
        seen = source.step(-1)
        assert seen is not None
        if readings(seen) == wanted:
            return


def refused(source: LiveSource, many: int) -> None:
    """Wait until so many messages were refused."""
    while source.statistics().received.refused < many:
        time.sleep(0)


def test_fields_terms_words_and_presence(robot: Robot) -> None:
    door = robot.node.publisher("/door", BOOL, LATCHED)
    mode = robot.node.publisher("/arm/mode", TEXT, LATCHED)
    battery = robot.node.publisher("/battery_state", FLOAT, LATCHED)
    scan = robot.node.publisher("/scan", "std_msgs/msg/Float32MultiArray", LATCHED)
    multi = robot.types["std_msgs/msg/Float32MultiArray"]
    layout = robot.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    ranges = np.array([math.nan, 0.4, *[math.inf] * 8], np.float32)
    door.publish(robot.types[BOOL](True))
    mode.publish(robot.types[TEXT]("Auto"))
    battery.publish(robot.types[FLOAT](0.1))
    scan.publish(multi(layout, ranges))
    source = robot.hear(
        "/door.data",
        "/arm/mode.data = auto",
        "/battery_state.data < 0.2, off > 0.3",
        "min(/scan.data[0:2]) < 0.5",
        "min(/scan.data[2:4]) < 0.5",
        "/scan.data[0] < 0.5",
        "/door heard within 3600 s",
    )
    assert source.sensors[2:4] == (
        "/battery_state.data<0.2",
        "min(/scan.data[0:2])<0.5",
    )
    until(source, [True, True, True, True, False, None, True])
    battery.publish(robot.types[FLOAT](0.25))
    door.publish(robot.types[BOOL](False))
    until(source, [False, True, True, True, False, None, True])
    battery.publish(robot.types[FLOAT](math.nan))
    until(source, [False, True, None, True, False, None, True])
    assert source.statistics().received.refused == 0


def test_real_messages(robot: Robot) -> None:
    stamp = robot.types["std_msgs/msg/Header"](
        stamp=robot.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="b"
    )
    nothing = np.zeros(0, np.float32)
    battery = robot.node.publisher("/battery_state", BATTERY, LATCHED)
    battery.publish(
        robot.types[BATTERY](
            *(stamp, 12.0, 20.0, 1.0, 1.0, 2.0, 3.0, 0.15, 2, 1, 2, True),
            *(nothing, nothing, "slot", "serial"),
        )
    )
    scan = robot.node.publisher("/scan", SCAN, LATCHED)
    ranges = np.full(640, 2, np.float32)
    ranges[100] = 0.3
    scan.publish(robot.types[SCAN](stamp, 0, 1, 0.1, 0, 0, 0, 9, ranges, nothing))
    source = robot.hear(
        *("/battery_state.present", "/battery_state.percentage < 0.2"),
        *("min(/scan.ranges[0:80]) < 0.5", "min(/scan.ranges[80:160]) < 0.5"),
        "/scan.ranges[100] < 0.5",
    )
    until(source, [True, True, False, True, True])


def test_an_array_of_a_million_is_read(robot: Robot) -> None:
    source = robot.hear("min(/scan.data[0:2]) < 0.5", "/scan.data[999999] < 0.5")
    kind = "std_msgs/msg/Float32MultiArray"
    layout = robot.types["std_msgs/msg/MultiArrayLayout"]([], 0)
    many = robot.types[kind](layout, np.zeros(1_000_000, np.float32))
    payload = bytes(robot.node._store.serialize_cdr(many, kind))
    source._start()
    other = listened_to(robot.session, robot.key("/scan", kind))
    other.put(payload, attachment=Attachment(1, 1, bytes(16)).data)
    until(source, [True, True])


def test_statuses_are_called_by_their_names(robot: Robot) -> None:
    status, array = (
        robot.types[f"diagnostic_msgs/msg/Diagnostic{x}"] for x in ("Status", "Array")
    )
    pair = robot.types["diagnostic_msgs/msg/KeyValue"]
    stamp = robot.types["std_msgs/msg/Header"](
        stamp=robot.types["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id=""
    )
    kind = "diagnostic_msgs/msg/DiagnosticArray"
    one, two = (robot.node.publisher("/diagnostics", kind, LATCHED) for _ in range(2))
    one.publish(array(stamp, [status(2, "arm: left.motor", "hot", "", [])]))
    heat = [pair("fan", "on"), pair("heat", "71.5")]
    two.publish(array(stamp, [status(0, "wheel", "fine", "", heat)]))
    source = robot.hear(
        "/diagnostics.status.arm: left_motor.level > 0",
        "/diagnostics.status.wheel.level > 0",
        "/diagnostics.status.wheel.values.heat > 70",
    )
    until(source, [True, False, True])


def test_what_nothing_publishes_any_more_is_unknown(robot: Robot) -> None:
    source = robot.hear("/door.data", "/lamp.data")
    lamp = robot.node.publisher("/lamp", BOOL, LATCHED)
    lamp.publish(robot.types[BOOL](True))
    began = time.time_ns()
    clock = iter([began, began + 1])
    named: Any = {"domain": robot.domain, "clock": clock.__next__}
    other = RosNode(robot.session, "other", **named)
    other.publisher("/door", BOOL, LATCHED).publish(robot.types[BOOL](False))
    until(source, [False, True])
    other.close()
    until(source, [None, True])
    assert source.statistics().received.shown == 2  # its silence is none
    # As a program that was started anew, with a clock that is behind.
    other = RosNode(robot.session, "other", **named)
    other.publisher("/door", BOOL, LATCHED).publish(robot.types[BOOL](True))
    until(source, [True, True])
    other.close()


def test_what_is_latched_is_asked_for_once(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros2_source, "_AGAIN", 3600.0)
    asked, key = list[str](), f"{robot.domain}/door/*/*/@adv/**"
    robot.session.declare_queryable(key, lambda query: asked.append(str(query)))
    robot.node.publisher("/door", BOOL, LATCHED).publish(robot.types[BOOL](True))
    for times in range(1, 4):
        with closing(robot.hear("/door.data")) as source:
            until(source, [True])
        while len(asked) < times:  # another may have answered before
            time.sleep(0)
    assert len(asked) == 3
    until(robot.hear("/door.data"), [True])
    robot.node.publisher("/door", BOOL, LATCHED)
    while len(asked) < 5:
        time.sleep(0)


def test_what_does_not_come_is_asked_for_again(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ros2_source, "_AGAIN", 0.001)
    asked, key = list[str](), f"{robot.domain}/door/*/*/@adv/**"
    robot.session.declare_queryable(key, lambda query: asked.append(str(query)))
    robot.node.publisher("/door", BOOL, LATCHED)
    robot.hear("/door.data")._start()
    while len(asked) < 1 + 5:
        time.sleep(0)


def test_times_are_the_publishers(robot: Robot) -> None:
    source = robot.hear("/door.data")
    clock = iter([2 * 10**9, 10**9, 3 * 10**9])
    node = RosNode(robot.session, "slow", domain=robot.domain, clock=clock.__next__)
    door = node.publisher("/door", BOOL, Qos(latched=True, depth=3))
    for on in (True, False, True):
        door.publish(robot.types[BOOL](on))
    until(source, [True])
    while source.statistics().received.late < 1:
        time.sleep(0)
    node.close()


def test_what_is_stale_is_unknown(robot: Robot) -> None:
    # What is only heard is not stale: so there is a tick, however late the other's is.
    source = robot.hear("/door.data", "/lamp heard within 3600 s", stale_after=0.05)
    source._start()
    for topic in ("/door", "/lamp"):
        robot.node.publisher(topic, BOOL, LATCHED).publish(robot.types[BOOL](False))
    while source.statistics().after < 2:
        time.sleep(0)
    until(source, [None, True])


def test_wrong_messages_are_refused_and_named(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    source = robot.hear("/door.data", tick={"interval": 0.001})
    lamp = robot.node.publisher("/door", BOOL)
    lamp.publish(robot.types[BOOL](True))
    right = Attachment(1, 1, bytes(16)).data
    fine = b"\0\1\0\0\1"
    source._start()
    other = listened_to(robot.session, robot.key("/door", BOOL))
    for payload, attachment in (
        (fine, None),
        (fine, b"x" * 32),
        (b"\0\7\0\0\1", right),
        (b"\0\1\0\0", right),
        (b"", right),
        (bytes(LARGEST + 1), right),
    ):
        other.put(payload, attachment=attachment)
    refused(source, 6)
    first = "/door: must come with number, time and sender in 33 bytes (it has 0)"
    assert caplog.messages[0] == first
    assert source.statistics().received.refused == 6
    lamp.publish(robot.types[BOOL](True))
    seen = source.first()
    assert seen is not None
    source.close()
    assert caplog.messages[1].endswith(
        f"/door: must be up to {LARGEST} bytes, got {LARGEST + 1}"
    )


def test_a_topic_may_change_its_type(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    source = robot.hear("/door.data", "/door.open")
    other = RosNode(robot.session, "other", domain=robot.domain)
    other.publisher("/door", BOOL, LATCHED).publish(robot.types[BOOL](True))
    until(source, [True, None])
    assert caplog.messages == [
        "/door.open: must have the field .open (there are data): it is unknown"
    ]
    other.close()
    number = robot.node.publisher("/door", "std_msgs/msg/UInt8", LATCHED)
    number.publish(robot.types["std_msgs/msg/UInt8"](0))
    until(source, [False, None])
    number.publish(robot.types["std_msgs/msg/UInt8"](7))
    while len(caplog.messages) < 2:
        time.sleep(0)
    assert caplog.messages[1].startswith("/door.data: must be 0 or 1, false or true")


def settled(robot: Robot, *sensors: str) -> tuple[str, ...]:
    said = {"sensors": sensors, "router": robot.router, "domain": robot.domain}
    options = msgspec.json.encode({**said, "stretch": PATIENCE}).decode()
    return ros2_options(settle(ROS2, {"options": options})).sensors


def test_booleans_are_learned_at_once(robot: Robot) -> None:
    for topic in ("/door", "/lamp"):
        door = robot.node.publisher(topic, BOOL, LATCHED)
        door.publish(robot.types[BOOL](True))
    sensors = "/lamp.data", "/scan heard within 1 s", "/door.data"
    assert settled(robot, *sensors) == sensors


def test_numbers_and_words_are_cut_by_what_they_say_first(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    level = robot.node.publisher("/level", FLOAT, Qos(latched=True, depth=4))
    mode = robot.node.publisher("/mode", TEXT, Qos(latched=True, depth=2))
    for number in (1, 2, 3, 4):
        level.publish(robot.types[FLOAT](number))
    for word in ("auto", "manual"):
        mode.publish(robot.types[TEXT](word))

    def listen(feeder: Any, ranges: Any, seconds: float) -> None:
        """Listen until all that is latched has come."""
        latest = LatestReadings(["-"])
        with closing(LiveSource(latest, OnChange(), feeder=feeder)) as s:
            s.readers = ranges
            s._start()
            while s.statistics().received.shown + s.statistics().received.late < 6:
                time.sleep(0)
        assert seconds == PATIENCE

    monkeypatch.setattr(ros2_source, "listen", listen)
    assert settled(robot, "/mode", "/door.data", "/level.data", "/level.data > 9") == (
        *("/mode.data = auto", "/mode.data = manual", "/door.data"),
        *("/level.data > 1.0", "/level.data > 2.0", "/level.data > 3.0"),
        "/level.data > 9",
    )


DOOR = "my_msgs/msg/Door"
DOOR_TEXT = """\
bool open
std_msgs/Header header
float64[3] place
string<=5 word
int8[<=4] few
my_msgs/Hinge[] hinges
"""
HINGE_TEXT = "uint16 oil\n"


@pytest.fixture
def door_files(tmp_path: Path) -> list[str]:
    folder = tmp_path / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    files = [folder / "Hinge.msg", folder / "Door.msg"]
    files[0].write_text(HINGE_TEXT)
    files[1].write_text(DOOR_TEXT)
    return [str(file) for file in files]


def door_types() -> Any:
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(HINGE_TEXT, "my_msgs/msg/Hinge"))
    store.register(get_types_from_msg(DOOR_TEXT, DOOR))
    return store


def put_door(robot: Robot, on: bool) -> None:
    """Publish a message of a type that does not come with ROS 2, latched."""
    store = door_types()
    kinds = store.types
    header = kinds["std_msgs/msg/Header"](
        stamp=kinds["builtin_interfaces/msg/Time"](sec=1, nanosec=2), frame_id="b"
    )
    few = np.array([1], np.int8)
    hinge = [kinds["my_msgs/msg/Hinge"](300)]
    said = kinds[DOOR](on, header, np.zeros(3), "word", few, hinge)
    robot.node._store = store
    robot.node.types = kinds
    robot.node.publisher("/door", DOOR, LATCHED).publish(said)


def test_a_type_of_a_file(robot: Robot, door_files: list[str]) -> None:
    put_door(robot, True)
    sensors = "/door.open", "/door.hinges[0].oil > 299"
    until(robot.hear(*sensors, msg_files=door_files), [True, True])


def test_a_file_that_is_none(robot: Robot, tmp_path: Path) -> None:
    wrong = tmp_path / "Door.msg"
    wrong.write_text("bool open")
    with pytest.raises(InvalidValueError, match=r"^msg_files: must be PACKAGE/msg/TY"):
        robot.hear("/door.open", msg_files=[str(wrong)])
    folder = tmp_path / "my_msgs" / "msg"
    folder.mkdir(parents=True)
    for text in ("bool", None):
        wrong = folder / f"{text}.msg"
        if text:
            wrong.write_text(text)
        with pytest.raises(InvalidValueError, match=r"^msg_files: must be a file of a"):
            robot.hear("/door.open", msg_files=[str(wrong)])


def described(name: str, *fields: tuple[str, int, int, int, str]) -> Any:
    """Return a type as a node describes it: names, and what FieldType.msg has."""
    kinds = _service().types
    one = "type_description_interfaces/msg/"
    return kinds[f"{one}IndividualTypeDescription"](
        name,
        [
            kinds[f"{one}Field"](said, kinds[f"{one}FieldType"](*what), "")
            for said, *what in fields
        ],
    )


def describe(robot: Robot, query: zenoh.Query, text: str = "") -> None:
    """Answer as the node that publishes the door."""
    kinds, one = _service().types, "type_description_interfaces/msg/"
    asked = _service().deserialize_cdr(query.payload.to_bytes(), ASKED)  # type: ignore[union-attr]
    assert asked.type_name == DOOR
    assert query.attachment is not None
    assert parse_attachment(query.attachment.to_bytes()).number == 1
    door = described(
        DOOR,
        ("open", 15, 0, 0, ""),
        ("header", 1, 0, 0, "std_msgs/msg/Header"),
        ("place", 59, 3, 0, ""),
        ("word", 21, 0, 5, ""),
        ("few", 98, 4, 0, ""),
        ("hinges", 145, 0, 0, "my_msgs/msg/Hinge"),
    )
    others = [
        described(
            "builtin_interfaces/msg/Time",
            ("sec", 6, 0, 0, ""),
            ("nanosec", 7, 0, 0, ""),
        ),
        described("my_msgs/msg/Hinge", ("oil", 5, 0, 0, "")),
        described(
            "std_msgs/msg/Header",
            ("stamp", 1, 0, 0, "builtin_interfaces/msg/Time"),
            ("frame_id", 17, 0, 0, ""),
        ),
    ]
    if text == "another":
        door.fields.pop()
    said = kinds[ANSWERED](
        text != "refused", text, kinds[f"{one}TypeDescription"](door, others), [], []
    )
    payload = bytes(_service().serialize_cdr(said, ANSWERED))
    query.reply(query.key_expr, payload, attachment=query.attachment.to_bytes())


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", None),
        ("refused", "its node says of it: refused"),
        ("another", "its node describes another type"),
    ],
)
def test_a_type_that_its_node_describes(
    robot: Robot, caplog: pytest.LogCaptureFixture, text: str, why: str | None
) -> None:
    hashed = "RIHS01_" + "0" * 64  # of the service, which nothing depends on
    service = Endpoint(
        *(robot.node._node, "9", SERVICE, "/robot/get_type_description"),
        *("type_description_interfaces/srv/GetTypeDescription", hashed),
    )
    queryable = robot.session.declare_queryable(
        service.key, lambda query: describe(robot, query, text), complete=True
    )
    token = robot.session.liveliness().declare_token(service.token)
    put_door(robot, True)
    lamp = robot.node.publisher("/lamp", BOOL, LATCHED)
    lamp.publish(robot.types[BOOL](True))
    source = robot.hear("/door.open", "/door.hinges[0].oil > 299", "/lamp.data")
    until(source, [True, True, True] if why is None else [None, None, True])
    told = [f"/door: must be of a type that is known ({why})"] if why else []
    assert [text.split(", got")[0] for text in caplog.messages] == told
    token.undeclare()
    queryable.undeclare()


def test_a_type_that_nothing_tells_of_is_said_once(
    robot: Robot, caplog: pytest.LogCaptureFixture
) -> None:
    put_door(robot, True)
    lamp = robot.node.publisher("/lamp", BOOL, LATCHED)
    lamp.publish(robot.types[BOOL](True))
    source = robot.hear("/door.open", "/lamp.data")
    until(source, [None, True])
    put_door(robot, False)
    lamp.publish(robot.types[BOOL](False))
    until(source, [None, False])
    (told,) = caplog.messages
    assert told.startswith(
        "/door: must be of a type that is known (its node describes no types, and no"
        f" file of msg_files is of it), got {DOOR}, RIHS01_"
    )


def test_a_router_that_goes_and_comes_back(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = configuration("router", listen__endpoints=[endpoint])
    with ExitStack() as closes:
        hub = zenoh.open(config)
        robot = Robot(endpoint, closes)
        lamp = robot.node.publisher("/lamp", BOOL, LATCHED)
        lamp.publish(robot.types[BOOL](True))
        source = robot.hear("/lamp.data", tick={"interval": 0.001})
        until(source, [True])
        before = {str(each.zid) for each in hub.info.transports()}
        hub.close()
        while source._latest.observation(source._clock())[1].any():
            time.sleep(0)
        while source.statistics().received.outages < 1:
            time.sleep(0)
        hub = zenoh.open(config)
        until(source, [True])
        assert source.statistics().received.outages == 1
        # One that connects again by itself may be deaf, so it has a new one.
        after = {str(each.zid) for each in hub.info.transports()}
        assert before & after == {str(robot.session.zid())}
        source.close()
        robot.node.close()
        hub.close()


def test_no_router_is_an_error_in_time() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    options = {"sensors": ["/a.data"], "router": endpoint, "patience": 0.01}
    source = open_live(ROS2, {"options": msgspec.json.encode(options).decode()})
    with pytest.raises(FabricError, match=f"^ros2: must reach a router at {endpoint}"):
        source.first()
    source.close()


@pytest.mark.parametrize(
    ("options", "rule"),
    [
        ({"sensors": []}, "must hold the options of a source of ROS 2: name a file"),
        ({"sensors": ["door"]}, "must be of a topic, like /door.data"),
        ({"sensors": ["/a.b"], "router": "localhost"}, "must be like tcp/localhost:7"),
        ({"sensors": ["/a.b"], "router": "tcp/a:1#x"}, "must be like tcp/localhost:7"),
        ({"sensors": ["/a.b"], "through": "rclpy"}, "^through: must be installed for"),
        (
            {"sensors": ["/a.b"], "through": "rclpy", "publish": {}},
            'must be "zenoh" where something is published',
        ),
        ({"sensors": ["/a.b"], "domain": 999}, "must hold the options of a source of"),
    ],
)
def test_wrong_options(options: dict[str, Any], rule: str) -> None:
    with pytest.raises(InvalidValueError, match=rule):
        open_live(ROS2, {"options": msgspec.json.encode(options).decode()})


def test_what_is_not_looked_into_may_say_anything(robot: Robot) -> None:
    source = robot.hear("/door heard within 3600 s", tick={"interval": 0.001})
    source._start()
    other = listened_to(
        robot.session, robot.key("/door", "my_msgs/msg/Any", "RIHS01_1")
    )
    other.put(b"?", attachment=Attachment(1, time.time_ns(), bytes(16)).data)
    until(source, [True])
    assert source.statistics().received.refused == 0
