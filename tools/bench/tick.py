"""The row on the coordinator's own share of a tick: learn, wire, count a wave in.

The cells are real ones, without a network: their time is not counted.
"""

import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from neurosnap import wire
from neurosnap.poc.learning.kinds import EmpiricalSnapshot
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.wave_control import WaveControl
from neurosnap.sensorium import pack
from tools.bench.report import Line, Sizes

_STEP = 0.05  # of the side of the square that is walked over
_BEFORE = 3000  # observations after which an order still changes, but little
_REACH = {(0, 1000): 30e-3, (_BEFORE, 1000): 10e-3}  # before and sensors

Bits = NDArray[np.bool_]


@dataclass
class _Seconds:
    """What some ticks took, all together."""

    ticks: int = 0
    changes: int = 0
    reports: int = 0
    learn: float = 0.0
    wire: float = 0.0
    wave: float = 0.0


def tick(sizes: Sizes) -> list[Line]:
    """Time the first ticks of a run, and as many when most of the order is learned."""
    _run(2, 2, 0)  # compiled when the clock starts
    counts = (sizes.cells * share // 10 for share in (1, 3, 10, 30))
    return [
        _line(sensors, before, _run(sensors, sizes.waves, before))
        for sensors in counts
        for before in (0, _BEFORE)
    ]


def _line(sensors: int, before: int, spent: _Seconds) -> Line:
    parts = {
        name: getattr(spent, name) / spent.ticks for name in ("learn", "wire", "wave")
    }
    whole = sum(parts.values())
    split = " + ".join(f"{name} {_ms(part)}" for name, part in parts.items())
    reach = _REACH.get((before, sensors))
    phase = f"after {before:,}" if before else "the first"
    return Line(
        f"coordinator, a tick, {sensors:,} sensors, {phase}"
        f" ({spent.changes} of {spent.ticks} rewire)",
        f"{_ms(whole)} ms: {split}",
        "",
        "" if reach is None else f"≤ {1e3 * reach:.0f} ms",
        None if reach is None else whole <= reach,
        parts
        | {
            "seconds": whole,
            "rewired": spent.changes / spent.ticks,
            "reports": spent.reports / spent.ticks,
        },
    )


def _run(sensors: int, ticks: int, before: int) -> _Seconds:
    """Let a network take `ticks` observations, after `before` that are only learned."""
    walk = _walk(sensors)
    snapshot = EmpiricalSnapshot(sensors)
    control = WaveControl(sensors)
    cells = [Cell(number) for number in range(sensors)]
    for _ in range(before):
        snapshot.learn(next(walk))
    if before:
        _deliver(control.rewire(snapshot.poc_graph().wire_list()), cells)
    spent = _Seconds(ticks)
    for number in range(1, ticks + 1):
        bits = next(walk)
        began = time.perf_counter()
        changed = snapshot.learn(bits)
        learned = time.perf_counter()
        messages: list[wire.Message] = []
        graph = snapshot.poc_graph()
        if changed:
            messages = control.rewire(graph.wire_list())
        graph.height()
        graph.wire_count()
        done = time.perf_counter()
        spent.learn += learned - began
        spent.wire += done - learned
        spent.changes += changed
        _deliver([*messages, wire.Observation(number, pack(bits))], cells)
        _wave(number, control, cells, spent)
    return spent


def _wave(
    number: int, control: WaveControl, cells: list[Cell], spent: _Seconds
) -> None:
    """Let a state wave run; count the coordinator's time for it."""
    began = time.perf_counter()
    sent = control.start("state", number)
    spent.wave += time.perf_counter() - began
    while sent:
        answers = _deliver(sent, cells)
        reports = [each for each in answers if isinstance(each, wire.CellReport)]
        sent = [each for each in answers if isinstance(each, wire.Pulse)]
        began = time.perf_counter()
        for report in reports:
            control.report(report)
        spent.wave += time.perf_counter() - began
        spent.reports += len(reports)
    if control.in_flight:
        raise RuntimeError(f"wave {number}: must settle once no pulse is left")


def _deliver(messages: list[wire.Message], cells: list[Cell]) -> list[wire.Message]:
    """Give every cell what is for it, in one burst; return what the cells answer."""
    bursts: dict[int, list[wire.Message]] = defaultdict(list)
    for message in messages:
        match message:
            case wire.Pulse():
                bursts[message.target >> 1].append(message)
            case wire.Wiring():
                bursts[message.cell].append(message)
            case _:
                for cell in cells:
                    bursts[cell.cell].append(message)
    return [
        answer for number in bursts for answer in cells[number].receive(bursts[number])
    ]


def _walk(sensors: int) -> Iterator[Bits]:
    """Yield what discs in a square see of a random walk: no two of them are alike."""
    rng = np.random.default_rng(7)
    centre = rng.random((sensors, 2))
    radius = rng.uniform(0.05, 0.45, sensors)
    place = rng.random(2)
    while True:
        place = np.clip(place + rng.normal(scale=_STEP, size=2), 0, 1)
        yield ((centre - place) ** 2).sum(axis=1) < radius**2


def _ms(seconds: float) -> str:
    """Return a time as a number of milliseconds."""
    return f"{1e3 * seconds:.2f}" if seconds < 1e-2 else f"{1e3 * seconds:.1f}"
