"""Measures a tick of process cells, beside bare Zenoh that exchanges as much."""

import statistics
import tempfile
from collections import defaultdict
from itertools import pairwise
from pathlib import Path

from msgspec.structs import replace

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.child_processes import allow_files
from neurosnap.runtime.request import Watcher
from tools.bench.exchange import CellWave, Plan
from tools.bench.report import Line, Sizes, ratio_of_pairs
from tools.bench.run import line_options, run_once
from tools.bench.scale import Spent
from tools.bench.swarm import run_bare

_PARTS = ("cell", "hub", "coordinator", "recorder", "world")
_BESIDE = 16  # bytes that travel beside a message
_READINGS = 20_000
_MOST, _MANY, _OF_MANY = 2.0, 300, 2.5  # times bare Zenoh; with more cells than that


def tick(sizes: Sizes) -> list[Line]:
    """Time a recorded tick with each number of cells, in turns with bare Zenoh."""
    allow_files(max(sizes.swarms) + 10)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        return [_line(count, sizes, Path(folder)) for count in sizes.swarms]


def _line(count: int, sizes: Sizes, folder: Path) -> Line:
    ticks = max(20, min(sizes.ticks, _READINGS // count))
    options = replace(line_options(count, ticks, folder), cells="process")
    ours, theirs = list[dict[str, float]](), list[dict[str, float]]()
    for turn in range(sizes.pairs):
        log = folder / f"{count}-{turn}.mcap"
        # Looked at twice alone: to look takes time, too.
        spent = Spent(ticks // 4, ticks // 2)
        run_once(options, log, Watcher(spent.look))
        seconds, plan = _recorded(log, count, ticks)
        ours.append({"seconds": seconds} | spent.a_tick(ticks // 2))
        theirs.append(run_bare(module="exchange", plan=plan))
    best, bare = (min(each, key=lambda one: one["seconds"]) for each in (ours, theirs))
    ratio = best["seconds"] / bare["seconds"]
    pairs = ([each["seconds"] for each in some] for some in (ours, theirs))
    most = _MOST if count <= _MANY else _OF_MANY
    return Line(
        f"a tick of {count:,} cells, a process each, recorded",
        f"{best['seconds'] * 1e3:.1f} ms ({ratio:.2f} ×); {_shares(best)}",
        f"bare {bare['seconds'] * 1e3:.1f} ms; {_shares(bare)}",
        f"≤ {most:g} ×",
        ratio <= most,
        {
            "ratio": ratio,
            "ratio_of_pairs": ratio_of_pairs(*pairs),
            **best,
            **{f"bare_{name}": figure for name, figure in bare.items()},
        },
    )


def _shares(figures: dict[str, float]) -> str:
    parts = (f"{part} {figures[part] * 1e3:.1f}" for part in _PARTS)
    return f"processor {', '.join(parts)} ms"


def _recorded(log: Path, count: int, ticks: int) -> tuple[float, Plan]:
    """Return the median seconds of a run's later ticks, and what one of them sends."""
    decided, bytes_of = list[int](), defaultdict[str, list[int]](list)
    of_wave = defaultdict[int, list[wire.Pulse | wire.CellReport]](list)
    waves = set[int]()
    for recorded in Recording.open(log).messages():
        message = recorded.message
        bytes_of[wire.topic(message.key)].append(len(recorded.payload) + _BESIDE)
        if isinstance(message, wire.Decision):
            decided.append(recorded.sent)
        elif isinstance(message, wire.WaveStart) and message.tick == ticks - 1:
            waves.add(message.wave)
        elif isinstance(message, wire.Pulse | wire.CellReport):
            of_wave[message.wave].append(message)
    cells = [[_nothing() for _ in waves] for _ in range(count)]
    for place, wave in enumerate(sorted(waves)):
        for message in of_wave[wave]:
            if isinstance(message, wire.Pulse):
                source, target = message.source, message.target
                cells[source >> 1][place].targets[source & 1].append(target)
                cells[target >> 1][place].pulses += 1
                continue
            own = cells[message.cell][place]
            own.reports += 1
            both = zip(message.literals, message.hops, strict=True)
            own.seeds += [literal & 1 for literal, hops in both if not hops]
    later = [b - a for a, b in pairwise(decided)][ticks // 4 :]
    sizes = {topic: round(statistics.fmean(some)) for topic, some in bytes_of.items()}
    return statistics.median(later) / 1e9, Plan(ticks, sizes, cells)


def _nothing() -> CellWave:
    return CellWave([], ([], []), 0, 0)
