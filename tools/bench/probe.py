"""A swarm that passes waves and nothing else, to be timed or weighed."""

import asyncio
from collections.abc import Callable
from functools import partial

import msgspec

from neurosnap.depth.probe import Measured, ProbeJob, ProbePlan
from neurosnap.runtime.launch import Ending, Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher


def probe(plan: ProbePlan, weigh: Callable[[], None] | None = None) -> Ending:
    """Return how a swarm ended that passed all waves of a plan.

    Args:
        plan: Its cells and waves.
        weigh: Called once some waves have passed; the swarm is stopped after it.
    """
    jobs = Jobs(partial(ProbeJob, plan), host_jobs(plan.sensors, plan.workers))
    stop = asyncio.Event()

    def on_wave(passed: int) -> None:
        if passed and weigh is not None and not stop.is_set():
            weigh()
            stop.set()

    async def run() -> Ending:
        return await launch(jobs, Site(), stop, Watcher(on_wave))

    return asyncio.run(run())


def rows_of(ending: Ending) -> list[Measured]:
    """Return what was measured of each wave."""
    return msgspec.json.decode(ending.result, type=list[Measured])
