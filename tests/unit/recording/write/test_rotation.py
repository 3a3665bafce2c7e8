"""A recording in several files: each a run by itself, and all together the run."""

import random
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.protocol import Place
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import (
    Recording,
    first_path,
    part_path,
    part_paths,
)
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import Split, SplitWriter
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.parts.recorder_process import split_of
from tests.support.rewritten_recordings import overtaken
from tests.support.split_runs import (
    EVERY,
    SMALL,
    TICKS,
    content,
    options,
    write,
)

# Each by itself, and all together -----------------------------------------------------


@pytest.mark.parametrize("seed", [None, 0, 1])
def test_every_file_is_a_run_and_all_together_are_the_run(
    whole: Path, tmp_path: Path, seed: int | None
) -> None:
    recorded = list(Recording.open_file(whole).messages())
    decisions = {
        one.message.tick: one.message
        for one in recorded
        if isinstance(one.message, wire.Decision)
    }
    if seed is not None:
        recorded = overtaken(recorded, random.Random(seed), reach=40)
    paths = write(whole, tmp_path / "log.mcap", recorded)
    assert list(paths) == list(range(TICKS // EVERY + 1))
    ends: dict[str, int] = {}
    for number, path in paths.items():
        recording, begins = Recording.open_file(path), number * EVERY
        assert recording.cut is None
        assert (recording.part, recording.begins) == (number, begins)
        assert recording.completeness() == recording.noted().completeness
        assert recording.completeness().whole
        share, upcoming = recording.files[0].share, recording.noted().expected
        assert share is not None
        assert all(share.get(who, 0) == end for who, end in ends.items())
        ends, closing, tick = upcoming, recording.closing, begins + EVERY
        last = number == len(paths) - 1
        if last:
            assert closing is None
        else:
            assert closing is not None
            # That of the run's last tick is told to nobody; the key-frame has it.
            assert closing == decisions.get(tick, closing)
            assert closing.tick == tick
        if number:
            verdict = verify(path)
            assert (verdict.difference, verdict.complete) == (None, True)
            assert (verdict.start, verdict.ticks) == (begins, 0 if last else EVERY)
            # With the one that opens it, and the one that closes it.
            assert last or verdict.decisions == EVERY + 1
    assert Recording.open(paths[0]).closing is None
    assert content(Recording.open(paths[0]).messages()) == content(recorded)
    alone, verdict = verify(whole), verify(paths[0])
    assert (verdict.same, verdict.complete, verdict.start) == (True, True, 0)
    assert verdict.files == len(paths)
    counts = ("ticks", "wirings", "waves", "states", "decisions")
    assert [getattr(verdict, n) for n in counts] == [getattr(alone, n) for n in counts]
    snapshot = Recording.open_file(whole).files[-1].snapshot
    assert Recording.open(paths[0]).files[-1].snapshot == snapshot
    said = render(describe(Recording.open_file(paths[1])))
    assert f"files: {len(paths)}\n" in said
    assert "\tlog.mcap\n\tlog_0001.mcap\n" in said


def test_every_file_says_where_parts_are(whole: Path, tmp_path: Path) -> None:
    old, places = Recording.open_file(whole), {"world": Place("oak", 4711)}
    log = tmp_path / "log.mcap"
    with SplitWriter(log, old.metadata, split=SMALL) as writer:
        writer.write_places(places)
        for count, one in enumerate(old.messages()):
            writer.add(one.delivery, 10**18 + count)
        writer.finish({}, old.noted().expected)
    paths = part_paths(log)
    assert len(paths) > 1
    assert all(
        Recording.open_file(path).files[-1].places == places for path in paths.values()
    )
    assert Recording.open(log).files[-1].places == places
    assert verify(log).same


def deeper(one: Recorded) -> wire.Message:
    """Change the state of tick 25."""
    message = one.message
    if not isinstance(message, wire.State) or message.tick != 25:
        return message
    return msgspec.structs.replace(message, depth=message.depth + 1)


def decided_otherwise(one: Recorded) -> wire.Message:
    """Change the decision that a file ends with, and the next one begins with."""
    message = one.message
    if not isinstance(message, wire.KeyFrame | wire.Decision) or message.tick != 30:
        return message
    return msgspec.structs.replace(message, why="for fun")


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (deeper, "tick 25: "),
        (
            decided_otherwise,
            "tick 30: the decision of the last tick: recorded Decision(",
        ),
    ],
)
def test_what_is_tampered_with_is_found_in_its_file(
    whole: Path, tmp_path: Path, change: Callable[[Recorded], wire.Message], rule: str
) -> None:
    changed = [
        one._replace(message=(message := change(one)), payload=wire.encode(message))
        for one in Recording.open_file(whole).messages()
    ]
    paths = write(whole, tmp_path / "log.mcap", changed)
    found = {number: verify(path) for number, path in paths.items() if number}
    assert [number for number, verdict in found.items() if not verdict.same] == [2]
    assert str(found[2].difference).startswith(rule)
    assert not verify(paths[0]).same


def test_a_closing_decision_that_is_none_is_refused(
    whole: Path, tmp_path: Path
) -> None:
    with Writer(tmp_path / "log.mcap") as writer:
        writer.start(Recording.open_file(whole).metadata)
        writer.finish({"decision": '{"tick": -1}'}, {})
    with pytest.raises(RecordingError, match=r"decision: must hold a decision, got "):
        _ = Recording.open_file(tmp_path / "log.mcap").closing


# Which are kept, what they are called -------------------------------------------------


def test_the_newest_are_kept(whole: Path, tmp_path: Path) -> None:
    log, messages = tmp_path / "log.mcap", Recording.open_file(whole).messages()
    paths = write(whole, log, messages, split=Split(1, keep=2))
    assert list(paths) == [TICKS // EVERY - 1, TICKS // EVERY]
    verdict = verify(log)  # though the first is gone
    assert (verdict.same, verdict.complete) == (True, True)
    assert (verdict.start, verdict.ticks) == (TICKS - EVERY, EVERY)


def test_a_file_that_is_missing_between_is_noticed(whole: Path, tmp_path: Path) -> None:
    paths = write(whole, tmp_path / "log.mcap", Recording.open_file(whole).messages())
    paths[3].unlink()
    verdict = verify(paths[0])
    assert not verdict.complete
    assert verdict.same
    lost = (3 * EVERY + 1, 4 * EVERY)
    assert verdict.missing == (lost,)
    assert verdict.ranges == ((1, lost[0] - 1), (lost[1] + 1, TICKS))
    assert "log_0004.mcap: the file before it is missing" in verdict.damage[0]


def test_a_gap_that_one_of_them_notes_is_the_runs(whole: Path, tmp_path: Path) -> None:
    recorded = list(Recording.open_file(whole).messages())
    paths = write(whole, tmp_path / "log.mcap", recorded)
    old, copy = Recording.open_file(paths[0]), tmp_path / "copy.mcap"
    with Writer(copy) as writer:
        writer.start(old.metadata)
        writer.write_share()
        for one in old.messages():
            writer.add(one.delivery, one.log_time)
        writer.write_gap("bytes 5 to 9 of another file: damaged")
        writer.finish(old.totals or {}, old.noted().expected)
    assert Recording.open(paths[0]).completeness().whole
    copy.replace(paths[0])
    completeness = Recording.open(paths[0]).completeness()
    assert (completeness.gaps, completeness.whole) == (1, False)
    assert not verify(paths[0]).complete


@pytest.mark.parametrize("number", [1, 3])  # the next one, or one behind it
def test_a_file_in_the_way_is_not_overwritten(
    whole: Path, tmp_path: Path, number: int
) -> None:
    log = tmp_path / "log.mcap"
    other = part_path(log, number)
    other.write_bytes(b"another's")
    rule = rf"must not exist yet, got .*log_000{number}"
    with pytest.raises(RecordingError, match=rule):
        SplitWriter(log, Recording.open(whole).metadata, split=SMALL)
    assert other.read_bytes() == b"another's"
    assert list(tmp_path.iterdir()) == [other]


def test_files_have_names_in_order() -> None:
    log = Path("at/run.v2.mcap")
    names = [part_path(log, number) for number in (0, 1, 12, 9999)]
    assert names == sorted(names)
    assert [
        first_path(path, n) for path, n in zip(names, (0, 1, 12, 9999), strict=True)
    ] == [log] * 4


def test_options_know_the_smallest_file() -> None:
    given = msgspec.structs.asdict(options())
    with pytest.raises(
        InvalidValueError, match=r"^split: must be 0, or at least 65536"
    ):
        RunOptions(**{**given, "split": 65535})
    with pytest.raises(InvalidValueError, match=r"^keep: must come with split, got 2"):
        RunOptions(**{**given, "split": 0, "keep": 2})
    with pytest.raises(InvalidValueError, match=r"^keep: must go with a source that"):
        RunOptions(**{**given, "split": 65536, "keep": 2})
    still = {**given, "body": Body(own=("s0",)), "split": 65536, "keep": 2}
    assert split_of(RunOptions(**still)) == Split(65536, 2)
    assert split_of(options()) is None
