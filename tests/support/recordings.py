"""Messages of each kind, a little traffic, and recordings of it."""

import random
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path

from neurosnap import wire
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.write.writer import Writer

NOW = 1_700_000_000_000_000_000

EACH: dict[str, wire.Message] = {
    "observation": wire.Observation(1, b"\x05\xff", True),
    "wiring": wire.Wiring(3, 2, 1, (4, 6), (9,), (), (2**31 - 1,)),
    "wavestart": wire.WaveStart(1, 1, "signal", 2, 1, (0, 7), 3),
    "pulse": wire.Pulse(1, 7, 4, 1, 3),
    "cellreport": wire.CellReport(1, 3, 0, (6,), (2,), (3, 3, 5), 1),
    "state": wire.State(1, 1, b"\x01\x02\x03", True, 2, 3, 4, 5, 6),
    "reached": wire.Reached(1, 2, (0, 7), b"\x81", 3, 4, 5, 6),
    "decision": wire.Decision(1, -1, 'a "quoted" reason, ünïcode \x00'),
    "keyframe": wire.KeyFrame(1, bytes(range(256))),
    "fault": wire.Fault("cell/3", "what was wrong"),
    "leave": wire.Leave("world"),
    "workerwiring": wire.WorkerWiring(1, 2, 1, bytes(8), bytes(range(16))),
    "pulsebatch": wire.PulseBatch(
        1, 0, 1, 2, bytes(4), b"\x08\0\0\0", b"\1\0\0\0", bytes(4)
    ),
    "anomaly": wire.Anomaly(
        9, 8, (1,), (1, 2), True, 1, (wire.WeighedLink(0, 2, 5, 40.0, since=3),)
    ),
    "workerreport": wire.WorkerReport(1, 1, 0, bytes(8), bytes(8), (1, 4, 9), 7),
    "recall": wire.Recall(9, 2, 1, (4, 7), b"\1\3", bytes(8), (1, 1), 3),
    "recalled": wire.Recalled("cell/3", 9, 2, (), b"\1\x81", bytes(4)),
    "reminder": wire.Reminder("worker/1", 9, 64, (3, 4), b"\1\2", b"\2\1"),
    "band": wire.Band("worker/1", 9, "since", 4, memoryview(bytes(range(8)))),
    "learn": wire.Learn(
        9, b"\1", b"\3", 8, 5, (4,), (1,), (wire.Decision(8, -1, "", 3),)
    ),
    "learned": wire.Learned(
        *(1, 9, 8, 1, 2, b"\4\0\0\0", b"\1\0\0\0", b"\x0c"),
        (wire.WeighedLink(0, 4, 1, 3.0, 0.25, 7),),
    ),
    "image": wire.Image(9, wire.Timestamp(NOW // 10**9, 5), "world", b"\x89P", "png"),
}
"""One message for each topic."""


def delivered(messages: Iterable[wire.Message]) -> Iterator[wire.Delivery]:
    """Give each message its sender's next number, and a time."""
    numbers: Counter[str] = Counter()
    for index, message in enumerate(messages):
        sender = message.sender
        yield wire.Delivery(
            message.key, numbers[sender], NOW + index, wire.encode(message)
        )
        numbers[sender] += 1


def traffic(count: int, seed: int = 0) -> list[wire.Delivery]:
    """Return pulses and reports of a few cells, one observation in 20 messages."""
    draw = random.Random(seed).randrange
    messages: list[wire.Message] = []
    for index in range(count):
        wave = 1 + index // 20
        if index % 20 == 0:
            messages.append(wire.Observation(wave, bytes((draw(256),))))
        elif index % 5 == 0:
            messages.append(
                wire.CellReport(wave, draw(9), 0, (draw(18),), (1,), (2,), 0)
            )
        else:
            messages.append(wire.Pulse(wave, draw(18), draw(18), 1, draw(9)))
    return list(delivered(messages))


def sent_by(deliveries: Iterable[wire.Delivery]) -> dict[str, int]:
    """Return how many messages each sender sent."""
    return dict(Counter(wire.decode(d.key, d.payload).sender for d in deliveries))


def record(
    path: Path,
    deliveries: Iterable[wire.Delivery],
    *,
    every: int = 10**9,
    finish: bool = True,
) -> Completeness | None:
    """Record `deliveries`, a chunk for `every` so many, 1 µs after they were sent."""
    deliveries = list(deliveries)
    with Writer(path) as writer:
        writer.start({"seed": "7", "world": "Test-v0"})
        for index, delivery in enumerate(deliveries, start=1):
            writer.add(delivery, delivery.sent + 1000)
            if index % every == 0:
                writer.flush()
        return writer.finish({"ticks": "3"}, sent_by(deliveries)) if finish else None
