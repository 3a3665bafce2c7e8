"""Recorded runs for tests of replay: a walk, and readings that break rules at times."""

import random
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import msgspec
import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions, SnapshotKind, WiringKind
from neurosnap.runtime.request import Outcome
from neurosnap.sources.open import open_source
from tests.support.inline_runs import recorded_run

PATH = "neurosnap/Path-v0"
TICKS = 30
SEED = 5


def readings(rows: int = 60) -> list[list[bool]]:
    """Return rows in which `a` and `b` are equivalent and imply `c`, until they do not.

    Both exceptions come once the rule is learned, so they are incoherent observations.
    """
    chance = random.Random(7)
    table = []
    for tick in range(1, rows + 1):
        a, either, free = (chance.random() < 0.5 for _ in range(3))
        row = [a, a, a or either, not a, free]
        if tick == 19:
            row = [True, False, True, False, free]
        if tick == 24:
            row = [True, True, False, True, free]
        table.append(row)
    return table


def write_csv(path: Path, rows: Iterable[Sequence[bool]]) -> str:
    lines = ["a,b,c,d,e", *(",".join(str(int(bit)) for bit in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return str(path)


def options_for(
    source: str,
    wiring: WiringKind = "hasse",
    snapshot: SnapshotKind = "empirical",
    *,
    ticks: int = TICKS,
) -> RunOptions:
    opened = open_source(source, SEED)
    opened.close()
    return RunOptions(
        source=source,
        body=Body(own=opened.sensors, actions=opened.actions),
        ticks=ticks,
        seed=SEED,
        snapshot=snapshot,
        # Coarse enough that either snapshot learns within a few ticks, and that one
        # exception does not unlearn it.
        threshold=0.08 if snapshot == "empirical" else 0.15,
        decay=None if snapshot == "empirical" else 0.9,
        wiring=wiring,
        cells="inline",
        workers=0,  # the messages of cells that are processes
        keyframe_every=7,
        band=4 if wiring == "derived" else 1000,
    )


class Run(NamedTuple):
    log: Path
    options: RunOptions
    outcome: Outcome


class Runs:
    """Runs of this module, each made once."""

    def __init__(self, folder: Path) -> None:
        self.csv = write_csv(folder / "readings.csv", readings())
        self._folder = folder
        self._made: dict[bytes, Run] = {}

    def of(
        self,
        name: str,
        wiring: WiringKind = "hasse",
        snapshot: SnapshotKind = "empirical",
    ) -> Run:
        source = PATH if name == "path" else self.csv
        options = options_for(source, wiring, snapshot)
        key = msgspec.json.encode(options)
        made = self._made.get(key)
        if made is None:
            log = self._folder / f"{len(self._made)}.mcap"
            made = Run(log, options, recorded_run(options, log))
            self._made[key] = made
        return made


# Each pair of values is in one of them.
EVERY_RUN: list[tuple[str, WiringKind, SnapshotKind]] = [
    ("path", "hasse", "empirical"),
    ("path", "derived", "discounted"),
    ("csv", "hasse", "discounted"),
    ("csv", "derived", "empirical"),
]
every_run = pytest.mark.parametrize(("name", "wiring", "snapshot"), EVERY_RUN)
