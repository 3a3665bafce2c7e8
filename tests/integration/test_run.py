"""Swarms give the same, correct result in processes, in workers and inline."""

import random
from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.policy import AgentKind
from neurosnap.poc.order.graph import PocGraph
from neurosnap.protocol.cell import Cell
from neurosnap.protocol.run_options import RunOptions, SnapshotKind
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import verify
from neurosnap.sensorium import complete, pack, unpack
from neurosnap.sources.open import open_source
from tests.golden.drive import drive
from tests.support import run_options
from tests.support.course import course
from tests.support.edges import learned_edges
from tests.support.exhaustive import rows
from tests.support.inline_runs import recorded_run, spread
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.recorded_runs import recorded
from tools.simulate.case import random_options

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_process_is_left")]
PATH, GRID = "neurosnap/Path-v0", "neurosnap/Grid-v0"
SENSORS, TICKS, SEED = 8, 40, 3


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Rows in which s0 implies s1 until that fails, at row 20 and at row 30."""
    chance = random.Random(3)
    lines = [",".join(f"s{sensor}" for sensor in range(SENSORS))]
    for row in range(1, TICKS + 1):
        bits = [chance.random() < 0.5 for _ in range(SENSORS)]
        bits[1] = (bits[0] or bits[1]) if row not in (20, 30) else False
        bits[0] = bits[0] or row in (20, 30)
        bits[3] = bits[2]  # equivalent
        lines.append(",".join(str(int(bit)) for bit in bits))
    path = tmp_path_factory.mktemp("run") / "readings.csv"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def options_for(
    source: str, snapshot: SnapshotKind = "empirical", **more: object
) -> RunOptions:
    given: dict[str, object] = {
        "cells": "inline",
        "workers": 0,  # inline, each cell is a part
        "explore": 0.25,
        "ticks": TICKS,
        "threshold": 0.1 if snapshot == "empirical" else 0.15,
        "decay": None if snapshot == "empirical" else 0.9,
        **more,
    }
    world = {"width": 2, "height": 2, "wait": True} if source == GRID else {}
    return run_options.options_for(source, SEED, world, snapshot=snapshot, **given)  # type: ignore[arg-type]


# What comes out -----------------------------------------------------------------------

INLINE: list[dict[str, object]] = [{"cells": "inline"}, {"wiring": "derived"}]
PROCESSES: list[dict[str, object]] = [
    {"cells": "process"},
    {"cells": "process", "wiring": "derived"},
]
WORKERS: list[dict[str, object]] = [
    {"cells": "worker", "workers": workers} for workers in (1, 2, 4)
]


@pytest.mark.zenoh
@pytest.mark.parametrize(
    ("source", "agent", "snapshot", "ways"),
    rows(
        [
            ("csv", "walker", "empirical", [*INLINE, *PROCESSES, *WORKERS[:2]]),
            (PATH, "walker", "discounted", INLINE),
            (GRID, "planner", "empirical", [INLINE[0], WORKERS[2]]),
        ],
        [
            ("csv", "walker", "discounted", INLINE),
            (PATH, "walker", "empirical", [*INLINE, *PROCESSES, *WORKERS]),
            (GRID, "planner", "empirical", [*INLINE, *PROCESSES, *WORKERS]),
        ],
    ),
)
def test_every_kind_of_cells_comes_to_the_same_and_to_what_is_right(
    source: str,
    agent: AgentKind,
    snapshot: SnapshotKind,
    ways: list[dict[str, object]],
    readings: str,
    tmp_path: Path,
) -> None:
    given = readings if source == "csv" else source
    first: Path | None = None
    for number, way in enumerate(ways):
        options = options_for(given, snapshot, agent=agent, **way)
        log = recorded(options, tmp_path / f"{number}.mcap")
        assert_true_run(log, ticks=TICKS)
        snapshot_alone, count = options.new_snapshot(), len(options.sensors)
        read = [unpack(o.bits, count) for o in of_type(log, wire.Observation)]
        assert states(log) == [pack(snapshot_alone.observe(bits)) for bits in read]
        first = first or log
        assert course(log) == course(first)
    assert first is not None
    told = of_type(first, wire.State)
    assert any(state.height > 0 for state in told)
    if (source, snapshot) == ("csv", "empirical"):
        assert any(state.incoherent for state in told)
    assert of_type(first, wire.Reached) or agent == "walker"


def states(log: Path) -> list[bytes]:
    return [state.literals for state in of_type(log, wire.State)]


# What the state follows from ----------------------------------------------------------


def test_the_wiring_that_cells_have_is_what_the_state_follows_from(
    readings: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Two cells are told what nobody has learned: that s6 implies not s7, and, which is
    # the same, that s7 implies not s6. A cell that alone is told so waits for a pulse
    # that never comes.
    extra = {6: 15, 7: 13}
    rewire = Cell._rewire

    def misled(cell: Cell, wiring: wire.Wiring) -> None:
        if target := extra.get(cell.cell):
            more = (*wiring.add, target)
            fewer = tuple(b for b in wiring.drop if b != target)
            wiring = msgspec.structs.replace(wiring, add=more, drop=fewer)
        rewire(cell, wiring)

    monkeypatch.setattr(Cell, "_rewire", misled)
    options = options_for(readings)
    driven = drive(options, open_source(readings, SEED))
    snapshot, differ = options.new_snapshot(), 0
    told = {(2 * cell, target) for cell, target in extra.items()}
    graph = PocGraph.from_implications(SENSORS, told)
    bits = honest = np.zeros(SENSORS, np.bool_)
    for message in driven.published:
        match message:
            case wire.Observation():
                bits = unpack(message.bits, SENSORS)
                honest = snapshot.observe(bits)
                learned = learned_edges(snapshot)
                graph = PocGraph.from_implications(SENSORS, learned | told)
            case wire.State():
                expected = graph.coherent_projection(np.flatnonzero(complete(bits)))
                found = unpack(message.literals, 2 * SENSORS)
                np.testing.assert_array_equal(found, expected)
                differ += not np.array_equal(expected, honest)
            case wire.Reached():
                found = unpack(message.literals, 2 * SENSORS)
                np.testing.assert_array_equal(found, graph.up(message.signal))
    assert differ > TICKS / 8


# Workers that share the learning ------------------------------------------------------


@pytest.mark.parametrize("batch", rows([range(12)], [range(12, 100)]))
def test_cells_and_workers_that_share_the_learning_agree_on_random_sources(
    tmp_path: Path, batch: range
) -> None:
    for seed in batch:
        chance, folder = random.Random(seed), tmp_path / str(seed)
        folder.mkdir()
        drawn = random_options(chance, folder)
        options = msgspec.structs.replace(
            drawn,
            cells="inline",
            workers=0,  # the messages of cells that are processes
            watch=chance.random() < 0.5,
            support=chance.choice([0, 2]),
            hold=chance.choice([0, 3]),
        )
        sensors = len(options.sensors)
        several = min(1 + seed % 3, sensors)
        kinds = {
            "cells": options,
            "inline": msgspec.structs.replace(options, workers=1),
            "worker": spread(options, several),
        }
        logs = {kind: folder / f"{kind}.mcap" for kind in kinds}
        for kind, given in kinds.items():
            recorded_run(given, logs[kind])
        expected, told = course(logs["cells"]), of_type(logs["cells"], wire.Anomaly)
        for kind, found in logs.items():
            assert course(found) == expected, (seed, kind)
            assert of_type(found, wire.Anomaly) == told, (seed, kind)
        looms = [
            of_type(logs[kind], wire.WorkerWiring) for kind in ("inline", "worker")
        ]
        assert looms[0] == looms[1] or several > 1, seed
        verdict = verify(logs["worker"])
        assert (verdict.difference, verdict.complete) == (None, True), seed
        _, learned = snapshot_at(Recording.open(logs["worker"]))
        _, without = snapshot_at(Recording.open(logs["cells"]))
        assert learned.to_bytes() == without.to_bytes(), seed
