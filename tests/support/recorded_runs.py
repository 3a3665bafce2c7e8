"""Runs recorded in this process, and the result of replaying each tick."""

import asyncio
import random
from collections.abc import Container, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.compare_derived import Replay
from neurosnap.runtime.launch import run_incarnation
from neurosnap.runtime.request import SILENT, RunRequest
from neurosnap.sources.protocol import Argument
from tests.support.inline_runs import recorded_run
from tests.support.rewritten_recordings import overtaken, rewritten, write_again
from tests.support.run_options import options_for
from tests.support.scripted_sources import Scripted

TICKS = 40


def path_run(ticks: int = TICKS, **changes: object) -> RunOptions:
    options = _options("neurosnap/Path-v0", {"places": 8}, ticks)
    return msgspec.structs.replace(options, **changes)


def planner_run(ticks: int = TICKS) -> RunOptions:
    size = {"width": 3, "height": 3}
    target = ("x_below_1", "y_below_2*")
    return _options("neurosnap/Grid-v0", size, ticks, agent="planner", target=target)


def csv_run(path: Path, ticks: int = TICKS) -> RunOptions:
    """A rule is learned, and broken by what is observed at tick 25."""
    chance = random.Random(3)
    lines = ["a,b,c"]
    for tick in range(1, ticks + 1):
        a = chance.random() < 0.5
        either = a or chance.random() < 0.5
        lines.append("1,0,0" if tick == 25 else f"{a:d},{either:d},{tick % 2}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return _options(str(path), {}, ticks, threshold=0.1)


def large_run(path: Path) -> RunOptions:
    """Twenty chains of 25 sensors each, for six ticks."""
    chance = random.Random(4)
    names = [f"c{chain}_below_{k}" for chain in range(20) for k in range(25)]
    lines = [",".join(names)]
    for _ in range(6):
        places = [chance.randrange(26) for _ in range(20)]
        lines.append(",".join(f"{x <= k:d}" for x in places for k in range(25)))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    # A message for each pulse among 500 cells takes many seconds.
    return _options(str(path), {}, 6, cells="worker", workers=2)


def unread_run(log: Path) -> Path:
    """Record a run in which not every sensor is read: ``s0`` implies ``s1``.

    That is learned in 30 ticks. At 31 only ``s0`` is read; at 32 the rule is broken.
    """
    chance = random.Random(6)
    rows: list[list[bool | None]] = []
    for tick in range(1, 31):
        a = tick == 30 or chance.random() < 0.5
        rows.append([a, a or chance.random() < 0.5, tick % 2 == 0])
    rows += [[True, None, None], [True, False, None]]
    return scripted_run(rows, log)


def torn_run(log: Path) -> Path:
    """Record a run at whose last tick others say ``s1`` is on, and that it is off.

    ``s0`` implies ``s1``, ``s2`` excludes it; both are on, and ``s1`` is not read.
    """
    chance = random.Random(7)
    rows: list[list[bool | None]] = []
    for _ in range(40):
        a = chance.random() < 0.4
        b = a or chance.random() < 0.4
        rows.append([a, b, not b and chance.random() < 0.7])
    return scripted_run([*rows, [True, None, None], [True, None, True]], log)


def scripted_run(
    rows: Sequence[Sequence[bool | None]], log: Path, source: str = "scripted"
) -> Path:
    """Record a run of three sensors that read as given, None where not read."""
    options = RunOptions(
        source=source,
        body=Body(own=("s0", "s1", "s2")),
        ticks=len(rows),
        threshold=0.1,
        cells="inline",
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "neurosnap.runtime.parts.world_process.open_source",
            lambda *_: Scripted(rows),
        )
        # Without a journal, whatever the source is called.
        request = RunRequest(options, log)
        asyncio.run(run_incarnation(request, asyncio.Event(), SILENT))
    return log


def _options(
    source: str, arguments: Mapping[str, Argument], ticks: int, **changes: object
) -> RunOptions:
    # The messages of cells that are processes.
    cells = {"cells": "inline", "workers": 0}
    given = {"threshold": 0.08, "keyframe_every": 7, **cells, **changes}
    return options_for(source, 5, arguments, ticks=ticks, **given)  # type: ignore[arg-type]


def recorded(options: RunOptions, log: Path) -> Path:
    recorded_run(options, log)
    return log


def in_chunks(log: Path, target: Path, chunk: int, seed: int | None = None) -> Path:
    """Record it all again in chunks of some size, senders overtaking each other."""
    recording = Recording.open(log)
    messages = list(recording.messages())
    if seed is not None:
        messages = overtaken(messages, random.Random(seed))
    return write_again(recording, target, messages, chunk=chunk)


class Told(NamedTuple):
    """What a replay says of a tick."""

    state: list[int | None]
    hasse: frozenset[tuple[int, int]]
    height: int


def told(log: Path) -> dict[int, Told]:
    """Return what a replay derives, tick by tick."""
    replay = Replay(Recording.open(log))
    found = {}
    for tick in replay.ticks():
        state, graph = replay.core.snapshot.state, replay.core.graph
        edges = {(a, b) for a, b in np.argwhere(graph.hasse()).tolist()}
        found[tick] = Told(ternary(state), frozenset(edges), graph.height())
    return found


def ternary(literals: Iterable[bool]) -> list[int | None]:
    pairs = np.asarray(list(literals)).reshape(-1, 2).tolist()
    return [1 if on else 0 if off else None for on, off in pairs]


def without_states(log: Path, target: Path, ticks: Container[int]) -> Path:
    """Record it all again, except for the states of some ticks."""

    def change(recorded: list[Recorded]) -> Iterable[Recorded]:
        for each in recorded:
            message = each.message
            if not (isinstance(message, wire.State) and message.tick in ticks):
                yield each

    return rewritten(log, target, change)
