"""Key-frames in several bands: written, read, resumed from, and lost.

With one learner the coordinator sends the bands; with shares each worker sends its own.
"""

from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.poc.learning.snapshot import Snapshot
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.replay_starts import starts
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from tests.support.course import course
from tests.support.inline_runs import recorded_run, spread
from tests.support.recorded_messages import assert_true_run, of_type
from tests.support.replayed_runs import TICKS, Runs, options_for
from tests.support.rewritten_recordings import changing, dropping, rewritten

pytestmark = pytest.mark.slow

FRAMES = [7, 14, 21, 28, 30]


class Banded(NamedTuple):
    """A recorded run whose key-frames are in bands, and the same run without."""

    kind: str
    runs: Runs
    log: Path


def record(runs: Runs, kind: str, log: Path, **changes: Any) -> Path:
    given = {"band": 4, "workers": 1, **changes}
    options = msgspec.structs.replace(options_for(runs.csv), **given)
    recorded_run(spread(options) if kind == "shares" else options, log)
    return log


@pytest.fixture(scope="module", params=["one learner", "shares"])
def banded(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Banded:
    folder = tmp_path_factory.mktemp("banded")
    runs = Runs(folder)
    log = record(runs, request.param, folder / "log")
    return Banded(request.param, runs, log)


def known_in(snapshot: Snapshot) -> bytes:
    """Return what was learned, without the state."""
    snapshot.adopt(np.zeros(10, np.bool_))
    return snapshot.to_bytes()


def test_each_key_frame_is_followed_by_its_bands(banded: Banded) -> None:
    log = banded.log
    frames = of_type(log, wire.KeyFrame)
    assert [frame.tick for frame in frames] == FRAMES
    # Ten pairs, four of them in a band, of counts and of dates. Of shares one worker
    # has the pairs of four sensors, six, and the other four.
    assert [frame.bands for frame in frames] == [6] * 5
    bands = of_type(log, wire.Band)
    assert sorted(band.tick for band in bands) == sorted(FRAMES * 6)
    assert {(band.who, band.offset) for band in bands} == (
        {("worker/0", 0), ("worker/0", 4), ("worker/1", 6)}
        if banded.kind == "shares"
        else {("coordinator", offset) for offset in (0, 4, 8)}
    )
    assert_true_run(log, ticks=TICKS)
    assert course(log) == course(banded.runs.of("csv").log)


def test_what_was_learned_is_read_from_them(banded: Banded) -> None:
    log, whole = banded.log, Recording.open(banded.runs.of("csv").log)
    for tick in (7, 10, 28, 30):
        _, learned = snapshot_at(Recording.open(log), tick)
        _, without = snapshot_at(whole, tick)
        assert known_in(learned) == known_in(without)
        assert known_in(RunView(log).learned(tick).snapshot) == known_in(without)
    assert [start.frame.tick for start in starts(Recording.open(log))][-1] == 30


def test_they_go_into_the_file_that_their_key_frame_begins(
    banded: Banded, tmp_path: Path
) -> None:
    old, split = Recording.open(banded.log), tmp_path / "split.mcap"
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
        assert_true_run(path)
    assert verify(split).ticks == TICKS
    _, past = find_resume_point(split)
    assert (past.tick, past.part) == (TICKS, len(files) - 1)
    # If the last file's key-frame is not whole, the run goes on from the one before.
    last = Recording.open(files[len(files) - 1])
    kept = [r for r in last.messages() if not isinstance(r.message, wire.Band)]
    frame = next(i for i, r in enumerate(kept) if isinstance(r.message, wire.KeyFrame))
    cut = tmp_path / "cut.mcap"
    with Writer(cut) as writer:
        writer.start(last.metadata)
        for sender, number in (last.files[0].share or {}).items():
            writer.sequences.begin(sender, number)
        writer.write_share()
        for recorded in kept[: frame + 1]:
            writer.add(recorded.delivery, recorded.log_time)
        writer.abandon()
    cut.replace(files[len(files) - 1])
    _, past = find_resume_point(split)
    assert (past.tick, past.part) == (last.begins, len(files) - 2)


def test_a_lost_band_makes_its_recording_incomplete_and_not_different(
    banded: Banded, tmp_path: Path
) -> None:
    lost = dropping(wire.Band, lambda band: band.tick == 14)
    lossy = rewritten(banded.log, tmp_path / "lossy", lost)
    assert [one.frame.tick for one in starts(Recording.open(lossy))] == [7, 21, 28, 30]
    verdict = verify(lossy)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, False, TICKS)
    assert verify(lossy, 15).start == 7
    _, learned = snapshot_at(Recording.open(lossy), 15)
    _, whole = snapshot_at(Recording.open(banded.log), 15)
    assert known_in(learned) == known_in(whole)


def test_lost_learning_ends_what_can_be_derived(banded: Banded, tmp_path: Path) -> None:
    if banded.kind != "shares":
        return  # one learner publishes nothing of it
    lost = dropping(wire.Learned, lambda learned: learned.tick == 9)
    verdict = verify(rewritten(banded.log, tmp_path / "lossy", lost))
    assert verdict.difference is None
    assert not verdict.complete
    assert (1, 8) in verdict.ranges


BAND = "/band "
WRONG: list[tuple[type[wire.Message], int, dict[str, Any], str]] = [
    (wire.Band, 14, {"data": memoryview(b"\7" * 16)}, BAND),
    (wire.Band, 14, {"array": "clock"}, BAND),
    (wire.Band, 14, {"offset": 5}, BAND),
    (wire.Learned, 12, {"codes": b"\3", "rows": b"\1\0\0\0"}, "/learned"),
    (wire.Learn, 14, {"bits": b"\0"}, "/learn"),
]


@pytest.mark.parametrize(("kind", "tick", "changes", "topic"), WRONG)
def test_what_does_not_follow_is_found(
    banded: Banded,
    tmp_path: Path,
    kind: type[wire.Message],
    tick: int,
    changes: dict[str, Any],
    topic: str,
) -> None:
    if banded.kind != "shares" and kind is not wire.Band:
        return  # one learner publishes nothing of it
    wrong = changing(kind, lambda m: getattr(m, "tick", 0) == tick, lambda _: changes)
    verdict = verify(rewritten(banded.log, tmp_path / "wrong", wrong))
    assert not verdict.same
    assert str(verdict.difference).startswith(f"tick {tick}: {topic}")
