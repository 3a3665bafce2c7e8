"""A recorded run goes on where it ended or was cut, and says what it had learned."""

import random
from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.depth.measure import from_recording
from neurosnap.errors import RecordingError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import SnapshotKind, WiringKind
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.tick_index import TickIndex
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.writer import Writer
from neurosnap.sensorium import unpack
from tests.support.inline_runs import recorded_run, resumed_run
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.replayed_runs import TICKS, Runs, every_run, options_for
from tests.support.rewritten_recordings import (
    Change,
    changing,
    dropping,
    flipped,
    rewritten,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


def test_a_run_whose_thresholds_choose_themselves_goes_on(tmp_path: Path) -> None:
    chance = random.Random(8)
    levels = [chance.random() for _ in range(1620)]
    rows = [[level < 0.3, level < 0.6, level < 0.1] for level in levels]
    rows[400] = [True, False, False]
    rows[1604] = [True, False, False]
    path, start, on = (tmp_path / part for part in ("readings.csv", "start", "on"))
    lines = ["a,b,c", *(",".join(str(int(bit)) for bit in row) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    changes = {"threshold": "auto", "keyframe_every": 500}
    options = options_for(str(path), ticks=1602)
    recorded_run(msgspec.structs.replace(options, **changes), start)
    resumed_run(start, on, 1620)
    assert_true_run(on, ticks=1620)
    _, learned = snapshot_at(Recording.open(on))
    assert learned.threshold == "auto"
    found = learned.evidence(0, 2)
    assert (found.against, found.holds) == (2, True)  # broken, and tolerated


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (dropping(wire.State, and_after=True), "must hold a whole tick .*, got none"),
        (
            # What counts is what follows the last key-frame but one, that of tick 28.
            changing(
                wire.State,
                lambda s: s.tick == 29,
                lambda s: {"literals": flipped(s.literals)},
            ),
            "must be a true run: tick 29: /state",
        ),
        (
            dropping(wire.Pulse),
            rf"must be whole up to tick {TICKS}, lacks \{{'cell/\d': 1\}}",
        ),
    ],
    ids=["no whole tick", "tampered", "lacks a pulse"],
)
def test_what_cannot_be_proved_is_not_gone_on_with(
    runs: Runs, tmp_path: Path, change: Change, rule: str
) -> None:
    log = rewritten(runs.of("csv").log, tmp_path / "log", change)
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with Writer(log) as writer:
        writer.start({"world": "none"})
        writer.finish({}, {})
    rule = r"log: options: must be those of a run, got nothing$"
    with pytest.raises(RecordingError, match=rule):
        verify(log)
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(log)


# What had been learned, and how deep waves went ---------------------------------------


def learned(snapshot: Snapshot) -> dict[str, object]:
    """Return all of a snapshot but its state, comparable."""
    arrays = {n: a.tolist() for n, a in snapshot.arrays().items() if n != "state"}
    return {"kind": type(snapshot).__name__, **arrays}


@pytest.mark.parametrize(
    ("name", "snapshot"), [("path", "discounted"), ("csv", "empirical")]
)
def test_a_snapshot_at_a_tick_is_one_that_learned_that_far(
    runs: Runs, name: str, snapshot: SnapshotKind
) -> None:
    log, options, _ = runs.of(name, "hasse", snapshot)
    recording = Recording.open(log)
    assert TickIndex(recording).last_tick() == TICKS
    frames = [frame.tick for frame in of_type(log, wire.KeyFrame)]
    assert frames == [7, 14, 21, 28, TICKS]
    reference = options.new_snapshot()
    assert learned(snapshot_at(recording, 0)[1]) == learned(reference)
    for observation in of_type(log, wire.Observation):
        reference.learn(unpack(observation.bits, len(options.sensors)))
        tick, found = snapshot_at(recording, observation.tick)
        assert tick == observation.tick == found.clock
        assert learned(found) == learned(reference)
        assert np.array_equal(found.poc_graph().edges, reference.poc_graph().edges)
    assert learned(snapshot_at(recording)[1]) == learned(reference)


# Depth --------------------------------------------------------------------------------


@every_run
def test_a_recording_gives_a_row_for_every_wave(
    runs: Runs, name: str, wiring: WiringKind, snapshot: SnapshotKind
) -> None:
    log, options, outcome = runs.of(name, wiring, snapshot)
    rows = from_recording(Recording.open(log))
    results: list[wire.State | wire.Reached] = [
        *of_type(log, wire.State),
        *of_type(log, wire.Reached),
    ]
    results.sort(key=lambda result: result.wave)
    assert [(r.depth, r.height, r.longest, r.pulses) for r in rows] == [
        (r.depth, r.height, r.longest, r.pulses) for r in results
    ]
    assert [row.kind for row in rows] == [
        "state" if isinstance(result, wire.State) else "signal" for result in results
    ]
    assert {(row.sensors, row.wiring) for row in rows} == {
        (len(options.sensors), wiring)
    }
    assert all(row.seconds > 0 for row in rows)
    assert sum(row.seconds for row in rows) < outcome.seconds
    assert max(row.depth for row in rows) == outcome.totals.depth > 0
    # To a representative, along an edge, to a member: however high the order is.
    most = 3 if wiring == "derived" else TICKS
    assert all(row.depth <= min(most, row.height + 2) for row in rows)


def test_a_wave_whose_start_was_lost_is_named(runs: Runs, tmp_path: Path) -> None:
    lost = dropping(wire.WaveStart, lambda start: start.wave == 7)
    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", lost))
    with pytest.raises(RecordingError, match=r"wave 7: must have its start, got none$"):
        from_recording(recording)
