"""Measures how fast messages of other programs become readings, and in what memory."""

import json
import random
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from itertools import cycle, islice
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.open_readings import open_readings
from neurosnap.sources.ros2.message_types import stock_types
from neurosnap.sources.ros2.options import Ros2Options
from neurosnap.sources.ros2.ros2_source import Ros2Feeder, ros2_source
from tools.bench.report import Line, Sizes

_ENCODINGS = {"json": "JSON", "cdr": "CDR of ROS 2"}
_TOPICS = 20
_FAST = 50_000  # messages a second
_SCAN = "sensor_msgs/msg/LaserScan"
_SECTORS = [f"min(/t0.ranges[{at}:{at + 80}]) < 0.5" for at in range(0, 640, 80)]
_LEVELS = [f"/t0.status.part {n}.level > 0" for n in range(4)]
_LIVE = {
    "std_msgs/msg/Bool": ("/t0.data",),
    "sensor_msgs/msg/BatteryState": ("/t0.percentage < 0.2, off > 0.25",),
    _SCAN: tuple(_SECTORS),
    "diagnostic_msgs/msg/DiagnosticArray": tuple(_LEVELS),
}
"""What is listened to live, by the type of its topic."""
_ROW = 200  # bytes of memory


def messages(sizes: Sizes) -> list[Line]:
    """Time what `neurosnap learn` reads of a file, both its passes."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        return [
            _line(kind, 100 * sizes.ticks, sizes, Path(folder)) for kind in _ENCODINGS
        ]


def _line(kind: str, count: int, sizes: Sizes, folder: Path) -> Line:
    path, taken, sensors = folder / f"{kind}.mcap", [], 0
    _write(path, kind, "std_msgs/msg/Float64", _TOPICS, _numbers(kind, count))
    for _ in range(sizes.pairs + 1):
        began = time.process_time()
        sensors = len(open_readings(str(path)).columns.sensorium)
        taken.append(time.process_time() - began)
    pace = count / min(taken)
    return Line(
        f"{count:,} messages in {_ENCODINGS[kind]}, {_TOPICS} topics of a number each",
        f"{pace:,.0f} a second of processor time, {sensors} sensors",
        reach=f"≥ {_FAST:,}",
        reached=pace >= _FAST,
        figures={"pace": pace, "sensors": sensors},
    )


def _numbers(kind: str, count: int) -> Iterator[bytes]:
    """Yield numbers that wander, of each topic its own."""
    draw, at = random.Random(1), [0.0] * _TOPICS
    for topic in islice(cycle(range(_TOPICS)), count):
        at[topic] += draw.uniform(-1, 1)
        data = b"\0\1\0\0" + struct.pack("<d", at[topic])
        yield json.dumps({"data": at[topic]}).encode() if kind == "json" else data


def _write(path: Path, kind: str, of: str, topics: int, said: Iterable[bytes]) -> None:
    """Write messages of some topics in turns, each ten times a second."""
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema(of, "ros2msg", b"")
        ids = [writer.register_channel(f"/t{n}", kind, schema) for n in range(topics)]
        for number, data in enumerate(said):
            moment = 10**9 + number * 10**8 // topics
            writer.add_message(ids[number % topics], moment, data, moment)
        writer.finish()


def live(sizes: Sizes) -> list[Line]:
    """Time what a run does with each message of ROS 2, by its type."""
    return [_of_type(kind, sensors, sizes) for kind, sensors in _LIVE.items()]


class _Unconnected(Ros2Feeder):
    def _run(self, source: LiveSource) -> None:
        """Hear nothing: it is given its messages."""


def _of_type(kind: str, sensors: tuple[str, ...], sizes: Sizes) -> Line:
    draw, taken, count = np.random.default_rng(1), [], 10 * sizes.ticks
    options, typed = Ros2Options(sensors=sensors), stock_types().hash_rihs01(kind)
    said = [_message(kind, draw) for _ in range(count)]
    for _ in range(sizes.pairs + 1):
        feeder = _Unconnected(options)
        with closing(ros2_source(options)) as source:
            feeder.start(source)
            began = time.process_time()
            for number, data in enumerate(said):
                feeder.take("/t0", (kind, typed), 1e9 + number, data)
            taken.append((time.process_time() - began) / count)
    return Line(
        f"a message of {kind} ({len(said[0]):,} bytes), live, {len(sensors)} sensors",
        f"{1e6 * min(taken):.0f} µs of processor time",
        figures={"seconds": min(taken)},
    )


def _message(kind: str, draw: np.random.Generator) -> bytes:
    """Return a message in CDR, its numbers drawn."""
    store, zero = stock_types(), np.zeros(0, np.float32)
    made = {name.rpartition("/")[2]: each for name, each in store.types.items()}
    head, number = made["Header"](made["Time"](0, 0), "frame"), float(draw.random())
    message: Any = made["Bool"](number < 0.5)
    if kind == _SCAN:
        ranges = 3 * draw.random(640, np.float32)
        message = made["LaserScan"](head, *[number] * 7, ranges, zero)
    elif kind.endswith("BatteryState"):
        rest = 0, 0, 0, True, zero, zero, "", ""
        message = made["BatteryState"](head, *[number] * 7, *rest)
    elif kind.endswith("Array"):
        values = [made["KeyValue"]("load", str(number))] * 4
        each = [(int(number * 2), f"part {n}", "", "", values) for n in range(4)]
        status = [made["DiagnosticStatus"](*told) for told in each]
        message = made["DiagnosticArray"](head, status)
    return bytes(store.serialize_cdr(message, kind))


def bag(sizes: Sizes) -> list[Line]:
    """Measure the memory that a large bag takes, against one of a tenth of its size."""
    draw, found = np.random.default_rng(1), []
    scans = [_message(_SCAN, draw) for _ in range(100)]
    with tempfile.TemporaryDirectory(prefix="bench-") as name:
        path = Path(name, "bag.mcap")
        for size in (sizes.bag // 10, sizes.bag):
            rows = size // len(scans[0])
            _write(path, "cdr", _SCAN, 1, islice(cycle(scans), rows))
            began = time.perf_counter()
            found.append((_memory(path), rows, time.perf_counter() - began))
    (small, few, _), (large, rows, seconds) = found
    each = (large - small) / (rows - few)
    return [
        Line(
            f"a bag of {sizes.bag / 1e9:g} GB: {rows:,} scans of 640, of each one term",
            f"{large / 2**20:.0f} MiB at most, {each:.0f} bytes a row more, {seconds:.0f} s",
            f"a tenth of it {small / 2**20:.0f} MiB",
            f"≤ {_ROW} bytes a row",
            each <= _ROW,
            {"bytes": large, "row": each, "seconds": seconds},
        )
    ]


def _memory(path: Path) -> int:
    """Return the most bytes that a process of its own has which reads a bag."""
    code = (
        "import sys; from neurosnap.sources.open_readings import Wanted, open_readings;"
        " open_readings(sys.argv[1], Wanted((sys.argv[2],)));"
        " print(open('/proc/self/status').read())"
    )
    command = [sys.executable, "-c", code, str(path), _SECTORS[0]]
    told = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
    return 1024 * int(told.partition("VmHWM:")[2].split()[0])
