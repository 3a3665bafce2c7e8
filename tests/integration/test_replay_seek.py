"""What a recorded run had learned at a tick, and how deep its waves went."""

from pathlib import Path

import numpy as np
import pytest

from neurosnap import wire
from neurosnap.depth.measure import from_recording
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.protocol.run_options import SnapshotKind, WiringKind
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.read.stretches import last_tick
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.sensorium import unpack
from tests.support.recorded_messages import first, of_type
from tests.support.replayed_runs import TICKS, Runs, every_run
from tests.support.rewritten_recordings import rewritten

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


# Seeking ------------------------------------------------------------------------------


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
    assert last_tick(recording) == TICKS
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


@pytest.mark.parametrize("tick", [-1, TICKS + 1])
def test_a_tick_that_is_not_there_is_refused(runs: Runs, tick: int) -> None:
    recording = Recording.open(runs.of("csv").log)
    rule = rf"^tick: must be in \[0, {TICKS}\], got {tick}$"
    with pytest.raises(InvalidValueError, match=rule):
        snapshot_at(recording, tick)


def test_a_lost_observation_is_named_unless_a_key_frame_covers_it(
    runs: Runs, tmp_path: Path
) -> None:
    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, wire.Observation, lambda o: o.tick == 9)
        return recorded[:place] + recorded[place + 1 :]

    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", change))
    with pytest.raises(RecordingError, match=r"observation of tick 9, got none$"):
        snapshot_at(recording, 13)
    assert snapshot_at(recording, 14)[1].clock == 14


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
    def change(recorded: list[Recorded]) -> list[Recorded]:
        place, _ = first(recorded, wire.WaveStart, lambda w: w.wave == 7)
        return recorded[:place] + recorded[place + 1 :]

    recording = Recording.open(rewritten(runs.of("csv").log, tmp_path / "log", change))
    with pytest.raises(RecordingError, match=r"wave 7: must have its start, got none$"):
        from_recording(recording)
