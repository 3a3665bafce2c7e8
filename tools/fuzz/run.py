"""The valid run that hostile input is made from and compared with.

A small swarm in memory, a function of nothing: each run says the same in the same
order, and its recording has the same bytes.
"""

import functools
import io
import random
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec
from google.protobuf.descriptor_pb2 import FieldDescriptorProto
from mcap.writer import Writer as Mcap
from mcap_protobuf.schema import register_schema

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.fabric.in_memory import matches
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.write.writer import Writer
from neurosnap.sources.ros2.message_types import stock_types
from tests.support.inline_runs import recorded_run

SENSORS = 4
"""Sensors of the run, and so its cells."""
_FLOAT = "std_msgs/msg/Float32"
WORKERS = 2
"""Workers of a run in which they share its cells and the learning."""


@dataclass(frozen=True)
class Honest:
    """A small run without any meddling: its options, its recording, its messages."""

    options: RunOptions
    log: Path
    """Where it was recorded."""
    recording: bytes
    """What was recorded, the same each time: no clock, no random id in it."""
    deliveries: list[wire.Delivery]

    def heard_by(self, keys: Sequence[str]) -> list[wire.Message]:
        """Return all that came under `keys`, in order."""
        return [
            wire.decode(one.key, one.payload)
            for one in self.deliveries
            if any(matches(key, one.key) for key in keys)
        ]


def honest_run(folder: Path, workers: int = 0, ticks: int = 12) -> Honest:
    """Run a swarm in memory on a few readings, and read back what it said.

    Args:
        folder: Where its files go.
        workers: How many share the cells; 0: every cell is a part of its own.
        ticks: How many it has.
    """
    chance = random.Random(0)
    names = tuple(f"s{sensor}" for sensor in range(SENSORS))
    rows = [",".join(names)]
    for _ in range(ticks):
        bits = [chance.random() < 0.5 for _ in names]
        bits[1] |= bits[0]
        rows.append(",".join(str(int(bit)) for bit in bits))
    source, log = folder / "readings.csv", folder / f"honest-{workers}.mcap"
    source.write_text("\n".join(rows) + "\n")
    options = RunOptions(
        source=str(source),
        body=Body(own=names, actions=()),
        ticks=ticks,
        threshold=0.2,
        cells="worker" if workers else "process",
        workers=max(workers, 1),
        keyframe_every=5,
    )
    recorded_run(options, log)
    deliveries = [recorded.delivery for recorded in Recording.open(log).messages()]
    again = folder / f"again-{workers}.mcap"
    with Writer(again, chunk=4096) as writer:
        writer.start({"swarm": "fuzz"})
        for time_, delivery in enumerate(deliveries):
            writer.add(delivery._replace(sent=time_), time_)
        writer.finish({"ticks": str(ticks)}, {})
    return Honest(options, log, again.read_bytes(), deliveries)


@functools.cache
def honest_bag() -> bytes:
    """Return a bag of another program: JSON, CDR of ROS 2 and Protocol Buffers."""
    file, types = io.BytesIO(), stock_types()
    writer = Mcap(file)
    writer.start()
    text, _ = types.generate_msgdef(_FLOAT)
    schema = writer.register_schema(_FLOAT, "ros2msg", text.encode())
    cdr = writer.register_channel("/cdr", "cdr", schema)
    schema = register_schema(writer, FieldDescriptorProto)
    proto = writer.register_channel("/proto", "protobuf", schema)
    plain = writer.register_channel("/json", "json", 0)
    number = types.types[_FLOAT]
    for at in range(10**9, 40 * 10**9, 10**9):
        said = {"v": at % 7, "mode": "ab"[at % 2], "list": [at, None, {"deep": True}]}
        for channel, data in (
            (plain, msgspec.json.encode(said)),
            (cdr, bytes(types.serialize_cdr(number(at % 5), _FLOAT))),
            (proto, FieldDescriptorProto(number=at % 11).SerializeToString()),
        ):
            writer.add_message(channel, at, data, at)
    writer.finish()
    return file.getvalue()
