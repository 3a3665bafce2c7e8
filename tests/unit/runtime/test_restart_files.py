"""The files of a restarted run keep every tick."""

import asyncio
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.runtime.request import RunRequest
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.run_with_restarts import run
from tests.support.restart_runs import names, options_of
from tests.support.rewritten_recordings import flipped

Recordings = dict[tuple[int, int], bytes]


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Recordings:
    """Finished recordings, by their ticks and their seed."""
    folder, found = tmp_path_factory.mktemp("runs"), {}
    for ticks, seed in ((5, 3), (30, 3), (60, 3), (30, 4)):
        path = folder / f"{ticks}-{seed}"
        asyncio.run(
            run(RunRequest(options_of(ticks, seed=seed), path), asyncio.Event())
        )
        found[ticks, seed] = path.read_bytes()
    return found


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "run.mcap"


def observed(*files: Path) -> set[tuple[int, bytes]]:
    """Return the readings in all files that can be read."""
    found: set[tuple[int, bytes]] = set()
    for path in files:
        try:
            for recorded in Recording.open(path).messages(("observation",)):
                message = recorded.message
                if isinstance(message, wire.Observation):
                    found.add((message.tick, message.bits))
        except RecordingError:
            continue
    return found


def gone_on(
    lives: RestartFiles, options: RunOptions, before: ResumePoint | None = None
) -> ResumePoint | None:
    """Let a life go on from what there is."""
    return lives.go_on(lives.furthest(options), before)[1]


def test_a_damaged_recording_is_kept_beside(log: Path, recordings: Recordings) -> None:
    log.write_bytes(recordings[30, 3])
    chunk = Recording.open(log).files[0].layout.chunks[0]
    bad = flipped(recordings[30, 3], 8 * (chunk.offset + 10))
    log.write_bytes(bad)
    lives = RestartFiles(log)
    past = gone_on(lives, options_of(30))
    left = log.with_name("run.mcap.broken" if past else "run.damaged-1.mcap")
    assert left.read_bytes() == bad
    # Even once the run has come to its end.
    log.write_bytes(recordings[60, 3])
    lives.finish()
    (kept,) = lives.kept
    assert kept == log.with_name("run.damaged-1.mcap")
    assert kept.read_bytes() == bad
    assert log.read_bytes() == recordings[60, 3]


def test_a_recording_whose_length_is_damaged_is_no_cut_one(
    log: Path, recordings: Recordings
) -> None:
    log.write_bytes(recordings[30, 3])
    chunks = Recording.open(log).files[0].layout.chunks
    # As it grows: without its end. The length of the last chunk is too large then.
    grown = recordings[30, 3][: chunks[-1].offset + chunks[-1].packed + 50]
    length_at = chunks[-1].offset - 8 - 4 - 4 - 28 - 8
    bad = flipped(grown, 8 * (length_at + 3))
    log.write_bytes(bad)
    lives = RestartFiles(log)
    gone_on(lives, options_of(30))
    log.write_bytes(recordings[5, 3])
    lives.finish()
    (kept,) = lives.kept
    assert kept.read_bytes() == bad


def test_readings_that_another_life_did_not_see_are_kept(
    log: Path, recordings: Recordings
) -> None:
    log.write_bytes(recordings[30, 3])
    lives = RestartFiles(log)
    past = gone_on(lives, options_of(30))
    log.write_bytes(recordings[30, 4])  # as many ticks, of another world
    assert gone_on(lives, options_of(30, seed=4), past) == past
    assert names(log.parent) == ["run.damaged-1.mcap", "run.mcap.broken"]
    log.write_bytes(recordings[60, 3])
    lives.finish()
    (kept,) = lives.kept
    assert kept == log.with_name("run.damaged-1.mcap")
    assert kept.read_bytes() == recordings[30, 4]


def test_what_was_gone_on_from_is_kept_for_what_was_observed_otherwise_since(
    log: Path, recordings: Recordings
) -> None:
    log.write_bytes(recordings[30, 4])
    lives = RestartFiles(log)
    past = gone_on(lives, options_of(30, seed=4))
    assert past is not None
    log.write_bytes(recordings[60, 3])  # of another world, and it gets further
    assert gone_on(lives, options_of(60), past) != past
    kept = log.with_name("run.damaged-1.mcap")
    assert lives.kept == {kept: past.tick}
    assert kept.read_bytes() == recordings[30, 4]


def test_what_is_held_is_not_kept(log: Path, recordings: Recordings) -> None:
    log.write_bytes(recordings[30, 3])
    lives = RestartFiles(log)
    assert gone_on(lives, options_of(30, seed=4)) is None  # it is of another run
    assert names(log.parent) == ["run.damaged-1.mcap"]
    log.write_bytes(recordings[60, 3])
    lives.finish()
    assert (lives.kept, names(log.parent)) == ({}, ["run.mcap"])


def test_what_is_kept_gets_the_next_free_name(
    log: Path, recordings: Recordings
) -> None:
    earlier = log.with_name("run.damaged-1.mcap")
    earlier.write_bytes(b"of an earlier run")
    lives = RestartFiles(log)
    for content in (b"no recording" * 9, b"another one" * 9):
        log.write_bytes(content)
        assert gone_on(lives, options_of(30)) is None
    log.touch()  # nothing to keep
    assert gone_on(lives, options_of(30)) is None
    assert [path.name for path in lives.kept] == [
        "run.damaged-2.mcap",
        "run.damaged-3.mcap",
    ]
    assert earlier.read_bytes() == b"of an earlier run"


@pytest.mark.slow
@pytest.mark.usefixtures("many_files")
def test_a_file_behind_a_damaged_one_is_gone_on_from(log: Path) -> None:
    options = options_of(100)
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    last = max(part_paths(log))
    assert last >= 2
    middle = part_paths(log)[last - 1]
    middle.write_bytes(b"no recording" * 9)
    lives = RestartFiles(log)
    # The walker's actions are in all files, so the run begins anew; nothing is lost.
    # A newest file may hold nothing but the end of the run, and no tick.
    before = {
        path.read_bytes()
        for path in part_paths(log).values()
        if path == middle or any(Recording.open(path).messages(("observation",)))
    }
    past = gone_on(lives, options)
    assert {path.read_bytes() for path in log.parent.iterdir()} >= before
    assert past is None or past.part <= last


def test_who_is_killed_between_two_steps_leaves_every_tick(
    tmp_path: Path,
    recordings: Recordings,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rename, unlink, steps = Path.rename, Path.unlink, [0]

    class KilledError(Exception):
        pass

    def step() -> None:
        if not steps[0]:
            raise KilledError
        steps[0] -= 1

    def renamed(path: Path, target: Path) -> Path:
        step()
        return rename(path, target)

    def unlinked(path: Path, missing_ok: bool = False) -> None:
        step()
        unlink(path, missing_ok)

    monkeypatch.setattr(Path, "rename", renamed)
    monkeypatch.setattr(Path, "unlink", unlinked)

    def dance(folder: Path, most: int) -> tuple[bool, int]:
        """Let a run go on and end, at most so many steps; return how far it got."""
        folder.mkdir()
        log, furthest = folder / "run.mcap", 0
        steps[0] = most
        lives, past = RestartFiles(log), None
        try:
            for ticks in (5, 30, 5):
                log.write_bytes(recordings[ticks, 3])
                furthest = max(furthest, ticks)
                past = gone_on(lives, options_of(ticks), past)
            log.write_bytes(recordings[60, 3])
            lives.finish()
        except KilledError:
            return False, furthest
        return True, 60

    folder = tmp_path
    for most in range(100):
        folder = tmp_path / str(most)
        done, furthest = dance(folder, most)
        if done:
            break
        assert len(observed(*folder.iterdir())) >= furthest
        if "run.mcap.broken" in names(folder):
            with pytest.raises(InvalidValueError, match="neurosnap resume FILE"):
                RestartFiles(folder / "run.mcap").check_free()
    # Two lives are moved, the first and an unwanted one deleted, then the second.
    assert most == 5
    assert names(folder) == ["run.mcap"]


def test_of_two_lives_that_saw_other_things_none_is_deleted(
    log: Path, recordings: Recordings
) -> None:
    log.write_bytes(recordings[30, 4])
    log.with_name("run.mcap.broken").write_bytes(recordings[60, 3])
    lives = RestartFiles(log)
    lives.keep_furthest()
    assert log.read_bytes() == recordings[60, 3]
    (kept,) = lives.kept
    assert kept.read_bytes() == recordings[30, 4]
    assert len(names(log.parent)) == 2


@pytest.mark.parametrize(
    ("after", "before", "kept"),
    [
        (60, 30, 60),
        (30, 60, 60),
        (30, 30, 30),
        (0, 5, 5),
        (5, 0, 5),
        (-1, 5, 5),
        (5, -1, 5),
    ],
)
def test_of_two_recordings_the_further_stays(
    after: int,
    before: int,
    kept: int,
    log: Path,
    recordings: Recordings,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of so many ticks each; 0: there is none, -1: it cannot be read."""
    synced: list[tuple[bytes, int]] = []

    def sync(path: Path) -> None:
        synced.append((path.read_bytes(), len(names(log.parent))))

    monkeypatch.setattr("neurosnap.runtime.restart_files.sync_file", sync)
    unread = b"no recording" * 9  # shorter, it could hold no tick
    for path, ticks in ((log, after), (log.with_name("run.mcap.broken"), before)):
        if ticks:
            path.write_bytes(unread if ticks < 0 else recordings[ticks, 3])
    RestartFiles(log).keep_furthest()
    assert log.read_bytes() == recordings[kept, 3]
    # The disk has what stays before the other one is deleted.
    assert synced == ([(recordings[kept, 3], 2)] if min(after, before) > 0 else [])
    # What cannot be read is not deleted: what is in it is unknown.
    aside = {path.read_bytes() for path in log.parent.iterdir() if path != log}
    assert aside == ({unread} if -1 in (after, before) else set())


@pytest.mark.parametrize("content", [b"", bytes(300)], ids=["empty", "zeros"])
@pytest.mark.slow
@pytest.mark.usefixtures("many_files")
def test_a_newest_file_that_a_power_cut_left_blank_is_passed_over(
    content: bytes, log: Path
) -> None:
    options = options_of(60)
    asyncio.run(run(RunRequest(options, log), asyncio.Event()))
    last = max(part_paths(log))
    assert last >= 1
    before = RestartFiles(log).furthest(options)
    assert before is not None
    assert before.part >= 1
    blank = log.with_name(f"run_{last + 1:04d}.mcap")
    blank.write_bytes(content)
    assert RestartFiles(log).furthest(options) == before
