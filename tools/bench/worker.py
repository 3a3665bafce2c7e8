"""Rows on cells in workers: how many come up, and how fast waves are."""

import multiprocessing
import os
import statistics

from neurosnap.depth.probe import ProbePlan
from neurosnap.runtime.starting.child_processes import allow_files
from tools.bench.bare import mean_pss
from tools.bench.probe import probe, rows_of, weighed_while_up
from tools.bench.report import Line, Sizes

_WORKERS, _HEIGHT = 2, 20
_SPAWN, _MEMORY, _WAVE = 30.0, 4.0, 2.0
_GB = 1e9


def worker(sizes: Sizes) -> list[Line]:
    """Measure a hundred times as many cells as have a process each elsewhere."""
    # The fork server keeps the limit it started with.
    allow_files(2 * sizes.cells + 10)
    return [*_large(sizes), _processes(sizes)]


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
