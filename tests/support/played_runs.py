"""Runs started from their options, and the contents of their recordings."""

import asyncio
import random
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from neurosnap import wire
from neurosnap.agent.policy import AgentKind
from neurosnap.protocol.run_options import CellKind, RunOptions, SnapshotKind
from neurosnap.recording.read.recording import Recording
from neurosnap.runtime.request import Outcome, RunRequest, Watcher
from neurosnap.runtime.run import run
from tests.support import run_options

PATH, GRID = "neurosnap/Path-v0", "neurosnap/Grid-v0"
SENSORS = 8
TICKS = 40
SEED = 3

M = TypeVar("M")


def write_readings(path: Path, rows: int, sensors: int = SENSORS) -> str:
    """Write rows in which s0 implies s1 until that fails, at row 20 and at row 30."""
    chance = random.Random(3)
    lines = [",".join(f"s{sensor}" for sensor in range(sensors))]
    for row in range(1, rows + 1):
        bits = [chance.random() < 0.5 for _ in range(sensors)]
        bits[1] = (bits[0] or bits[1]) if row not in (20, 30) else False
        bits[0] = bits[0] or row in (20, 30)
        bits[3] = bits[2]  # equivalent
        lines.append(",".join(str(int(bit)) for bit in bits))
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def options_for(
    source: str,
    *,
    cells: CellKind = "inline",
    agent: AgentKind = "walker",
    snapshot: SnapshotKind = "empirical",
    workers: int = 0,  # inline, each cell is a part
    ticks: int = TICKS,
    **more: object,
) -> RunOptions:
    return run_options.options_for(
        source,
        SEED,
        {"width": 3, "height": 3, "wait": True} if source == GRID else {},
        agent=agent,
        explore=0.25,
        ticks=ticks,
        snapshot=snapshot,
        threshold=0.1 if snapshot == "empirical" else 0.15,
        decay=None if snapshot == "empirical" else 0.9,
        cells=cells,
        workers=workers,
        **more,  # type: ignore[arg-type]
    )


class Played:
    """What became of a run, from its recording."""

    def __init__(self, log: Path, outcome: Outcome | None = None) -> None:
        self.recording = Recording.open(log)
        self.outcome = outcome
        self.recorded = list(self.recording.messages())

    def of(self, kind: type[M]) -> list[M]:
        return [r.message for r in self.recorded if isinstance(r.message, kind)]

    def payloads(self, *topics: str) -> list[bytes]:
        return [r.payload for r in self.recording.messages(topics)]

    @property
    def states(self) -> list[tuple[int, bytes, bool]]:
        return [(s.tick, s.literals, s.incoherent) for s in self.of(wire.State)]

    @property
    def reached(self) -> list[tuple[int, tuple[int, ...], bytes]]:
        return [(r.tick, r.signal, r.literals) for r in self.of(wire.Reached)]

    @property
    def pulses(self) -> list[tuple[int, int]]:
        states = [(s.tick, s.pulses) for s in self.of(wire.State)]
        return sorted(states + [(r.tick, r.pulses) for r in self.of(wire.Reached)])

    @property
    def decisions(self) -> list[wire.Decision]:
        return self.of(wire.Decision)


async def play(
    options: RunOptions,
    log: Path,
    stop: asyncio.Event | None = None,
    on_progress: Callable[[int], None] = lambda _: None,
) -> Played:
    """Run a swarm and read what was recorded."""
    outcome = await run(
        RunRequest(options, log), stop or asyncio.Event(), Watcher(on_progress)
    )
    return Played(log, outcome)
