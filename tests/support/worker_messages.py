"""The second of three workers over nine sensors, and messages sent to it.

Its cells are 3 to 5, its literals 6 to 11.
"""

from collections.abc import Iterable

from neurosnap import wire
from neurosnap.protocol.worker import Worker
from neurosnap.protocol.worker_shares import shares
from neurosnap.sensorium import pack
from tests.support.wave_messages import packed

SENSORS, WORKERS, ME = 9, 3, 1


HOSTED = shares(SENSORS, WORKERS)


Edges = Iterable[tuple[int, int]]


def edges(pairs: Edges) -> bytes:
    return packed(*(literal for pair in sorted(pairs) for literal in pair))


def wired(*pairs: tuple[int, int]) -> Worker:
    """Return the worker under test with out-edges."""
    worker = Worker(ME, HOSTED)
    assert worker.receive([wire.WorkerWiring(ME, 1, 0, edges(pairs))]) == []
    return worker


def batch(
    *pulses: tuple[int, int, int, int], wave: int = 1, worker: int = 0, part: int = 0
) -> wire.PulseBatch:
    """Return pulses to the worker under test: source, target, hops, credit each."""
    fields = [packed(*field) for field in zip(*pulses, strict=True)]
    return wire.PulseBatch(wave, worker, ME, part, *fields)


def observation(tick: int, *on: int) -> wire.Message:
    return wire.Observation(tick, pack([cell in on for cell in range(SENSORS)]))


def pulses_in(message: wire.PulseBatch) -> list[tuple[int, int, int, int]]:
    fields = (message.sources, message.targets, message.hops, message.credit)
    columns = [wire.numbers("field", field) for field in fields]
    return list(zip(*columns, strict=True))


def fired_in(report: wire.WorkerReport) -> dict[int, int]:
    return dict(zip(*wire.fired(report), strict=True))


def fired_by(worker: Worker, *messages: wire.Message) -> dict[int, int]:
    """Return what fires by messages for which a worker sends one report alone."""
    (report,) = worker.receive(messages)
    assert isinstance(report, wire.WorkerReport)
    return fired_in(report)
