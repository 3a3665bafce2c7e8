"""Key-frames in bands: written, read, gone on from, split, lost and falsified."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.learning.kinds import Snapshot
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.keyframes import starts
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from tests.support.recorded_messages import course, of_type
from tests.support.replayed_runs import (
    TICKS,
    Runs,
    options_for,
    recorded_run,
    resumed_run,
)
from tests.support.rewritten_recordings import rewritten, saying

pytestmark = pytest.mark.slow


def made(runs: Runs, log: Path, **changes: Any) -> Path:
    given = {"workers": 1, "band": 4, **changes}
    recorded_run(msgspec.structs.replace(options_for(runs.csv), **given), log)
    return log


def known_in(snapshot: Snapshot) -> bytes:
    """Return what was learned; the state is not told."""
    snapshot.adopt(np.zeros(10, np.bool_))
    return snapshot.to_bytes()


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Runs:
    return Runs(tmp_path_factory.mktemp("runs"))


@pytest.fixture
def log(runs: Runs, tmp_path: Path) -> Path:
    return made(runs, tmp_path / "log")


def test_each_key_frame_is_followed_by_its_bands(log: Path, runs: Runs) -> None:
    frames = of_type(log, wire.KeyFrame)
    assert [frame.tick for frame in frames] == [7, 14, 21, 28, 30]
    # Ten pairs, four of them in a band, of counts and of dates.
    assert [frame.bands for frame in frames] == [6] * 5
    bands = of_type(log, wire.Band)
    assert [band.tick for band in bands] == [
        t for t in (7, 14, 21, 28, 30) for _ in "6" * 6
    ]
    assert {band.who for band in bands} == {"coordinator"}
    verdict = verify(log)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, True, TICKS)
    assert course(log) == course(runs.of("csv").log)


def test_what_was_learned_is_read_from_them(log: Path, runs: Runs) -> None:
    whole = Recording.open(runs.of("csv").log)
    for tick in (7, 10, 28, 30):
        _, learned = snapshot_at(Recording.open(log), tick)
        _, without = snapshot_at(whole, tick)
        assert known_in(learned) == known_in(without)
        assert known_in(RunView(log).snapshot(tick)) == known_in(without)
    assert Recording.open(log).files[-1].snapshot is None
    assert [start.frame.tick for start in starts(Recording.open(log))][-1] == 30


def test_a_replay_begins_with_them_and_a_run_goes_on(
    log: Path, runs: Runs, tmp_path: Path
) -> None:
    assert verify(log, 15).start == 14
    assert verify(log, 15).same
    start, on = made(runs, tmp_path / "start", ticks=18), tmp_path / "on"
    resumed_run(start, on, TICKS)
    assert verify(on).same
    assert course(on) == course(log)


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
    assert verify(lossy, 15).start == 7
    _, learned = snapshot_at(Recording.open(lossy), 15)
    assert known_in(learned) == known_in(snapshot_at(Recording.open(log), 15)[1])


@pytest.mark.parametrize("field", ["data", "offset", "array"])
def test_a_band_that_says_what_was_not_learned_is_found(
    log: Path, tmp_path: Path, field: str
) -> None:
    wrong = {"data": memoryview(b"\7" * 16), "offset": 5, "array": "clock"}

    def change(recorded: list[Recorded]) -> list[Recorded]:
        bands = [r for r in recorded if isinstance(r.message, wire.Band)]
        changed = saying(bands[7], **{field: wrong[field]})
        return [changed if each is bands[7] else each for each in recorded]

    verdict = verify(rewritten(log, tmp_path / "wrong", change))
    assert verdict.difference is not None
    assert verdict.difference.startswith("tick 14: /band coordinator,")
    assert not verdict.same


def test_they_go_into_the_file_that_their_key_frame_begins(
    runs: Runs, tmp_path: Path
) -> None:
    whole, log = made(runs, tmp_path / "whole.mcap"), tmp_path / "log.mcap"
    old = Recording.open(whole)
    with SplitWriter(log, old.metadata, split=Split(3000)) as writer:
        for recorded in old.messages():
            writer.add(recorded.delivery, recorded.log_time)
            writer.flush(recorded.log_time)
        writer.finish({}, old.noted().expected)
    files = part_paths(log)
    assert len(files) > 2
    for number, path in files.items():
        recording = Recording.open(path)
        if number:
            assert next(starts(recording)).frame.tick == recording.begins
        assert verify(path).same
    _, past = find_resume_point(log)
    assert (past.tick, past.part) == (TICKS, len(files) - 1)
    # The last file's key-frame is not whole: so the run goes on from the one before.
    last = Recording.open(files[len(files) - 1])
    kept = [r for r in last.messages() if not isinstance(r.message, wire.Band)]
    begun = kept[
        : 1 + next(i for i, r in enumerate(kept) if r.message.sender == "coordinator")
    ]
    cut = tmp_path / "cut.mcap"
    with Writer(cut) as writer:
        writer.start(last.metadata)
        for sender, number in (last.files[0].share or {}).items():
            writer.sequences.begin(sender, number)
        writer.note_share()
        for recorded in begun:
            writer.add(recorded.delivery, recorded.log_time)
        writer.abandon()
    cut.replace(files[len(files) - 1])
    _, past = find_resume_point(log)
    assert (past.tick, past.part) == (last.begins, len(files) - 2)
