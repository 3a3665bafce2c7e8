"""Exports a run as a bag of ROS 2: a folder with an MCAP file and ``metadata.yaml``.

``/neurosnap/readings/<sensor>``, ``std_msgs/msg/Bool``
    What a sensor of the world reads, at each tick at which that is known: silence is
    what cannot be said by a boolean.
``/diagnostics``, ``diagnostic_msgs/msg/DiagnosticArray``
    What `neurosnap.sources.ros2.diagnostics` says of all of them, whenever it changes.

Messages have the time of their tick. Chunks are packed with LZ4, which packs to a 255th
at most: such a file stays within what it may unpack to.

References:
    https://github.com/ros2/rosbag2, ``rosbag2_storage_mcap``; metadata of version 9
"""

import io
import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import msgspec
from mcap.writer import CompressionType, Writer

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.export.table import Exported, Table
from neurosnap.apps.new_files import placed_folder
from neurosnap.errors import RecordingError
from neurosnap.protocol.anomaly_report import (
    anomaly_record,
    named_anomaly,
    with_support,
)
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.grown_sensors import births_of
from neurosnap.sources.ros2.diagnostics import ARRAY, Diagnostics, typestore
from neurosnap.system.distribution import version

_BOOL = "std_msgs/msg/Bool"
_SIGNS = {"T": True, "F": False}
_LATEST = 2**31 * 10**9
"""Times before this fit into a stamp of ROS 2: up to the year 2038."""
_FOREVER = {"sec": 9223372036, "nsec": 854775807}
_QOS = {
    "history": "keep_last",
    "depth": 10,
    "reliability": "reliable",
    "durability": "volatile",
    "deadline": _FOREVER,
    "lifespan": _FOREVER,
    "liveliness": "automatic",
    "liveliness_lease_duration": _FOREVER,
    "avoid_ros_namespace_conventions": False,
}
_UNFIT = re.compile(r"[^A-Za-z0-9]+")
_LONGEST = 128  # letters of a sensor in a topic, of 255 that a topic may have


def topic_names(sensors: Sequence[str]) -> list[str]:
    """Return names fit for topics of ROS 2, all different, in the order of sensors.

    Letters and digits stay, anything else becomes ``_``; where that makes two the same,
    the place of the later one is added.

    Examples:
        >>> topic_names(["door", "hall/door", "hall door", "3rd", "é"])
        ['door', 'hall_door', 'hall_door_2', 'sensor_3rd', 'sensor']
    """
    names: list[str] = []
    for place, sensor in enumerate(sensors):
        name = _UNFIT.sub("_", sensor)[:_LONGEST].strip("_")
        if not name[:1].isalpha():
            name = f"sensor_{name}".rstrip("_")
        if name in names:
            name = f"{name}_{place}"
        while name in names:  # a name that looks like one made here
            name += "x"
        names.append(name)
    return names


def write_bag(recording: Recording, out: Path) -> Exported:
    """Write the readings, the beliefs and the anomalies of a recording.

    Actions and contextual sensors are left out. A tick that lacks its reading is, too,
    and one that lacks its state has no diagnostics. It takes O(ticks · N) time.

    Args:
        recording: What is written.
        out: The folder; it must not exist.

    Raises:
        InvalidValueError: Something is there already, or there is no folder for it.
        NeurosnapError: The recording is damaged, not a run's or without a reading; or
            `rosbags` is not installed.
        OSError: It cannot be written.
    """
    body = births_of(recording).body
    sensors, table = body.own, Table(body)
    count = incomplete = 0
    said = Diagnostics(sensors)
    reads = [file.path for file in recording.files]
    with placed_folder(out, reads=reads) as draft:
        path = draft / f"{out.stem}_0.mcap"
        with path.open("wb") as file:
            bag = _Bag(file, path.name, sensors)
            anomalies = _Anomalies(recording, body)
            for tick in ticks(recording):
                count += 1
                incomplete += not tick.known
                anomaly = anomalies.at(tick.number)
                at, _, _, *cells = table.row(tick)
                if tick.observation is None:
                    continue
                if not isinstance(at, int) or not 0 <= at < _LATEST:
                    rule = "time: must be in the years 1970 to 2037 for ROS 2"
                    raise RecordingError(f"tick {tick.number}: {rule}, got {at}")
                now = [None if bit is None else bool(bit) for bit in cells]
                bag.readings(at, now[: len(sensors)])
                if tick.state is None:
                    continue
                state = str(cells[body.size])[: len(sensors)]
                held = [_SIGNS.get(sign) for sign in state]
                if said.follow(tick.number, now[: len(sensors)], held, anomaly):
                    bag.diagnostics(at, said.message(at))
            if not bag.counts:
                rule = "must hold a reading to be a bag, got none"
                raise RecordingError(f"{recording.path}: {rule}")
            (draft / "metadata.yaml").write_text(bag.finish(), encoding="utf-8")
    return Exported(str(out), count, incomplete, recording.whole)


class _Anomalies:
    """Finds the anomalies of a recording, by ticks that ascend.

    Those that rest on fewer occasions than the run asks for are none.
    """

    def __init__(self, recording: Recording, body: Body) -> None:
        self._left = recording.all("anomaly", wire.Anomaly)
        self._support, self._body = recording.options.support, body
        self._next = next(self._left, None)

    def at(self, tick: int) -> dict[str, Any] | None:
        """Return that of a tick, None if there is none."""
        while self._next is not None and self._next.tick < tick:
            self._next = next(self._left, None)
        if self._next is None or self._next.tick > tick:
            return None
        found = with_support(self._next, self._support)
        if found is None:
            return None
        return anomaly_record(named_anomaly(found, self._body))


class _Bag:
    """Writes the file of a bag, and tells what its metadata is.

    Attributes:
        counts: How many messages there are of each topic.
    """

    def __init__(self, file: BinaryIO, name: str, sensors: Sequence[str]) -> None:
        self._name = name
        self._writer = Writer(file, compression=CompressionType.LZ4)
        self._writer.start("ros2", f"neurosnap-{version()}")
        self._store = typestore()
        self._topics: dict[str, str] = {}
        self._channels: dict[str, int] = {}
        self.counts = Counter[str]()
        self._first, self._last = _LATEST, 0
        self._add(ARRAY, "/diagnostics")
        names = [f"/neurosnap/readings/{name}" for name in topic_names(sensors)]
        self._add(_BOOL, *names)
        self._readings = dict(zip(names, sensors, strict=True))
        kind = self._store.types[_BOOL]
        self._bits = {
            bit: bytes(self._store.serialize_cdr(kind(bit), _BOOL))
            for bit in (False, True)
        }

    def _add(self, kind: str, *topics: str) -> None:
        text, _ = self._store.generate_msgdef(kind, ros_version=2)
        schema = self._writer.register_schema(kind, "ros2msg", text.encode())
        more = {
            "offered_qos_profiles": _yaml([_QOS]),
            "topic_type_hash": self._store.hash_rihs01(kind),
        }
        for topic in topics:
            self._topics[topic] = kind
            channel = self._writer.register_channel(topic, "cdr", schema, more)
            self._channels[topic] = channel

    def readings(self, at: int, bits: Sequence[bool | None]) -> None:
        """Write the readings of a tick that are known."""
        for topic, bit in zip(self._readings, bits, strict=True):
            if bit is not None:
                self._write(topic, at, self._bits[bit])

    def diagnostics(self, at: int, data: bytes) -> None:
        """Write what is said of the sensors."""
        self._write("/diagnostics", at, data)

    def _write(self, topic: str, at: int, data: bytes) -> None:
        number = self.counts[topic]
        self.counts[topic] = number + 1
        self._first, self._last = min(self._first, at), max(self._last, at)
        self._writer.add_message(self._channels[topic], at, data, at, number)

    def finish(self) -> str:
        """End the file; return the text of ``metadata.yaml``."""
        where = {
            "starting_time": {"nanoseconds_since_epoch": self._first},
            "duration": {"nanoseconds": self._last - self._first},
            "message_count": self.counts.total(),
        }
        topics = [
            {
                "topic_metadata": {
                    "name": topic,
                    "type": kind,
                    "serialization_format": "cdr",
                    "offered_qos_profiles": [_QOS],
                    "type_description_hash": self._store.hash_rihs01(kind),
                },
                "message_count": self.counts[topic],
            }
            for topic, kind in self._topics.items()
        ]
        about = {
            "version": 9,
            "storage_identifier": "mcap",
            "relative_file_paths": [self._name],
            **where,
            "topics_with_message_count": topics,
            "compression_format": "",
            "compression_mode": "",
            "files": [{"path": self._name, **where}],
            "custom_data": self._readings,
            "ros_distro": "unknown",
        }
        self._writer.add_metadata("rosbag2", {"serialized_metadata": _yaml(about)})
        self._writer.finish()
        return _yaml({"rosbag2_bagfile_information": about})


def _yaml(value: object) -> str:
    from ruamel.yaml import YAML

    yaml, text = YAML(typ="safe"), io.StringIO()
    yaml.default_flow_style = False
    # A copy: what stands in it several times would be said once, and referred to.
    yaml.dump(msgspec.json.decode(msgspec.json.encode(value)), text)
    return text.getvalue()
