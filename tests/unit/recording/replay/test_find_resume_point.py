"""A run resumes after its last complete tick, in one file and in several."""

import gc
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

import msgspec
import psutil
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_path
from neurosnap.recording.replay import find_resume_point as module
from neurosnap.recording.replay.find_resume_point import (
    find_resume_point,
    restore,
    whole_ticks,
)
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.recording.write.writer import Writer
from tests.golden.drive import drive, record
from tests.golden.scenarios import rows
from tests.support.course import course
from tests.support.recorded_messages import assert_true_run
from tests.support.rewritten_recordings import (
    changing,
    flipped,
    rewritten,
    write_again,
)
from tests.support.scripted_sources import Scripted
from tests.support.split_runs import EVERY, SMALL, TICKS, SplitRun, made, silenced

OPTIONS = RunOptions(
    source="scripted",
    body=Body(own=tuple("abcdef")),
    ticks=40,
    threshold=0.06,
    keyframe_every=10,
)
ROWS = rows(OPTIONS.ticks, 3)


def test_a_run_that_got_no_further_says_once_where_it_went_on(tmp_path: Path) -> None:
    past = None
    for life, until in enumerate((15, 15, 25)):
        log = tmp_path / f"{life}.mcap"
        driven = drive(OPTIONS, Scripted(ROWS), past=past, until=until)
        record(driven, OPTIONS, log, past)
        _, past = find_resume_point(log, min(until, driven.core.tick))
        assert past.resumed == ((15,), (15,), (15, 25))[life]
    driven = drive(OPTIONS, Scripted(ROWS), past=past)
    record(driven, OPTIONS, tmp_path / "end.mcap", past)
    assert Recording.open(tmp_path / "end.mcap").resumed == (15, 25)


@pytest.mark.parametrize(("last", "start"), [(20, 0), (21, 10), (40, 10), (41, 20)])
def test_a_key_frame_counts_once_every_cell_has_reported_on_a_later_wave(
    last: int, start: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A report on its own wave is no proof that nothing before it was lost."""
    log = tmp_path / "log.mcap"
    record(drive(OPTIONS, Scripted(ROWS)), OPTIONS, log)
    recording = Recording.open(log)
    last_waves = {"cell/0": 80, "cell/1": last}
    monkeypatch.setattr(module, "_reported", lambda _: last_waves)
    found = module._start(recording, None)
    assert (0 if found is None else found.frame.tick) == start


def test_what_damage_took_keeps_its_number(tmp_path: Path) -> None:
    """Else another message gets it, and nothing shows that one is missing."""
    whole, log = tmp_path / "whole.mcap", tmp_path / "log.mcap"
    record(drive(OPTIONS, Scripted(ROWS)), OPTIONS, whole)
    recording = Recording.open(whole)
    write_again(recording, log, recording.messages(), chunk=1)
    frame = next(
        one.sequence
        for one in recording.messages(("keyframe",))
        if isinstance(one.message, wire.KeyFrame) and one.message.tick == 20
    )
    (file,) = Recording.open_file(log).files
    # The last of the tick before the key-frame.
    lost = next(
        chunk
        for chunk in file.layout.chunks
        for one in file.chunk(chunk).of_topic("reached")
        if one.sequence == frame - 1
    )
    data = bytearray(log.read_bytes())
    data[lost.offset + lost.packed // 2] ^= 1
    log.write_bytes(data)
    _, past = find_resume_point(log, 20)
    assert past.tick == 20
    assert past.counts["coordinator"] == frame


# In its last file ---------------------------------------------------------------------


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
@pytest.mark.slow
def test_a_run_goes_on_in_its_last_file(run: SplitRun, share: float) -> None:
    paths = run.write()
    paths[5].unlink()
    paths[6].unlink()
    chunks = Recording.open(paths[4]).files[0].layout.chunks
    cut = run.log.with_name("cut.mcap")
    cut.write_bytes(paths[4].read_bytes()[: chunks[int(share * len(chunks))].offset])
    paths[4].write_bytes(cut.read_bytes())
    _, past = find_resume_point(run.log)
    assert (past.log, past.part, past.begins) == (str(paths[4]), 4, 4 * EVERY)
    assert 4 * EVERY <= past.tick < 5 * EVERY
    assert past.tick == whole_ticks(run.log)
    assert len(past.actions) == past.tick - 1
    paths[4].unlink()
    made(run.log, run.workers, msgspec.structs.replace(past, log=str(cut)))
    assert not part_path(cut, 4).exists()
    again = verify(run.log)
    assert (again.difference, again.complete, again.ticks) == (None, True, TICKS)
    assert verify(paths[4]).same
    assert course(run.log) == course(run.whole)


@pytest.mark.usefixtures("small")
def test_a_run_that_goes_on_where_a_file_begins_says_so_in_that_file(
    run: SplitRun,
) -> None:
    """The head alone is larger than a file should be."""
    run.write()
    _, past = find_resume_point(run.log, 2 * EVERY)
    assert (past.tick, past.part) == (2 * EVERY, 2)
    new = run.log.with_name("new.mcap")
    made(new, run.workers, past)
    verdict = assert_true_run(part_path(new, 2))
    assert (verdict.start, verdict.ticks) == (2 * EVERY, EVERY)


def test_behind_a_file_without_end_nothing_counts(run: SplitRun) -> None:
    """What a file lacks at its end, the next one is based on."""
    path = run.write()[2]
    layout = Recording.open(path).files[0].layout
    path.write_bytes(path.read_bytes()[: layout.chunks[-8].offset])
    _, past = find_resume_point(run.log)
    assert (past.part, past.begins) == (2, 2 * EVERY)
    assert 2 * EVERY <= past.tick < 3 * EVERY


def test_where_it_cannot_go_on_no_file_is_left_open(whole: Path, log: Path) -> None:
    change = changing(
        wire.State,
        lambda state: state.tick == TICKS,
        lambda state: {"literals": flipped(state.literals)},
    )
    rewritten(whole, log, change)
    gc.disable()  # a cycle is collected at any moment
    try:
        with suppress(RecordingError):
            find_resume_point(log)
        assert str(log) not in {file.path for file in psutil.Process().open_files()}
    finally:
        gc.enable()


def test_without_its_first_files_a_world_that_acts_cannot_go_on(run: SplitRun) -> None:
    paths = run.write()
    paths[1].unlink()
    rule = r"must have its decisions of ticks 1 to 59, to do them again, got 49"
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(paths[6])


# What a key-frame proves --------------------------------------------------------------


def cut_off(run: SplitRun, heard: Iterable[Recorded]) -> None:
    """Record what was heard in one file without an end."""
    with Writer(run.log) as writer:
        writer.start(Recording.open(run.whole).metadata)
        for one in heard:
            writer.add(one.delivery, one.log_time)


def test_a_key_frame_is_no_proof_that_all_before_it_is_there(run: SplitRun) -> None:
    """Somebody's messages are lost from before a key-frame on, and nobody else's."""
    lost = run.messages[run.last_of(2 * EVERY)]
    until = len(run.upto(3 * EVERY)) + 1
    cut_off(run, silenced(run.messages[:until], lost))
    _, past = find_resume_point(run.log)
    assert past.tick == 2 * EVERY - 1
    core = restore(past, TICKS)
    assert (core.tick, core.in_flight) == (past.tick, ())
    assert whole_ticks(run.log) == past.tick


def test_nor_is_the_key_frame_that_another_file_begins_with(run: SplitRun) -> None:
    """The last message before it is lost, and its sender says nothing behind it."""
    place, lost = run.frame(2 * EVERY)[0], run.last_of(2 * EVERY)
    metadata = Recording.open(run.whole).metadata
    with SplitWriter(run.log, metadata, split=SMALL) as writer:
        for number, one in enumerate(run.messages[: place + 1]):
            if number != lost:
                writer.add(one.delivery, one.log_time)
        # So long after that nobody waits any more, and the file before gets its end.
        late = run.messages[place + 1]
        writer.add(late.delivery, late.log_time + 10**12)
        writer.flush(late.log_time + 10**12)
    assert Recording.open(part_path(run.log, 1)).cut is None
    assert Recording.open(part_path(run.log, 2)).begins == 2 * EVERY
    _, past = find_resume_point(run.log)
    assert (past.tick, past.part) == (2 * EVERY - 1, 1)
    assert whole_ticks(run.log) == past.tick


def test_what_is_restored_is_derived_from_the_last_key_frame_alone(
    run: SplitRun,
) -> None:
    """What was looked back on goes no further back: there it may lack something."""
    _, past = find_resume_point(run.whole, 3 * EVERY + 5)
    lost = run.last_of(3 * EVERY)
    cut_off(run, [*run.messages[:lost], *run.messages[lost + 1 :]])
    core = restore(msgspec.structs.replace(past, log=str(run.log)), TICKS)
    assert (core.tick, core.in_flight) == (3 * EVERY + 5, ())
