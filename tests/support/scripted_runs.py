"""Runs of a source that a test has written down, recorded in this process."""

import asyncio
from pathlib import Path

import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts.recorder_process import describe
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.support.inline_site import InlineSite
from tests.support.scripted_sources import Scripted

ACTIONS = ("go", "stay")


def scripted_options(ticks: int, workers: int = 0, **more: object) -> RunOptions:
    """Return the options of a run of three sensors, in cells or among workers."""
    given: dict[str, object] = {
        "body": Body.full(["s0", "s1", "s2"], ACTIONS),
        "threshold": 0.2,
        "cells": "worker" if workers else "inline",
        "workers": workers,
    }
    return RunOptions(source="scripted", ticks=ticks, **(given | more))  # type: ignore[arg-type]


def record_scripted(
    source: Scripted, options: RunOptions, log: Path, past: ResumePoint | None = None
) -> Path:
    """Record what comes of a source."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "neurosnap.runtime.parts.world_process.open_source", lambda *_: source
        )
        _facts, stop = describe(options), asyncio.Event()
        asyncio.run(run(RunRequest(options, log, past, site=InlineSite()), stop))
    return log
