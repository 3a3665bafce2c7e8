"""The row on state waves: cells that are processes, against processes of bare Zenoh."""

import statistics
import tempfile
from pathlib import Path

from neurosnap import wire
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.starting.child_processes import allow_files
from tools.bench.kinds import line_options
from tools.bench.report import Line, Sizes, ratio_of_pairs
from tools.bench.run import run_once
from tools.bench.swarm import run_bare

_REACH = 2.0


def wave(sizes: Sizes) -> list[Line]:
    """Time state waves of recorded runs, and bare ones of as many pulses a cell."""
    allow_files(2 * max(sizes.waved) + 10)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        return [_line(count, sizes, Path(folder)) for count in sizes.waved]


def _line(count: int, sizes: Sizes, folder: Path) -> Line:
    ticks = max(10, min(sizes.ticks, 10_000 // count))
    options = line_options(count, ticks, folder)
    ours: list[float] = []
    theirs: list[float] = []
    pulses = 0.0
    for turn in range(sizes.pairs):
        log = folder / f"{count}-{turn}.mcap"
        run_once(options, log)
        seconds, pulses = _state_waves(log)
        ours.append(seconds)
        a_cell = max(1, round(pulses / count))
        found = run_bare("wave", count, sizes.waves, "--pulses", a_cell)
        theirs.append(found["wave"])
    ratio = min(ours) / min(theirs)
    return Line(
        f"a state wave, {count:,} cells, a process each, {pulses:,.0f} pulses",
        f"{min(ours) * 1e3:.1f} ms ({ratio:.2f} ×)",
        f"bare Zenoh {min(theirs) * 1e3:.1f} ms",
        f"≤ {_REACH:g} ×",
        ratio <= _REACH,
        {
            "seconds": min(ours),
            "bare_seconds": min(theirs),
            "ratio": ratio,
            "ratio_of_pairs": ratio_of_pairs(ours, theirs),
            "pulses": pulses,
        },
    )


def _state_waves(log: Path) -> tuple[float, float]:
    """Return the median seconds and pulses of the later half of a run's state waves."""
    began: dict[int, int] = {}
    found: list[tuple[float, int]] = []
    for each in Recording.open(log).messages(("wave", "state")):
        match each.message:
            case wire.WaveStart(kind="state", wave=number):
                began[number] = each.sent
            case wire.State(wave=number, pulses=pulses):
                found.append(((each.sent - began[number]) / 1e9, pulses))
            case _:
                pass
    later = found[len(found) // 2 :]
    seconds, pulses_of = zip(*later, strict=True)
    return statistics.median(seconds), statistics.median(pulses_of)
