"""A swarm that only passes waves, to measure its time and memory."""

import asyncio
import time
from collections.abc import Callable
from functools import partial

import msgspec

from neurosnap.depth.probe import Measured, ProbeJob, Sweep
from neurosnap.runtime.launch import Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher


def probe(
    sweep: Sweep, weigh: Callable[[], None] | None = None
) -> tuple[float, list[Measured]]:
    """Return after how many seconds a swarm was up, and each wave that it passed.

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
