"""Rows on cells in workers: how many come up, how fast waves are, what a tick takes."""

import multiprocessing
import os
import statistics
from typing import TYPE_CHECKING

from msgspec.structs import replace

from neurosnap.depth.probe import ProbePlan
from neurosnap.runtime.supervisor import allow_files
from tools.bench.bare import mean_pss
from tools.bench.probe import probe, rows_of, weighed_while_up
from tools.bench.report import Line, Sizes
from tools.bench.run import path_options, run_once

if TYPE_CHECKING:
    from neurosnap.protocol.run_options import CellKind

_WORKERS, _HEIGHT = 2, 20
_SPAWN, _MEMORY, _WAVE = 30.0, 4.0, 2.0
_GB = 1e9


def worker(sizes: Sizes) -> list[Line]:
    """Measure a hundred times as many cells as have a process each elsewhere."""
    # The fork server keeps the limit it started with.
    allow_files(2 * sizes.cells + 10)
    return [*_large(sizes), _processes(sizes), _run(sizes)]


def _large(sizes: Sizes) -> list[Line]:
    """Time coming up, and waves through all cells; sum the memory of all processes."""
    cells, edges = 100 * sizes.cells, 1000 * sizes.cells
    plan = ProbePlan(
        cells, (_HEIGHT,), "hasse", sizes.waves, workers=_WORKERS, edges=edges
    )
    ready, memory = weighed_while_up(plan, _pss_of_all)
    rows = rows_of(probe(plan))
    seconds = [row.seconds for row in rows]
    middle, worst = statistics.median(seconds), max(seconds)
    return [
        Line(
            f"{cells:,} cells in {_WORKERS} workers, wired, the first waves passed",
            f"{ready:.1f} s, {memory / _GB:.2f} GB in all (PSS)",
            "",
            f"≤ {_SPAWN:g} s, ≤ {_MEMORY:g} GB",
            ready <= _SPAWN and memory <= _MEMORY * _GB,
            {"seconds": ready, "pss": memory},
        ),
        Line(
            f"a wave that fires all {cells:,}, {edges:,} edges, height {_HEIGHT}",
            f"{middle * 1e3:.0f} ms (worst of {len(seconds)}: {worst * 1e3:.0f} ms),"
            f" {rows[0].pulses:,} pulses, {rows[0].depth} hops",
            "",
            f"≤ {_WAVE:g} s",
            worst <= _WAVE,
            {"seconds": middle, "worst": worst, "pulses": rows[0].pulses},
        ),
    ]


def _pss_of_all() -> float:
    pids = [child.pid for child in multiprocessing.active_children() if child.pid]
    return mean_pss([os.getpid(), *pids]) * (1 + len(pids))


def _processes(sizes: Sizes) -> Line:
    """Time until twice the cells of the spawn row have passed a wave as processes."""
    cells = 2 * sizes.cells
    plan = ProbePlan(cells, (_HEIGHT,), "hasse", waves=1, warmup=0)
    seconds = probe(plan).seconds
    return Line(
        f"{cells:,} cells, a process each, up and passed a wave",
        f"{seconds:.1f} s",
        figures={"seconds": seconds},
    )


def _run(sizes: Sizes) -> Line:
    """Time a tick of the same run with cells in processes and in workers, in turns."""
    ours: list[float] = []
    theirs: list[float] = []
    found: set[tuple[int, int]] = set()
    kinds: list[tuple[CellKind, list[float]]] = [("worker", ours), ("process", theirs)]
    options = replace(path_options(sizes.ticks), workers=_WORKERS)
    for _ in range(sizes.pairs):
        for cells, spent in kinds:
            outcome = run_once(replace(options, cells=cells))
            spent.append(outcome.seconds / outcome.totals.ticks)
            found.add((outcome.totals.pulses, outcome.totals.edges))
    ratio = min(theirs) / min(ours)
    same = len(found) == 1
    return Line(
        f"a tick with cells in {_WORKERS} workers, {sizes.ticks} ticks",
        f"{min(ours) * 1e3:.1f} ms ({ratio:.1f} × as fast),"
        f" {'the same' if same else 'NOT the same'} pulses and order",
        f"a process each {min(theirs) * 1e3:.1f} ms",
        "the same",
        same,
        {"seconds": min(ours), "process_seconds": min(theirs), "ratio": ratio},
    )
