"""The replayable parts of a damaged or growing recording."""

import random
import shutil
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.recording.format.records import Chunk
from neurosnap.recording.read.recording import Recording, part_path, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point, whole_ticks
from neurosnap.recording.replay.learn_again import snapshot_at
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.copying import salvage
from neurosnap.recording.write.rotation import Split, SplitWriter
from tests.support.inline_runs import recorded_run
from tests.support.recorded_runs import csv_run, in_chunks, path_run, recorded
from tests.support.rewritten_recordings import changing, overtaken, spoil, write_again
from tests.support.split_runs import SplitRun

EVERY = 7  # ticks from key-frame to key-frame
TICKS = 40
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    log = recorded(path_run(TICKS), folder / "long.mcap")
    return in_chunks(log, folder / "whole.mcap", 12000)


@pytest.fixture
def log(whole: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(whole, tmp_path / "run.mcap"))


@pytest.fixture(scope="module")
def spoiled(
    whole: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Chunk]:
    """Return a recording, and its chunk that is damaged: that of tick 17."""
    log = Path(shutil.copy(whole, tmp_path_factory.mktemp("spoiled") / "run.mcap"))
    return log, spoil(log, 17)


@pytest.mark.parametrize("cut", [False, True])
def test_a_replay_goes_on_behind_the_damage(log: Path, cut: bool) -> None:
    spoil(log, 17, cut=cut)
    verdict = verify(log)
    assert (verdict.same, verdict.complete) == (True, False)
    (first, before), (after, last) = verdict.ranges
    assert (first, last) == (1, TICKS)
    assert 14 <= before < 17 < after
    assert after % EVERY == 1
    assert verdict.missing == ((before + 1, after - 1),)
    assert verdict.ticks == TICKS - (after - 1 - before)
    assert "must have checksum" in verdict.damage[0] or "unpack" in verdict.damage[0]
    behind = verify(log, 30)
    assert behind.ranges == ((29, TICKS),)
    assert (behind.start, behind.missing) == (28, ())


def test_what_was_changed_behind_the_damage_is_found(whole: Path, log: Path) -> None:
    recording = Recording.open(whole)
    change = changing(
        wire.Decision, lambda one: one.tick == 30, lambda _: {"why": "another reason"}
    )
    log.unlink()
    write_again(recording, log, change(list(recording.messages())), chunk=12000)
    spoil(log, 17)
    verdict = verify(log)
    assert not verdict.same
    assert "tick 30" in str(verdict.difference)


def test_info_says_what_is_missing(whole: Path, spoiled: tuple[Path, Chunk]) -> None:
    log, chunk = spoiled
    found = describe(Recording.open(log))
    there = list(Recording.open(log).messages())
    lost = len(list(Recording.open(whole).messages())) - len(there)
    assert lost == sum(chunk.counts.values())
    assert sum(found.completeness.missing.values()) == lost
    states = {m.message.tick for m in there if isinstance(m.message, wire.State)}
    missing = {t for a, b in found.missing_ticks for t in range(a, b + 1)}
    assert missing == set(range(1, TICKS + 1)) - states
    text = "\n".join(render(found))
    assert f"bytes {chunk.start_offset} to {chunk.stop_offset}: chunk" in text
    assert "missing ticks: " in text


def test_what_was_learned_is_known_behind_the_damage(
    whole: Path, spoiled: tuple[Path, Chunk]
) -> None:
    recording, true = Recording.open(spoiled[0]), Recording.open(whole)
    for tick in (None, 10, 21, 30):
        now, snapshot = snapshot_at(recording, tick)
        assert snapshot.to_bytes() == snapshot_at(true, now)[1].to_bytes()
        assert now == (TICKS if tick is None else tick)
    with pytest.raises(RecordingError, match="must hold the observation of tick"):
        snapshot_at(recording, 18)


def test_the_last_tick_known_may_lie_before_the_damage(log: Path) -> None:
    spoil(log, 38)
    ((begin, end),) = verify(log).missing
    assert begin <= 38 < end == TICKS
    recording = Recording.open(log)
    *_, frame = recording.messages(("keyframe",))
    chunks = recording.files[0].layout.chunks
    last = next(chunk for chunk in chunks if chunk.end >= frame.log_time)
    log.write_bytes(log.read_bytes()[: last.start_offset])
    tick, _ = snapshot_at(Recording.open(log))
    assert 35 <= tick < 38


# Going on ------------------------------------------------------------------


def test_a_run_that_needs_no_actions_goes_on_from_behind_the_damage(
    tmp_path: Path,
) -> None:
    options = csv_run(tmp_path / "readings.csv", TICKS)
    short = msgspec.structs.replace(options, ticks=36)
    long = recorded(short, tmp_path / "long.mcap")
    log = in_chunks(long, tmp_path / "run.mcap", 1500)
    spoil(log, 10)
    assert whole_ticks(log) == 36
    _, past = find_resume_point(log, TICKS)
    assert past.tick == 36
    new = tmp_path / "new.mcap"
    outcome = recorded_run(options, new, past=past)
    assert outcome.completeness is not None
    assert not outcome.completeness.whole
    verdict = verify(new)
    assert (verdict.same, verdict.complete) == (True, False)
    assert verdict.ranges[-1][1] == TICKS
    assert verdict.missing == verify(log).missing
    assert "messages are missing" in Recording.open(new).damage[0]


def test_a_run_whose_actions_are_lost_goes_on_from_before_the_damage(
    spoiled: tuple[Path, Chunk],
) -> None:
    before = verify(spoiled[0]).ranges[0][1]
    _, past = find_resume_point(spoiled[0])
    assert past.tick == before
    assert len(past.actions) == before - 1


# Salvaging ------------------------------------------------------------------


@pytest.mark.parametrize("cut", [False, True])
def test_what_is_salvaged_is_all_there_is_and_says_what_is_missing(
    log: Path, tmp_path: Path, cut: bool
) -> None:
    spoil(log, 17, cut=cut)
    good = tmp_path / "good.mcap"
    found = salvage(log, good)
    assert len(found.lost) == 1 + cut
    twice = tmp_path / "twice.mcap"
    salvage(good, twice)
    bad, verdict = Recording.open(log), verify(log)
    for path, of in ((good, "run.mcap"), (twice, "good.mcap")):
        again, same = Recording.open(path), verify(path)
        assert list(again.messages()) == list(bad.messages())
        assert again.files[0].layout.sealed
        assert not again.whole
        assert again.metadata["salvaged"] == of
        assert "messages are missing" in again.damage[0]
        assert (same.ranges, same.missing) == (verdict.ranges, verdict.missing)
        assert (same.same, same.complete) == (True, False)


# In several files ------------------------------------------------------------------


@pytest.fixture
def split(whole: Path, tmp_path: Path) -> Path:
    run = SplitRun(whole, [*Recording.open(whole).messages()], tmp_path / "parts.mcap")
    assert len(run.write()) == TICKS // EVERY + 2
    return run.log


def test_a_file_without_its_key_frame_is_not_joined_to_the_one_before(
    split: Path,
) -> None:
    path = part_paths(split)[2]
    assert spoil(path, 2 * EVERY + 1).number == 1  # in which its key-frame is
    verdict = verify(split)
    assert verdict.same
    assert verdict.ranges[0] == (1, 2 * EVERY)


def test_files_of_a_run_are_salvaged_into_one(
    whole: Path, split: Path, tmp_path: Path
) -> None:
    for log in (split, whole):
        good = tmp_path / f"{log.stem}-good.mcap"
        assert salvage(log, good).lost == ()
        assert verify(good).complete
        assert Recording.open(good).options == Recording.open(whole).options
        true, found = (list(Recording.open(each).messages()) for each in (whole, good))
        assert len(true) == len(found)


@pytest.mark.parametrize(
    ("number", "rule"),
    [
        (0, "must be an MCAP recording"),
        (2, "the next file is missing"),
        (-1, "begun, nothing in it"),
    ],
)
def test_what_is_salvaged_without_one_of_its_files_is_not_whole(
    split: Path, tmp_path: Path, number: int, rule: str
) -> None:
    list(part_paths(split).values())[number].write_bytes(b"no recording")
    good = tmp_path / "good.mcap"
    salvage(split, good)
    assert not Recording.open(good).whole
    assert rule in Recording.open(good).damage[0]
    assert verify(good).ranges == verify(split).ranges


# In several files that a view shows ---------------------------------------------------


def test_a_later_file_stands_for_itself(whole: Path, split: Path) -> None:
    one, later = RunView(whole), RunView(part_path(split, 2))
    first, last = 2 * EVERY + 1, 3 * EVERY
    assert (later.first, later.last) == (first, last)
    # The key-frame that opens the next file holds the decision of the last tick.
    assert later.frames(1, TICKS) == one.frames(first, last)
    assert later.graph(first) == one.graph(first)
    with pytest.raises(InvalidValueError, match=r"^tick: must be in \[15, 21\], got 9"):
        later.graph(9)


def test_files_that_come_and_grow_are_followed(whole: Path, tmp_path: Path) -> None:
    recording, log, view = Recording.open(whole), tmp_path / "run.mcap", None
    with SplitWriter(log, recording.metadata, split=Split(1)) as writer:
        mixed = overtaken(list(recording.messages()), random.Random(1), reach=40)
        for count, each in enumerate(mixed, start=1):
            writer.add(each.delivery, count)
            if count % 50:
                continue
            writer.flush(count)
            view = view or RunView(log)
            view.grow()
            # A file in which nothing is written yet is waited for.
            blank = part_path(log, len(part_paths(log)))
            blank.touch()
            assert not view.grow()
            blank.unlink()
            assert view.frames(1, TICKS) == RunView(log).frames(1, TICKS)
        writer.finish({}, recording.noted().expected)
    assert view is not None
    assert view.grow()
    assert not view.grow()
    one = RunView(whole)
    assert (view.first, view.last, view.cut(live=False)) == (1, TICKS, None)
    assert view.frames(1, TICKS) == one.frames(1, TICKS)
    for tick in (40, 0, 13, 14, 15, 28, 29):
        assert view.graph(tick) == one.graph(tick)


def test_files_deleted_before_or_while_they_are_looked_at_are_left_out(
    whole: Path, split: Path
) -> None:
    view, begin = RunView(split), split.read_bytes()
    assert view.first == 1
    split.unlink()
    assert not view.recording.replaced()
    assert view.grow()
    assert (view.first, view.last) == (EVERY + 1, TICKS)
    assert view.frames(1, TICKS) == RunView(whole).frames(view.first, TICKS)
    assert not view.grow()
    afresh = RunView(split)
    assert (afresh.first, afresh.last) == (view.first, view.last)
    assert afresh.frames(1, TICKS) == view.frames(1, TICKS)
    split.write_bytes(begin)  # the run was taken up again from the start
    assert view.recording.replaced()
