"""Measures whole runs: the cost of recording, verifying and each kind of cell."""

import asyncio
import tempfile
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.recording.replay.verify import verify as check
from neurosnap.runtime.request import SILENT, Outcome, RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import run
from neurosnap.system.compiled import interpreted
from tests.support.run_options import options_for
from tests.support.sources import written
from tools.bench.report import Line, Sizes, ratio_of_pairs

_SOURCE = "neurosnap/Path-v0"
_RECORDING, _VERIFY = 1.15, 10.0
_WORKERS = 2
_KINDS: tuple[CellKind, ...] = ("process", "worker", "inline")


def recording(sizes: Sizes) -> list[Line]:
    """Time a tick with the recorder on and off, in turns."""
    options = options_for(_SOURCE, 0, ticks=sizes.ticks)
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        run_once(options_for(_SOURCE, 0, ticks=5))
        off, on, whole, messages = [], [], True, 0
        for turn in range(sizes.pairs):
            off.append(run_once(options).seconds)
            recorded = run_once(options, Path(folder) / f"{turn}.mcap")
            on.append(recorded.seconds)
            if recorded.completeness is None:
                raise RuntimeError("recording: must have a balance")
            whole &= recorded.completeness.whole
            messages = recorded.completeness.messages
    ratio = min(on) / min(off)
    tick, bare = min(on) / sizes.ticks, min(off) / sizes.ticks
    return [
        Line(
            f"a tick, recorded ({len(options.sensors)} sensors, {sizes.ticks} ticks)",
            f"{tick * 1e3:.1f} ms ({ratio:.2f} ×), {messages:,} messages,"
            f" {'whole' if whole else 'NOT whole'}",
            f"not recorded {bare * 1e3:.1f} ms",
            f"≤ {_RECORDING:g} ×, whole",
            ratio <= _RECORDING and whole,
            {
                "seconds": tick,
                "bare_seconds": bare,
                "ratio": ratio,
                "ratio_of_pairs": ratio_of_pairs(on, off),
                "messages": messages,
                "whole": whole,
            },
        )
    ]


def verify(sizes: Sizes) -> list[Line]:
    """Time `verify` against the run whose recording it checks."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        log = Path(folder) / "run.mcap"
        made = run_once(options_for(_SOURCE, 0, ticks=sizes.ticks), log)
        with interpreted(0.0):  # as it is once it was compiled
            verdicts = [check(log) for _ in range(sizes.pairs + 1)][1:]
    best = min(verdict.seconds for verdict in verdicts)
    ticks, same = verdicts[0].ticks, all(verdict.same for verdict in verdicts)
    speed = made.seconds / made.totals.ticks / (best / ticks)
    return [
        Line(
            f"verify of {ticks} ticks",
            f"{ticks / best:,.0f} ticks/s ({speed:.0f} ×),"
            f" {'same' if same else 'NOT the same'}",
            f"the run {made.totals.ticks / made.seconds:,.0f} ticks/s",
            f"≥ {_VERIFY:g} ×, same",
            speed >= _VERIFY and same,
            {
                "seconds": best,
                "run_seconds": made.seconds,
                "ticks": ticks,
                "speed": speed,
                "same": same,
            },
        )
    ]


def kinds(sizes: Sizes) -> list[Line]:
    """Run a walker on a line with each kind of cells, in turns."""
    with tempfile.TemporaryDirectory(prefix="bench-") as folder:
        return [_line(count, sizes, Path(folder)) for count in sizes.lines]


def _line(count: int, sizes: Sizes, folder: Path) -> Line:
    options = line_options(count, max(10, min(sizes.ticks, 20_000 // count)), folder)
    best: dict[CellKind, float] = {}
    found = set()
    for turn in range(sizes.pairs):
        for kind in _KINDS:
            log = folder / f"{count}-{kind}-{turn}.mcap"
            outcome = run_once(replace(options, cells=kind), log)
            pace = outcome.totals.ticks / outcome.seconds
            best[kind] = max(pace, best.get(kind, 0.0))
            found.add((outcome.totals.incoherent, *outcome.implications))
    ahead, same = best["inline"] / best["worker"], len(found) == 1
    return Line(
        f"{count:,} sensors of a CSV file, recorded: ticks a second"
        f" (of {options.ticks})",
        f"inline {best['inline']:,.0f}",
        f"{_WORKERS} workers {best['worker']:,.0f}, a process each"
        f" {best['process']:,.1f};"
        f" {'the same' if same else 'NOT the same'} order",
        "inline ≥ workers, the same",
        ahead >= 1 and same,
        {f"{kind}_pace": pace for kind, pace in best.items()} | {"ahead": ahead},
    )


def line_options(
    count: int, ticks: int, folder: Path, walkers: int = 1, wrong: int = 0
) -> RunOptions:
    """Return a run of walkers on lines, whose readings are written there.

    Args:
        count: Sensors, which the walkers share: each is on while one is below a place.
        ticks: Of the run.
        folder: Where the readings go.
        walkers: How many there are, each on a line of its own.
        wrong: How many bits of each row are flipped, or fewer.
    """
    rng, places = np.random.default_rng(1), np.arange(count) // walkers
    last = count // walkers
    at = np.full(walkers, last // 2)
    rows = [",".join(f"w{k % walkers}_below_{k // walkers}" for k in range(count))]
    for _ in range(ticks):
        at = np.clip(at + rng.integers(-1, 2, walkers), 0, last)
        below = np.resize(at, count) < places
        below[rng.integers(0, count, wrong)] ^= True
        rows.append(",".join(map(str, below.astype(int).tolist())))
    path = written(folder, "\n".join(rows) + "\n", f"{count}.csv")
    return options_for(str(path), 0, ticks=ticks, workers=_WORKERS)


def run_once(
    options: RunOptions, log: Path | None = None, watcher: Watcher = SILENT
) -> Outcome:
    """Make a run, recorded if a file is named."""

    async def once() -> Outcome:
        return await run(RunRequest(options, log), asyncio.Event(), watcher)

    return asyncio.run(once())
