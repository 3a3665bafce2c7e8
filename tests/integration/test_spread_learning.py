"""Learning that workers share: equal to the coordinator's, recorded, gone on from."""

import random
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.keyframes import starts
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from tests.support.course import course
from tests.support.exhaustive import rows
from tests.support.recorded_messages import of_type
from tests.support.replayed_runs import TICKS, Runs, options_for
from tests.support.rewritten_recordings import rewritten, saying
from tests.support.spread_runs import resumed_worker_run, spread, worker_run

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


@pytest.fixture
def log(runs: Runs, tmp_path: Path) -> Path:
    return made(runs, tmp_path / "log")


def made(runs: Runs, log: Path, **changes: Any) -> Path:
    options = msgspec.structs.replace(options_for(runs.csv), **{"band": 4, **changes})
    worker_run(spread(options), log)
    return log


def known_in(snapshot: Snapshot) -> bytes:
    """Return what was learned; the state is not told."""
    snapshot.adopt(np.zeros(10, np.bool_))
    return snapshot.to_bytes()


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
            worker_run(given, logs[kind])
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


# Recorded ---------------------------------------------------------------------------


def test_each_worker_sends_the_bands_of_its_share(log: Path, runs: Runs) -> None:
    frames = of_type(log, wire.KeyFrame)
    assert [frame.tick for frame in frames] == [7, 14, 21, 28, 30]
    # Of ten pairs one worker has those of four sensors, six, and the other four.
    assert [frame.bands for frame in frames] == [6] * 5
    senders = {(band.who, band.offset) for band in of_type(log, wire.Band)}
    assert senders == {("worker/0", 0), ("worker/0", 4), ("worker/1", 6)}
    verdict = verify(log)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, True, TICKS)
    assert course(log) == course(runs.of("csv").log)


def test_what_was_learned_is_read_from_them(log: Path, runs: Runs) -> None:
    whole = Recording.open(runs.of("csv").log)
    for tick in (7, 10, 28, 30):
        _, learned = snapshot_at(Recording.open(log), tick)
        _, without = snapshot_at(whole, tick)
        assert known_in(learned) == known_in(without)
    assert [start.frame.tick for start in starts(Recording.open(log))][-1] == 30


@pytest.mark.parametrize("ticks", [1, 7, 8, 18])
def test_a_replay_begins_with_them_and_a_run_goes_on(
    log: Path, runs: Runs, tmp_path: Path, ticks: int
) -> None:
    assert verify(log, 15).start == 14
    assert verify(log, 15).same
    start, on = made(runs, tmp_path / "start", ticks=ticks), tmp_path / "on"
    resumed_worker_run(start, on, TICKS)
    verdict = verify(on)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, True, TICKS)
    assert course(on) == course(log)
    again = tmp_path / "again"
    resumed_worker_run(on, again, TICKS + 1)  # the source ends there
    assert verify(again).same


def test_they_go_into_the_file_that_their_key_frame_begins(
    log: Path, tmp_path: Path
) -> None:
    old, split = Recording.open(log), tmp_path / "split.mcap"
    with SplitWriter(split, old.metadata, split=Split(3000)) as writer:
        for recorded in old.messages():
            writer.add(recorded.delivery, recorded.log_time)
            writer.flush(recorded.log_time)
        writer.finish({}, old.noted().expected)
    files = part_paths(split)
    assert len(files) > 2
    for number, path in files.items():
        recording = Recording.open(path)
        if number:
            assert next(starts(recording)).frame.tick == recording.begins
        verdict = verify(path)
        assert (verdict.difference, verdict.complete) == (None, True)
    assert verify(split).ticks == TICKS


def test_a_lost_band_makes_its_recording_incomplete_and_not_different(
    log: Path, tmp_path: Path
) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        bands = [r for r in recorded if isinstance(r.message, wire.Band)]
        return [each for each in recorded if each is not bands[7]]

    lossy = rewritten(log, tmp_path / "lossy", change)
    assert [one.frame.tick for one in starts(Recording.open(lossy))] == [7, 21, 28, 30]
    verdict = verify(lossy)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, False, TICKS)


def test_lost_learning_ends_what_can_be_derived(log: Path, tmp_path: Path) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        several = [r for r in recorded if isinstance(r.message, wire.Learned)]
        lost = next(r for r in several if said_at(r) == 9)
        return [each for each in recorded if each is not lost]

    verdict = verify(rewritten(log, tmp_path / "lossy", change))
    assert verdict.difference is None
    assert not verdict.complete
    assert (1, 8) in verdict.ranges


def said_at(recorded: Recorded) -> int:
    assert isinstance(recorded.message, wire.Learned)
    return recorded.message.tick


CODES = {"codes": b"\3", "rows": b"\1\0\0\0"}


@pytest.mark.parametrize(
    ("kind", "changes"),
    [
        (wire.Band, {"data": memoryview(b"\7" * 16)}),
        (wire.Band, {"array": "clock"}),
        (wire.Band, {"offset": 5}),
        (wire.Learned, CODES),
        (wire.Learn, {"paused": True}),
        (wire.Learn, {"bits": b"\0"}),
    ],
)
def test_what_does_not_follow_is_found(
    log: Path, tmp_path: Path, kind: type[wire.Message], changes: dict[str, Any]
) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        several = [r for r in recorded if isinstance(r.message, kind)]
        old = next(r for r in several if getattr(r.message, "tick", 0) == 14)
        if kind is wire.Learned:
            old = next(r for r in several if said_at(r) == 12)
        return [saying(old, **changes) if r is old else r for r in recorded]

    verdict = verify(rewritten(log, tmp_path / "wrong", change))
    assert verdict.difference is not None
    assert not verdict.same
    assert wire.topic(kind(**example(kind)).key) in verdict.difference


def example(kind: type[wire.Message]) -> dict[str, Any]:
    """Return what a message needs to have a key."""
    if kind is wire.Band:
        return {
            "who": "x",
            "tick": 1,
            "array": "",
            "offset": 0,
            "data": memoryview(b""),
        }
    return {"tick": 1} | ({"worker": 0} if kind is wire.Learned else {})


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
