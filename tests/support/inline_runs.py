"""Runs in which every part is a task of this process."""

import asyncio
import random
from pathlib import Path

import msgspec
import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.runtime.inline_tasks import InlineTasks
from neurosnap.runtime.request import Outcome, RunRequest, Site
from neurosnap.runtime.run_with_restarts import run
from neurosnap.runtime.starter import Starter
from tests.support.scripted_sources import Scripted

ACTIONS = ("go", "stay")


class InlineSite(Site):
    """Starts every part as a task, whatever kind of cells the run has."""

    def starter(self) -> Starter:
        return InlineTasks()


def recorded_run(
    options: RunOptions, log: Path, *, past: ResumePoint | None = None
) -> Outcome:
    """Record a run."""
    request = RunRequest(options, log, past, site=InlineSite())
    return asyncio.run(run(request, asyncio.Event()))


def resumed_run(log: Path, new: Path, ticks: int) -> Outcome:
    """Go on with a run from the end of its recording."""
    options, past = find_resume_point(log)
    return recorded_run(msgspec.structs.replace(options, ticks=ticks), new, past=past)


def spread(options: RunOptions, workers: int = 2) -> RunOptions:
    """Return the same run with cells in workers, which share the learning."""
    return msgspec.structs.replace(options, cells="worker", workers=workers)


# Of a source that a test has written down ---------------------------------------------


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
        recorded_run(options, log, past=past)
    return log


def implying_rows(
    ticks: int, seed: int, unknown: float = 0.0
) -> list[list[bool | None]]:
    """Draw rows of three sensors, of which the first implies the second.

    Each reading of the first two is unknown with the chance `unknown`.
    """
    chance = random.Random(seed)
    table: list[list[bool | None]] = []
    for _ in range(ticks):
        a, b, c = (chance.random() < 0.5 for _ in range(3))
        row: list[bool | None] = [a, a or b]
        if unknown:
            row = [None if chance.random() < unknown else on for on in row]
        table.append([*row, c])
    return table
