"""Exchanges the messages of a recorded tick between bare Zenoh processes.

A program of its own, like `tools.bench.bare`: reads a `Plan` as JSON, prints one JSON
object. As many processes send as many messages of the same sizes to the same others,
each once what it follows from has come. Callbacks put straight on, and decode nothing.
"""

import json
import signal
import struct
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING

import zenoh

from tools.bench import bare

if TYPE_CHECKING:
    import psutil

_HEAD = struct.Struct("<HH")  # the wave within its tick; which literal of the cell
_POLL = 0.02  # seconds, as the recorder's
Put = Callable[..., None]


@dataclass
class CellWave:
    """What one cell does in one wave of a tick."""

    seeds: list[int]
    """Which of its two literals, 0 or 1, fire at the start."""
    targets: tuple[list[int], list[int]]
    """The literals that each of the two sends a pulse."""
    pulses: int
    """That come to it."""
    reports: int
    """That it sends."""


@dataclass
class Plan:
    """What is exchanged in a tick."""

    ticks: int
    """How often."""
    sizes: dict[str, int]
    """Bytes of a message by topic, with what travels beside it."""
    cells: list[list[CellWave]]
    """For each cell what it does in each wave. The first wave goes to all of them."""


def main() -> None:
    """Exchange what the plan on standard input says; print what a tick took."""
    said = json.load(sys.stdin)
    cells = [[CellWave(**wave) for wave in waves] for waves in said.pop("cells")]
    plan = Plan(cells=cells, **said)
    with bare.hub_for(len(plan.cells) + 3, __name__) as (config, _):
        print(json.dumps(_measure(config, plan)))


def _measure(config: str, plan: Plan) -> dict[str, float]:
    """Return the median seconds a tick, and the processor seconds of each part."""
    import psutil

    up, say_up = bare.context.Pipe(duplex=False)
    line, line_end = bare.context.Pipe()
    parts = {"hub": [psutil.Process()]}
    for name, work, each in (
        ("recorder", _record, [()]),
        ("world", _observe, [(plan.sizes,)]),
        ("coordinator", _coordinate, [(plan, line_end)]),
        ("cell", _compute, [(k, plan.sizes, own) for k, own in enumerate(plan.cells)]),
    ):
        started = [bare.start(work, config, say_up, *given) for given in each]
        parts[name] = [psutil.Process(one.pid) for one in started]
    bare.await_words(up, len(plan.cells) + 3)
    before = {name: _spent(some) for name, some in parts.items()}
    line.send_bytes(b"go")
    took = json.loads(bare.await_words(line, 1))
    spent = {n: (_spent(some) - before[n]) / len(took) for n, some in parts.items()}
    return {"seconds": sorted(took)[len(took) // 2], **spent}


def _spent(processes: Iterable["psutil.Process"]) -> float:
    return sum(sum(each.cpu_times()[:2]) for each in processes)


def _record(config: str, say_up: Connection) -> None:
    """Take in everything, every so often."""
    session = bare.join(config)
    channel = session.declare_subscriber("**", zenoh.handlers.FifoChannel(1 << 20))
    say_up.send_bytes(b"1")
    while True:
        while (sample := channel.try_recv()) is not None:
            sample.payload.to_bytes()
        time.sleep(_POLL)


def _observe(config: str, say_up: Connection, sizes: dict[str, int]) -> None:
    """Answer each decision with an observation."""
    session = bare.join(config)
    put = _putter(session, sizes)
    bare.listen(session, lambda _, __: put("observation"), "decision")
    say_up.send_bytes(b"1")
    signal.pause()


def _putter(session: zenoh.Session, sizes: dict[str, int]) -> Put:
    """Return what puts a message of its topic's size on a key."""

    def put(key: str, head: bytes = b"") -> None:
        data = head.ljust(sizes[key.partition("/")[0]])
        session.put(key, data, congestion_control=bare.BLOCK)

    return put


def _coordinate(config: str, say_up: Connection, plan: Plan, line: Connection) -> None:
    """Start the waves of each tick, each once all reports on the last have come."""
    session, times, now, left = bare.join(config), list[float](), 0, 0
    put, waves = _putter(session, plan.sizes), [*zip(*plan.cells, strict=True)]

    def begin(wave: int) -> None:
        nonlocal now, left
        now, left = wave, sum(cell.reports for cell in waves[wave])
        if not wave:
            put("wavestart", _HEAD.pack(0, 0))
            return
        for number, cell in enumerate(waves[wave]):
            if cell.seeds:
                put(f"wavestart/{number}", _HEAD.pack(wave, 0))

    def take(key: str, _: bytes) -> None:
        nonlocal left
        left -= key != "observation"
        if key == "observation":
            begin(0)
        elif not left:
            put("reached" if now else "state")
            if now + 1 < len(waves):
                begin(now + 1)
                return
            times.append(time.perf_counter())
            put("decision")
            if len(times) == bare.WARMUP + plan.ticks:
                took = [b - a for a, b in pairwise(times[bare.WARMUP :])]
                line.send_bytes(json.dumps(took).encode())

    bare.listen(session, take, "observation", "cellreport/*")
    say_up.send_bytes(b"1")
    line.recv_bytes()
    put("decision")
    signal.pause()


def _compute(
    config: str,
    say_up: Connection,
    number: int,
    sizes: dict[str, int],
    waves: list[CellWave],
) -> None:
    """Fire what starts and what is pulsed, each literal once a wave; report."""
    session = bare.join(config)
    to = {one >> 1 for wave in waves for some in wave.targets for one in some}
    keys = {"": f"cellreport/{number}"} | {k: f"pulse/{k}/{number}" for k in to}
    puts = dict[int | str, Put]()
    report = bytes(sizes["cellreport"])
    heard, sent = [0] * len(waves), [0] * len(waves)
    fired = [set[int]() for _ in waves]

    def fire(wave: int, literal: int) -> None:
        if literal in fired[wave]:
            return
        fired[wave].add(literal)
        for one in waves[wave].targets[literal]:
            puts[one >> 1](_HEAD.pack(wave, one & 1).ljust(sizes["pulse"]))

    def take(key: str, data: bytes) -> None:
        if key == "observation":
            return
        wave, literal = _HEAD.unpack_from(data)
        own, is_pulse = waves[wave], key.startswith("pulse")
        before = len(fired[wave])
        heard[wave] += 1
        for one in [literal] if is_pulse else own.seeds:
            fire(wave, one)
        is_last = heard[wave] == own.pulses + bool(own.seeds)
        count = own.reports - sent[wave] if is_last else len(fired[wave]) > before
        for _ in range(min(count, own.reports - sent[wave] - (not is_last))):
            puts[""](report)
            sent[wave] += 1
        if is_last:
            heard[wave] = sent[wave] = 0
            fired[wave].clear()

    own = f"wavestart/{number}", f"pulse/{number}/*"
    bare.listen(session, take, "observation", "wavestart", *own)
    # Only then: the hub takes in order what a session declares.
    for whom, key in keys.items():
        onward = session.declare_publisher(key, congestion_control=bare.BLOCK)
        bare.await_listener(onward)
        puts[whom] = onward.put
    say_up.send_bytes(b"1")
    signal.pause()
