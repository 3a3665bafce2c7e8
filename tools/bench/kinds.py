"""The row on kinds of cells: ticks a second of the same recorded run with each."""

import tempfile
from pathlib import Path

import numpy as np
from msgspec.structs import replace

from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.runtime.fit_agent import body_of
from neurosnap.sources.open import open_source
from tools.bench.report import Line, Sizes
from tools.bench.run import run_once

_WORKERS = 2
_KINDS: tuple[CellKind, ...] = ("process", "worker", "inline")


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


def line_options(count: int, ticks: int, folder: Path) -> RunOptions:
    """Return a run of a walker on a line, whose readings are written there."""
    rng, places, at = np.random.default_rng(1), np.arange(count), count // 2
    rows = [",".join(f"x{place}" for place in places)]
    for _ in range(ticks):
        at = int(np.clip(at + rng.integers(-1, 2), 0, count))
        rows.append(",".join(map(str, (places < at).astype(int).tolist())))
    path = folder / f"{count}.csv"
    path.write_text("\n".join(rows) + "\n")
    source = open_source(str(path), 0)
    source.close()
    body = body_of(source, "walker")
    return RunOptions(source=str(path), body=body, ticks=ticks, workers=_WORKERS)
