"""Runs whose workers share the learning, each a task of this process."""

import asyncio
from pathlib import Path

import msgspec

from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.runtime.parts.recorder_process import describe
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.support.inline_site import InlineSite


def spread(options: RunOptions, workers: int = 2) -> RunOptions:
    """Return the same run with its learning spread."""
    given = {"cells": "worker", "workers": workers, "learning": "spread"}
    return msgspec.structs.replace(options, **given)


def worker_run(
    options: RunOptions, log: Path, past: ResumePoint | None = None
) -> RunOptions:
    """Record a run of any kind of cells, with all of them in this process."""

    async def work() -> None:
        _facts, stop = describe(options), asyncio.Event()
        await run(RunRequest(options, log, past, site=InlineSite()), stop)

    asyncio.run(work())
    return options


def resumed_worker_run(log: Path, new: Path, ticks: int) -> None:
    """Go on with such a run."""
    options, past = find_resume_point(log)
    worker_run(msgspec.structs.replace(options, ticks=ticks), new, past)
