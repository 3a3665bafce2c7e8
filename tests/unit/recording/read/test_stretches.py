"""What can be derived of a run with damage in the middle, by each who derives."""

import asyncio
import shutil
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.apps.export.write import export
from neurosnap.apps.viewer.run_view import RunView
from neurosnap.depth.measure import from_recording
from neurosnap.errors import RecordingError
from neurosnap.recording.format.records import Chunk
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.read.stretches import stretches
from neurosnap.recording.read.ticks import ticks
from neurosnap.recording.replay.learning import snapshot_at
from neurosnap.recording.replay.resume import find_resume_point, past_of, whole_ticks
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.copying import salvage
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.run import run
from tests.support.recorded_runs import csv_run, in_chunks, path_run, recorded

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


def flip(log: Path, chunk: Chunk, *, end: int | None = None) -> None:
    """Change a byte of a chunk, and leave out what is behind `end`."""
    data = bytearray(log.read_bytes())
    data[chunk.offset + chunk.packed // 2] ^= 1
    log.write_bytes(data[:end])


def spoil(log: Path, tick: int, *, cut: bool = False) -> Chunk:
    """Change a byte of the chunk in which a tick was observed; return the chunk.

    Args:
        log: A recording.
        tick: The tick.
        cut: Take away its end as well.
    """
    recording = Recording.open(log)
    found = next(
        chunk
        for chunk in recording.files[0].layout.chunks
        for one in recording.messages(
            ("observation",), start=chunk.start, end=chunk.end
        )
        if isinstance(one.message, wire.Observation) and one.message.tick == tick
    )
    flip(log, found, end=-200 if cut else None)
    return found


def test_an_intact_recording_is_one_stretch(log: Path) -> None:
    recording = Recording.open(log)
    assert stretches(recording) == [recording]
    assert recording.whole


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
    def wrong(message: wire.Message) -> wire.Message:
        if isinstance(message, wire.Decision) and message.tick == 30:
            return msgspec.structs.replace(message, why="another reason")
        return message

    recording = Recording.open(whole)
    log.unlink()
    with Writer(log, chunk=12000) as writer:
        writer.start(recording.metadata)
        for each in recording.messages():
            payload = wire.encode(wrong(each.message))
            writer.add(each.delivery._replace(payload=payload), each.log_time)
        writer.finish({}, recording.noted().expected)
    spoil(log, 17)
    verdict = verify(log)
    assert not verdict.same
    assert "tick 30" in str(verdict.difference)


def test_info_says_what_is_missing(whole: Path, log: Path) -> None:
    chunk = spoil(log, 17)
    found = describe(Recording.open(log))
    there = list(Recording.open(log).messages())
    everything = list(Recording.open(whole).messages())
    lost = len(everything) - len(there)
    assert lost == sum(chunk.counts.values())
    assert sum(found.completeness.missing.values()) == lost
    states = {m.message.tick for m in there if isinstance(m.message, wire.State)}
    missing = {t for a, b in found.missing_ticks for t in range(a, b + 1)}
    assert missing == set(range(1, TICKS + 1)) - states
    text = render(found)
    assert f"bytes {chunk.start_offset} to {chunk.stop_offset}: chunk" in text
    assert "missing ticks: " in text


def test_what_was_learned_is_known_behind_the_damage(whole: Path, log: Path) -> None:
    spoil(log, 17)
    recording = Recording.open(log)
    true = Recording.open(whole)
    for tick in (None, 10, 21, 30):
        now, snapshot = snapshot_at(recording, tick)
        assert snapshot.to_bytes() == snapshot_at(true, now)[1].to_bytes()
        assert now == (TICKS if tick is None else tick)
    with pytest.raises(RecordingError, match="must hold the observation of tick"):
        snapshot_at(recording, 18)


def test_the_last_tick_known_may_lie_before_the_damage(log: Path) -> None:
    spoil(log, 38)
    recording = Recording.open(log)
    *_, frame = recording.messages(("keyframe",))
    chunks = recording.files[0].layout.chunks
    last = next(chunk for chunk in chunks if chunk.end >= frame.log_time)
    log.write_bytes(log.read_bytes()[: last.start_offset])
    tick, _ = snapshot_at(Recording.open(log))
    assert 35 <= tick < 38


def test_waves_of_which_the_start_is_lost_are_not_measured(
    whole: Path, log: Path
) -> None:
    spoil(log, 17)
    rows = from_recording(Recording.open(log))
    assert 0 < len(rows) < len(from_recording(Recording.open(whole)))


def test_an_export_has_the_ticks_there_are(whole: Path, log: Path) -> None:
    spoil(log, 17)
    true = {tick.number: tick for tick in ticks(Recording.open(whole))}
    found = {tick.number: tick for tick in ticks(Recording.open(log))}
    assert all(found[k].state in (None, true[k].state) for k in found)
    assert {1, TICKS} < found.keys() < true.keys()
    for form in ("csv", "graphml"):
        exported = export(log, form)
        assert not exported.whole
        assert exported.damage


def test_a_view_shows_the_ticks_there_are(whole: Path, log: Path) -> None:
    spoil(log, 17)
    true = {frame.tick: frame for frame in RunView(whole).frames(1, TICKS)}
    view = RunView(log)
    found = {frame.tick: frame for frame in view.frames(1, TICKS)}
    assert {1, TICKS} < found.keys() < true.keys()
    assert found[30] == true[30]
    assert view.cut is not None
    assert "chunk" in view.cut


def test_a_view_without_its_summary_goes_on_behind_a_damaged_head(
    whole: Path, log: Path
) -> None:
    chunk = spoil(log, 17, cut=True)
    data = bytearray(log.read_bytes())
    data[chunk.start_offset] ^= 8  # what kind of record it is
    log.write_bytes(data)
    view = RunView(log)
    found = {frame.tick: frame for frame in view.frames(1, TICKS)}
    true = {frame.tick: frame for frame in RunView(whole).frames(1, TICKS)}
    assert found[30] == true[30]
    assert {1, TICKS} < found.keys() < true.keys()


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
    past = past_of(log, options)
    assert past.tick == 36
    new = tmp_path / "new.mcap"
    outcome = asyncio.run(run(RunRequest(options, new, past), asyncio.Event()))
    assert outcome.completeness is not None
    assert not outcome.completeness.whole
    verdict = verify(new)
    assert (verdict.same, verdict.complete) == (True, False)
    assert verdict.ranges[-1][1] == TICKS
    assert verdict.missing == verify(log).missing
    assert "messages are missing" in Recording.open(new).damage[0]


def test_a_run_whose_actions_are_lost_goes_on_from_before_the_damage(
    log: Path,
) -> None:
    spoil(log, 17)
    before = verify(log).ranges[0][1]
    _, past = find_resume_point(log)
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
    bad, again = Recording.open(log), Recording.open(good)
    assert [m.delivery for m in again.messages()] == [
        m.delivery for m in bad.messages()
    ]
    assert again.files[0].layout.sealed
    assert not again.whole
    assert again.metadata["salvaged"] == "run.mcap"
    assert "messages are missing" in again.damage[0]
    one, other = verify(log), verify(good)
    assert (one.ranges, one.missing, one.same) == (
        other.ranges,
        other.missing,
        other.same,
    )
    assert not other.complete
    assert RunView(good).frames(1, TICKS) == RunView(log).frames(1, TICKS)
    twice = tmp_path / "twice.mcap"
    salvage(good, twice)
    assert verify(twice).ranges == one.ranges


def test_nothing_is_overwritten_by_what_is_salvaged(log: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes(b"another's")
    for taken in (other, log):
        before = taken.read_bytes()
        with pytest.raises(RecordingError, match="must not exist yet"):
            salvage(log, taken)
        assert taken.read_bytes() == before


# In several files ------------------------------------------------------------------


@pytest.fixture
def split(whole: Path, tmp_path: Path) -> Path:
    recording, log = Recording.open(whole), tmp_path / "parts.mcap"
    with SplitWriter(log, recording.metadata, split=Split(1)) as writer:
        for each in recording.messages():
            writer.add(each.delivery, each.log_time)
        writer.finish({}, recording.noted().expected)
    assert len(part_paths(log)) == TICKS // EVERY + 2
    return log


def test_a_file_that_is_lost_is_skipped(split: Path, tmp_path: Path) -> None:
    part_paths(split)[2].write_bytes(b"")
    verdict = verify(split)
    lost = (2 * EVERY + 1, 3 * EVERY)
    assert verdict.missing == (lost,)
    assert verdict.ranges == ((1, 2 * EVERY), (3 * EVERY + 1, TICKS))
    assert not verdict.complete
    assert "must be an MCAP recording" in verdict.damage[0]
    good = tmp_path / "good.mcap"
    salvage(split, good)
    assert verify(good).ranges == verdict.ranges


def test_a_file_without_its_key_frame_is_not_joined_to_the_one_before(
    split: Path,
) -> None:
    path = part_paths(split)[2]
    flip(path, Recording.open(path).files[0].layout.chunks[0])
    verdict = verify(split)
    assert verdict.same
    assert verdict.ranges[0] == (1, 2 * EVERY)


def test_files_of_a_run_are_salvaged_into_one(
    whole: Path, split: Path, tmp_path: Path
) -> None:
    good = tmp_path / "good.mcap"
    assert salvage(split, good).lost == ()
    assert verify(good).complete
    true, found = (list(Recording.open(log).messages()) for log in (whole, good))
    assert len(true) == len(found)
    again = tmp_path / "again.mcap"
    assert salvage(whole, again).lost == ()
    assert verify(again).complete
    assert Recording.open(good).options == Recording.open(whole).options


@pytest.mark.parametrize("number", [0, -1])
def test_what_is_salvaged_without_its_first_or_last_file_is_not_whole(
    split: Path, tmp_path: Path, number: int
) -> None:
    list(part_paths(split).values())[number].write_bytes(b"no recording")
    good = tmp_path / "good.mcap"
    salvage(split, good)
    assert not Recording.open(good).whole
    assert "must be an MCAP recording" in Recording.open(good).damage[0]
