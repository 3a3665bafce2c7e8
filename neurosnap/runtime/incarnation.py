"""Runs one incarnation of a swarm, until it has ended or a part has failed."""

import asyncio
import sys
from functools import partial
from importlib import metadata
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.launch import Jobs, host_jobs, launch
from neurosnap.runtime.parts.coordinator_process import CoordinatorJob, Result
from neurosnap.runtime.parts.job import Job
from neurosnap.runtime.parts.recorder_process import RecorderJob
from neurosnap.runtime.parts.run_description import RunDescription
from neurosnap.runtime.parts.status_publisher import StatusJob, has_status
from neurosnap.runtime.parts.world_process import WorldJob
from neurosnap.runtime.request import Outcome, RunRequest
from neurosnap.runtime.starting.inline_tasks import InlineTasks
from neurosnap.runtime.watcher import SILENT, Watcher
from neurosnap.system.distribution import version

_PACKAGES = ("eclipse-zenoh", "mcap", "msgspec", "numpy", "numba")


async def run_incarnation(
    request: RunRequest, stop: asyncio.Event, watcher: Watcher = SILENT
) -> Outcome:
    """Run a swarm once, whatever the supervision of the request says.

    Raises:
        InvalidValueError: There are more sensors than a key-frame can hold.
        NeurosnapError: A part failed; the text names it. Whatever was recorded until
            then is readable, and no process is left.
    """
    options = request.options
    options.check_frame()
    starter = InlineTasks() if options.cells == "inline" else request.site.starter()
    ending = await launch(_jobs(request), request.site, stop, watcher, starter)
    result = msgspec.json.decode(ending.result, type=Result)
    return Outcome(
        totals=result.totals,
        implications=result.implications,
        completeness=ending.completeness,
        seconds=result.seconds,
        startup=ending.seconds - result.seconds,
        stopped=ending.stopped,
        lost=ending.lost,
        health=ending.health,
    )


def _jobs(request: RunRequest) -> Jobs:
    """Return the jobs of all parts of a run."""
    options, past, site, log = request.options, request.past, request.site, request.log
    vacant = tuple(sorted(site.elsewhere))
    description = RunDescription(options=options, past=past, vacant=vacant)
    learning = options if options.learning_shares else None
    return Jobs(
        coordinator=partial(CoordinatorJob, description, site.patience),
        hosts=host_jobs(len(options.sensors), options.sharing, learning),
        world=WorldJob(options, past, request.way_in),
        status=StatusJob(options, past) if has_status(options) else None,
        recorder=None if log is None else partial(recorder_job, options, log, past),
        past=past,
        patience=options.deadline + 10.0,
        source=options.source,
        log=log,
    )


def recorder_job(
    options: RunOptions,
    log: Path,
    past: ResumePoint | None,
    swarm: str,
    heard: tuple[str, ...],
) -> Job:
    """Return the job of the recorder of a run.

    Args:
        options: The run's.
        log: Where to record.
        past: What the recording takes over.
        swarm: The swarm's id.
        heard: The parts whose last words it waits for.
    """
    return RecorderJob(str(log), {**describe(options), "swarm": swarm}, past, heard)


def describe(options: RunOptions) -> dict[str, str]:
    """Return the facts of a run, as text: each option, all of them, the versions."""
    facts = {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in msgspec.structs.asdict(options).items()
    }
    versions = {"neurosnap": version()}
    versions |= {name: metadata.version(name) for name in _PACKAGES}
    versions["python"] = ".".join(map(str, sys.version_info[:3]))
    return {
        **facts,
        "sensors": msgspec.json.encode(options.sensors).decode(),
        "options": msgspec.json.encode(options).decode(),
        "versions": msgspec.json.encode(versions).decode(),
    }
