"""Measures a swarm: its start, and the time per hop."""

import asyncio
import json
import multiprocessing
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import msgspec

from neurosnap.depth.probe import Measured, ProbeJob, Sweep
from neurosnap.runtime.child_processes import allow_files
from neurosnap.runtime.launch import Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher
from tools.bench.bare import mean_pss
from tools.bench.report import Line, Sizes, ratio_of_pairs

_ROOT = Path(__file__).parents[2]
_SPAWN, _MEMORY, _HOP = 1.5, 6.0, 2.0
_MB = 1e6
_BEGIN = 0.01  # seconds
_ENDLESS = 10**9  # waves: the swarm is stopped when its memory is measured


def spawn(sizes: Sizes) -> list[Line]:
    """Time from starting the hub until every cell is up and wired.

    A wave along a chain through all cells proves that they are; what the wave itself
    takes is told apart, since the bare processes pass none.
    """
    allow_files(sizes.cells + 10)  # the fork server keeps the limit it started with
    probe(Sweep(sensors=(2,), heights=(1,), waves=1))
    height = sizes.cells - 1
    plan = Sweep(sensors=(sizes.cells,), heights=(height,), waves=1, warmup=0)
    theirs, ours, waves = [], [], []
    for _ in range(sizes.pairs):
        theirs.append(run_bare("spawn", sizes.cells)["seconds"])
        seconds, (wave,) = probe(plan)
        waves.append(wave.seconds)
        ours.append(seconds)
    ratio = min(ours) / min(theirs)
    start = Line(
        f"{sizes.cells:,} cells, a process each, up and wired",
        f"{min(ours):.1f} s ({ratio:.2f} ×; a wave through all {min(waves):.2f} s)",
        f"bare Zenoh processes {min(theirs):.1f} s",
        f"≤ {_SPAWN:g} ×",
        ratio <= _SPAWN,
        {
            "seconds": min(ours),
            "wave_seconds": min(waves),
            "bare_seconds": min(theirs),
            "ratio": ratio,
            "ratio_of_pairs": ratio_of_pairs(ours, theirs),
        },
    )
    return [start, *_memory(sizes)]


def _memory(sizes: Sizes) -> list[Line]:
    """Measure the cells' memory, and what starting took, once waves have passed."""
    plan = Sweep(sensors=(sizes.cells,), heights=(1,), waves=_ENDLESS)
    found: list[float] = []

    def weigh() -> None:
        children = multiprocessing.active_children()
        cells = [one.pid for one in children if one.pid and one.name[:5] == "cell/"]
        found.append(mean_pss(cells))
        # Waves pass through two of them; what the others did is start.
        found.append(statistics.median(map(_spent, cells)))

    probe(plan, weigh)
    ours, begun = found[0] / _MB, found[1]
    theirs = run_bare("spawn", sizes.cells, "--memory")["pss"] / _MB
    return [
        Line(
            "memory a cell (PSS)",
            f"{ours:.1f} MB",
            f"bare {theirs:.1f} MB",
            f"≤ {_MEMORY:g} MB",
            ours <= _MEMORY,
            {"pss": ours * _MB, "bare_pss": theirs * _MB},
        ),
        Line(
            "processor time a cell takes to start, median",
            f"{begun * 1e3:.0f} ms",
            reach=f"≤ {_BEGIN * 1e3:g} ms",
            reached=begun <= _BEGIN,
            figures={"begin_seconds": begun},
        ),
    ]


def _spent(pid: int) -> float:
    """Return the processor seconds of a process's threads, finer than its own count."""
    threads = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(one.read_text().split()[0]) for one in threads) / 1e9


def hop(sizes: Sizes) -> list[Line]:
    """Time one hop of a wave along a chain, against a bare relay ring."""
    low, high = sizes.chain // 10, sizes.chain - 1
    plan = Sweep(
        sensors=(sizes.chain,), heights=(low, high), waves=sizes.waves, warmup=3
    )
    theirs, slopes, quotients = [], [], []
    ring = "ring", sizes.chain, str(sizes.waves)
    for _ in range(sizes.pairs):
        theirs.append(run_bare(*ring)["hop"])
        medians = _medians(probe(plan)[1])
        slopes.append((medians[high] - medians[low]) / (high - low))
        quotients.append(medians[high] / high)
    bare = min(theirs)
    return [
        Line(
            what,
            f"{min(ours) * 1e6:.0f} µs ({min(ours) / bare:.2f} ×)",
            f"bare relay {bare * 1e6:.0f} µs",
            f"≤ {_HOP:g} ×",
            min(ours) / bare <= _HOP,
            {
                "seconds": min(ours),
                "bare_seconds": bare,
                "ratio": min(ours) / bare,
                "ratio_of_pairs": ratio_of_pairs(ours, theirs),
            },
        )
        for what, ours in (
            (f"one hop, chain of {sizes.chain} cells (slope)", slopes),
            (f"one hop, whole wave / {high} hops", quotients),
        )
    ]


def probe(
    sweep: Sweep, weigh: Callable[[], None] | None = None
) -> tuple[float, list[Measured]]:
    """Return when a swarm that only passes waves was up, in seconds, and its waves.

    Args:
        sweep: Its cells and waves.
        weigh: Called once some waves have passed; the swarm is stopped after it.
    """
    (count,) = sweep.sizes
    jobs = Jobs(partial(ProbeJob, sweep, count), host_jobs(count, sweep.sharing))
    stop, began, seconds = asyncio.Event(), time.perf_counter(), list[float]()

    def on_wave(passed: int) -> None:
        seconds.append(time.perf_counter() - began)  # first when every cell is there
        if passed and weigh is not None and not stop.is_set():
            weigh()
            stop.set()

    result = asyncio.run(launch(jobs, Site(), stop, Watcher(on_wave))).result
    return seconds[0], msgspec.json.decode(result, type=list[Measured])


def run_bare(
    *arguments: object, module: str = "bare", plan: object = None
) -> dict[str, float]:
    """Run the bare side in a program of its own and return what it measured."""
    # By `-c`: what is run as a file or a module, every child would import again.
    code = f"from tools.bench.{module} import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)],
        cwd=_ROOT,
        input=msgspec.json.encode(plan),
        stdout=subprocess.PIPE,
        timeout=300,
        check=True,
    )
    measured: dict[str, float] = json.loads(done.stdout)
    return measured


def _medians(rows: list[Measured]) -> dict[int, float]:
    """Return the median seconds of the waves of each depth, ascending."""
    depths = sorted({row.depth for row in rows})
    return {
        depth: statistics.median(row.seconds for row in rows if row.depth == depth)
        for depth in depths
    }
