"""A swarm that passes waves and nothing else, to be timed or weighed."""

import asyncio
from collections.abc import Callable
from functools import partial

import msgspec

from neurosnap.depth.probe import Measured, ProbeJob, ProbePlan
from neurosnap.runtime.launch import Ending, Jobs, host_jobs, launch
from neurosnap.runtime.request import Site, Watcher

_ENDLESS = 10**9
"""More waves than a swarm will ever send: it is stopped when all is measured."""


def probe(plan: ProbePlan) -> Ending:
    """Return how a swarm ended that passed all waves of a plan."""

    async def run() -> Ending:
        return await launch(_swarm(plan), Site(), asyncio.Event())

    return asyncio.run(run())


def rows_of(ending: Ending) -> list[Measured]:
    """Return what was measured of each wave."""
    return msgspec.json.decode(ending.result, type=list[Measured])


def weighed_while_up(
    plan: ProbePlan, weigh: Callable[[], float]
) -> tuple[float, float]:
    """Return the seconds until the first waves had passed, and what was weighed then.

    Args:
        plan: Its number of waves does not count: they go on until all is weighed.
        weigh: Called in a thread, while waves pass.
    """
    return asyncio.run(_while_up(plan, weigh))


async def _while_up(plan: ProbePlan, weigh: Callable[[], float]) -> tuple[float, float]:
    endless = msgspec.structs.replace(plan, waves=_ENDLESS)
    stop, up = asyncio.Event(), asyncio.Event()
    loop = asyncio.get_running_loop()
    began, seconds, found = loop.time(), 0.0, 0.0

    async def measure() -> None:
        nonlocal seconds, found
        try:
            await up.wait()
            seconds = loop.time() - began
            found = await asyncio.to_thread(weigh)
        finally:
            stop.set()

    async with asyncio.TaskGroup() as group:
        measuring = group.create_task(measure(), name="bench/memory")
        try:
            watcher = Watcher(lambda tick: up.set() if tick else None)
            await launch(_swarm(endless), Site(), stop, watcher)
        finally:
            measuring.cancel()
    return seconds, found


def _swarm(plan: ProbePlan) -> Jobs:
    return Jobs(partial(ProbeJob, plan), host_jobs(plan.sensors, plan.workers))
