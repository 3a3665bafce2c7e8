"""Recorded runs to export."""

import asyncio
import random
from pathlib import Path

import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.inline import run_inline
from neurosnap.runtime.run import describe
from tests.support.scripted_sources import Scripted

TICKS = 40
ACTIONS = ("go", "stay")
NAMES = ("depth", "front.door", 'a "b" & c')


def rows(unknown: bool) -> list[list[bool | None]]:
    """Readings of three sensors, the first of which implies the second."""
    chance = random.Random(5)
    table: list[list[bool | None]] = []
    for _ in range(TICKS):
        a, b, c = (chance.random() < 0.5 for _ in range(3))
        row: list[bool | None] = [a, a or b]
        if unknown:
            row = [None if chance.random() < 0.2 else on for on in row]
        table.append([*row, c])
    return table


def options(body: Body) -> RunOptions:
    return RunOptions(
        source="scripted",
        body=body,
        ticks=TICKS,
        threshold=0.2,
        cells="inline",
        keyframe_every=10,
        watch=True,
    )


def recorded(log: Path, *, unknown: bool = True, acts: bool = True) -> Path:
    """Record a run in this process."""
    body = Body.full(NAMES, ACTIONS) if acts else Body(own=NAMES)
    given = options(body)
    with pytest.MonkeyPatch.context() as patch:
        source = Scripted(rows(unknown), ACTIONS if acts else ())
        patch.setattr("neurosnap.runtime.inline.open_source", lambda *_: source)
        facts, stop = describe(given), asyncio.Event()
        asyncio.run(run_inline(given, log, facts, None, stop, lambda _: None))
    return log
