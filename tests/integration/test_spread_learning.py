"""Learning that workers share: equal to the coordinator's, recorded, gone on from."""

import random
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.verify import verify
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.inline_runs import recorded_run, spread
from tests.support.recorded_messages import of_type
from tests.support.replayed_runs import options_for

pytestmark = pytest.mark.slow


# Equal ----------------------------------------------------------------------------


def random_source(chance: random.Random, path: Path) -> int:
    """Write readings of which some are copies, some rare and some unknown."""
    sensors, rows = chance.randint(2, 12), chance.randint(5, 40)
    unknown = chance.random() < 0.4
    lines = [",".join(f"s{k}" for k in range(sensors))]
    bits = [chance.random() < 0.5 for _ in range(sensors)]
    for _ in range(rows):
        for k in range(sensors):
            if chance.random() < 0.3:
                bits[k] = bits[k - 1] if k and chance.random() < 0.6 else not bits[k]
        cells = [str(int(bit)) for bit in bits]
        if unknown and chance.random() < 0.5:
            cells[chance.randrange(sensors)] = ""
        lines.append(",".join(cells))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return rows


def random_run(seed: int, path: Path) -> RunOptions:
    chance = random.Random(seed)
    rows = random_source(chance, path)
    empirical = chance.random() < 0.6
    watch = chance.random() < 0.5
    return msgspec.structs.replace(
        options_for(str(path)),
        ticks=rows,
        snapshot="empirical" if empirical else "discounted",
        threshold=chance.choice([0.05, 0.25, "auto"]) if empirical else 0.15,
        decay=None if empirical else 0.8,
        wiring=chance.choice(["hasse", "derived"]),
        keyframe_every=chance.choice([1, 4, 1000]),
        band=chance.choice([0, 1, 3, 1 << 20]),
        watch=watch,
        support=chance.choice([0, 2]),
        hold=chance.choice([0, 3]),
    )


@pytest.mark.parametrize("hundred", rows([0], [1, 2, 3]))
def test_processes_workers_inline_and_spread_agree(
    tmp_path: Path, hundred: int
) -> None:
    """Over a hundred random sources: the same states, decisions and anomalies."""
    for seed in range(25 * hundred, 25 * hundred + 25):
        options = random_run(seed, tmp_path / f"{seed}.csv")
        sensors = len(options.sensors)
        several = min(1 + seed % 3, sensors)
        kinds = {
            "cells": options,
            "inline": msgspec.structs.replace(options, workers=1),
            "worker": msgspec.structs.replace(options, cells="worker", workers=several),
            "spread": spread(options, several),
        }
        logs = {kind: tmp_path / f"{seed}-{kind}.mcap" for kind in kinds}
        for kind, given in kinds.items():
            recorded_run(given, logs[kind])
        expected, told = course(logs["cells"]), of_type(logs["cells"], wire.Anomaly)
        for kind, found in logs.items():
            assert course(found) == expected, (seed, kind)
            assert of_type(found, wire.Anomaly) == told, (seed, kind)
        looms = [
            of_type(logs[kind], wire.WorkerWiring) for kind in ("worker", "spread")
        ]
        # A key-frame makes the coordinator wire anew, and both have the same of these.
        assert looms[0] == looms[1], seed
        verdict = verify(logs["spread"])
        assert (verdict.difference, verdict.complete) == (None, True), seed
        _, learned = snapshot_at(Recording.open(logs["spread"]), options.ticks)
        _, without = snapshot_at(Recording.open(logs["worker"]), options.ticks)
        assert learned.to_bytes() == without.to_bytes(), seed


# Refused ----------------------------------------------------------------------------


@pytest.mark.parametrize("cells", ["process", "inline"])
def test_cells_that_are_not_in_workers_cannot_share(cells: str) -> None:
    with pytest.raises(
        InvalidValueError, match="learning: must go with cells in workers"
    ):
        RunOptions(source="x", body=Body(own=("a",)), learning="spread", cells=cells)  # type: ignore[arg-type]


def test_sensors_that_grow_are_learned_by_the_coordinator() -> None:
    body = Body.full(("a", "b"), ("left", "right"), room=1)
    with pytest.raises(
        InvalidValueError, match="must be coordinator where sensors grow"
    ):
        RunOptions(
            source="x", body=body, learning="spread", cells="worker", agent="planner"
        )
