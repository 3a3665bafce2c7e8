"""Measures how fast messages of other programs become a table of readings."""

import json
import random
import struct
import tempfile
import time
from pathlib import Path

from mcap.writer import Writer

from neurosnap.sources.open_readings import open_readings
from tools.bench.report import Line, Sizes

_ENCODINGS = {"json": "JSON", "cdr": "CDR of ROS 2"}
_TOPICS = 20
_FAST = 50_000  # messages a second


def messages(sizes: Sizes) -> list[Line]:
    """Time what `neurosnap learn` reads of a file, both its passes."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        return [
            _line(kind, 100 * sizes.ticks, sizes, Path(folder)) for kind in _ENCODINGS
        ]


def _line(kind: str, count: int, sizes: Sizes, folder: Path) -> Line:
    path, taken, sensors = folder / f"{kind}.mcap", [], 0
    _write(path, kind, count)
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


def _write(path: Path, kind: str, count: int) -> None:
    """Write numbers that wander, each topic ten times a second."""
    draw, at = random.Random(1), [0.0] * _TOPICS
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema(
            "std_msgs/msg/Float64", "ros2msg", b"float64 data"
        )
        channels = [
            writer.register_channel(f"/number_{topic}", kind, schema)
            for topic in range(_TOPICS)
        ]
        for number in range(count):
            topic = number % _TOPICS
            at[topic] += draw.uniform(-1, 1)
            data = b"\0\1\0\0" + struct.pack("<d", at[topic])
            if kind == "json":
                data = json.dumps({"data": at[topic]}).encode()
            moment = 10**9 + number * 10**8 // _TOPICS
            writer.add_message(channels[topic], moment, data, moment)
        writer.finish()
