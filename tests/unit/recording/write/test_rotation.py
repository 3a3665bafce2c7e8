"""Each file of a split recording replays alone, and together they give the run."""

import errno
import random
from collections.abc import Callable, Iterable
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.apps.cli.recording_info import describe, render
from neurosnap.errors import RecordingError
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_path, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import LATE, Split, SplitWriter
from neurosnap.runtime.parts.recorder_process import split_of
from tests.support.recorded_messages import assert_true_run
from tests.support.rewritten_recordings import overtaken
from tests.support.split_runs import (
    EVERY,
    NOW,
    SMALL,
    TICKS,
    SplitRun,
    content,
    made,
    options,
    said,
    silenced,
)


def added(writer: SplitWriter, heard: Iterable[wire.Delivery]) -> None:
    """Record what was heard."""
    for one in heard:
        writer.add(one, NOW)


def ended(
    run: SplitRun, heard: Iterable[Recorded], *, more: Iterable[str] = ()
) -> Completeness:
    """Record what was heard, and end it as if that was all, and one more of `more`."""
    metadata = Recording.open_file(run.whole).metadata
    with SplitWriter(run.log, metadata, split=SMALL) as writer:
        senders = set(more)
        for one in heard:
            writer.add(one.delivery, NOW)
            senders.add(one.message.sender)
        ends = {who: writer.upcoming(who) + (who in more) for who in senders}
        return writer.finish({}, ends)


def each_file(log: Path) -> list[Recording]:
    return [Recording.open_file(path) for path in part_paths(log).values()]


def missing(log: Path) -> list[dict[str, int]]:
    """Return what each file says that it lacks."""
    return [file.noted().completeness.missing for file in each_file(log)]


# Each by itself, and all together -----------------------------------------------------


@pytest.mark.parametrize("seed", [None, 0, 1])
@pytest.mark.slow
def test_every_file_is_a_run_and_all_together_are_the_run(
    run: SplitRun, seed: int | None
) -> None:
    decisions = {
        one.message.tick: one.message
        for one in run.messages
        if isinstance(one.message, wire.Decision)
    }
    heard = run.messages
    if seed is not None:
        heard = overtaken(run.messages, random.Random(seed), reach=40)
    paths = run.write(heard)
    assert list(paths) == list(range(TICKS // EVERY + 1))
    ends: dict[str, int] = {}
    for number, path in paths.items():
        recording, begins = Recording.open_file(path), number * EVERY
        assert recording.cut is None
        assert (recording.part, recording.begins) == (number, begins)
        assert (
            recording.balance(recording.sequences()) == recording.noted().completeness
        )
        assert recording.balance(recording.sequences()).whole
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
            verdict = assert_true_run(path)
            assert (verdict.start, verdict.ticks) == (begins, 0 if last else EVERY)
            # With the one that opens it, and the one that closes it.
            assert last or verdict.decisions == EVERY + 1
    assert Recording.open(run.log).closing is None
    assert content(Recording.open(run.log).messages()) == content(heard)
    alone, verdict = verify(run.whole), verify(run.log)
    assert (verdict.same, verdict.complete, verdict.start) == (True, True, 0)
    assert verdict.files == len(paths)
    counts = ("ticks", "wirings", "waves", "states", "decisions")
    assert [getattr(verdict, n) for n in counts] == [getattr(alone, n) for n in counts]
    text = "\n".join(render(describe(Recording.open_file(paths[1]))))
    assert f"files: {len(paths)}\n" in text
    assert "  log.mcap\n  log_0001.mcap\n" in text


def test_a_decision_that_ends_one_file_is_compared_with_the_next(run: SplitRun) -> None:
    def change(one: Recorded) -> Recorded:
        message = one.message
        if not isinstance(message, wire.KeyFrame | wire.Decision) or message.tick != 30:
            return one
        changed = msgspec.structs.replace(message, why="for fun")
        return one._replace(message=changed, payload=wire.encode(changed))

    paths = run.write(map(change, run.messages))
    found = {number: verify(path) for number, path in paths.items() if number}
    assert [number for number, verdict in found.items() if not verdict.same] == [2]
    rule = "tick 30: the decision of the last tick: recorded Decision("
    assert str(found[2].difference).startswith(rule)
    assert not verify(run.log).same


# Which are kept, what they are called -------------------------------------------------


def test_a_file_ends_at_the_first_key_frame_behind_its_size(
    run: SplitRun, tmp_path: Path
) -> None:
    every = run.write()
    size = every[0].stat().st_size  # some half of it is there at a key-frame
    for split, fewer in ((Split(int(0.43 * size)), False), (Split(size), True)):
        paths = run.write(log=tmp_path / f"{fewer}.mcap", split=split)
        assert (len(paths) < len(every)) == fewer


def test_the_newest_are_kept(run: SplitRun) -> None:
    paths = run.write(split=Split(1, keep=2))
    assert list(paths) == [TICKS // EVERY - 1, TICKS // EVERY]
    verdict = verify(run.log)  # though the first is gone
    assert (verdict.same, verdict.complete) == (True, True)
    assert (verdict.start, verdict.ticks) == (TICKS - EVERY, EVERY)


@pytest.mark.parametrize(
    ("lose", "rule"),
    [
        (Path.unlink, "log_0004.mcap: the file before it is missing"),
        (lambda path: path.write_bytes(b""), "must be an MCAP recording"),
    ],
    ids=["deleted", "emptied"],
)
def test_a_file_that_is_lost_is_noticed_and_skipped(
    run: SplitRun, lose: Callable[[Path], object], rule: str
) -> None:
    lose(run.write()[3])
    verdict = verify(run.log)
    assert (verdict.same, verdict.complete) == (True, False)
    lost = (3 * EVERY + 1, 4 * EVERY)
    assert verdict.missing == (lost,)
    assert verdict.ranges == ((1, lost[0] - 1), (lost[1] + 1, TICKS))
    assert rule in verdict.damage[0]


@pytest.mark.parametrize("number", [1, 3])  # the next one, or one behind it
def test_a_file_in_the_way_is_not_overwritten(log: Path, number: int) -> None:
    other = part_path(log, number)
    other.write_bytes(b"another's")
    rule = rf"must not exist yet, got .*log_000{number}"
    with pytest.raises(RecordingError, match=rule):
        SplitWriter(log, {}, split=SMALL)
    assert other.read_bytes() == b"another's"
    assert list(log.parent.iterdir()) == [other]


def test_options_say_how_files_are_split_and_which_are_kept() -> None:
    still = {"body": Body(own=("s0",)), "split": 65536, "keep": 2}
    assert split_of(msgspec.structs.replace(options(), **still)) == Split(65536, 2)
    assert split_of(options()) is None


# Where messages go that are late, lost or repeated ------------------------------------


def test_what_is_lost_is_missing_once_and_what_comes_again_is_left_out(
    run: SplitRun,
) -> None:
    place = run.last_of(20)
    again = run.messages[place]
    # Each key-frame twice: the second begins no file.
    twice = [
        one
        for each in (*run.messages[:-5], again, *run.messages[-5:])
        for one in [each] * (1 + isinstance(each.message, wire.KeyFrame))
    ]
    paths = run.write(twice)
    frames = sum(isinstance(one.message, wire.KeyFrame) for one in run.messages)
    assert len(paths) == TICKS // EVERY + 1
    recording = Recording.open(run.log)
    completeness = recording.noted().completeness
    assert (completeness.duplicates, completeness.gaps) == (1 + frames, 0)
    assert content(recording.messages()) == content(run.messages)
    assert verify(run.log).same
    lacking = run.log.with_name("lost.mcap")
    run.write([*run.messages[:place], *run.messages[place + 1 :]], lacking)
    assert [each for each in missing(lacking) if each] == [{again.message.sender: 1}]
    assert not verify(lacking).complete


def never_started(wave: int = 2**31 - 1) -> list[wire.Delivery]:
    """What a cell says of a wave that nobody has heard of, and then."""
    settled = wire.CellReport(wave, 0, 0, (), (), (0,), 0)
    return said(settled, wire.Fault("cell/0", "odd"))


@pytest.mark.parametrize("ends", [False, True], ids=["after a while", "at the end"])
def test_what_answers_nothing_is_on_disk_after_a_while_or_at_the_end(
    log: Path, ends: bool
) -> None:
    deliveries = never_started()
    with SplitWriter(log, {}, split=SMALL) as writer:
        added(writer, deliveries)
        writer.flush(NOW + LATE)
        assert list(Recording.open_file(log).messages()) == []
        if not ends:
            writer.flush(NOW + LATE + 1)
            read = [one.delivery for one in Recording.open_file(log).messages()]
            assert read == deliveries
    recording = Recording.open_file(log)
    assert recording.cut is not None
    assert [one.delivery for one in recording.messages()] == deliveries


def test_what_waits_does_not_hide_why_a_recording_is_given_up(
    log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    rule = r"must take what is recorded, got No space"
    with (
        pytest.raises(RecordingError, match=rule),
        SplitWriter(log, {}, split=SMALL) as writer,
    ):
        added(writer, never_started())
        monkeypatch.setattr(writer._newest._mcap, "flush", full)
        writer.flush(NOW)


def test_what_is_lost_where_files_meet_is_missing_in_the_older(run: SplitRun) -> None:
    """Nobody who goes on from the newer one would find out."""
    heard = run.upto(3 * EVERY)
    lost = heard.pop(run.last_of(2 * EVERY))
    ended(run, heard)
    assert missing(run.log) == [{}, {lost.message.sender: 1}, {}]
    _, past = find_resume_point(run.log)
    assert (past.part, past.tick) == (1, 2 * EVERY - 1)


@pytest.mark.usefixtures("small")
def test_what_a_file_lacks_at_its_beginning_may_be_of_the_one_before(
    run: SplitRun,
) -> None:
    """A sender is lost from before one key-frame until after the next."""
    lost = run.messages[run.last_of(2 * EVERY)]
    who, until = lost.message.sender, len(run.upto(3 * EVERY)) + 2
    later = run.upto(4 * EVERY)[until:]
    ended(run, [*silenced(run.messages[:until], lost), *later])
    assert list(part_paths(run.log)) == [0, 1, 2, 3]
    lacking = missing(run.log)[2]
    assert lacking.keys() == {who}
    _, past = find_resume_point(run.log)
    if run.workers:  # a key-frame is not whole without its bands
        assert (past.part, past.tick) == (1, 2 * EVERY - 1)
        return
    assert (past.part, past.tick) == (2, 2 * EVERY)
    # The numbers of what is lost are not given again.
    assert past.counts[who] == lost.sequence + lacking[who]
    new = run.log.with_name("new.mcap")
    made(new, run.workers, past)
    assert missing(new)[0] == lacking


def test_who_died_behind_a_key_frame_may_lack_in_the_file_before(run: SplitRun) -> None:
    """Its last report was on the way when all ended, and it never said another word."""
    lost = run.messages[run.last_of(20)]
    heard = silenced(run.messages[: len(run.upto(2 * EVERY)) + 1], lost)
    parts_there = {one.message.sender for one in run.messages}
    balance = ended(run, heard, more=parts_there)
    assert list(part_paths(run.log)) == [0, 1, 2]
    assert balance.missing == dict.fromkeys(parts_there, 1)
    assert Recording.open_file(part_path(run.log, 1)).cut is not None
    assert not verify(run.log).complete
    _, past = find_resume_point(run.log)
    assert (past.part, past.tick) == (1, 2 * EVERY - 1)


def frame(tick: int) -> wire.KeyFrame:
    return wire.KeyFrame(tick, b"", waves=tick)


@pytest.mark.parametrize(
    ("messages", "files"),
    [
        ([wire.Decision(8, -1, ""), frame(9), wire.Decision(9, -1, "")], 2),
        ([wire.Decision(9, -1, ""), frame(9)], 1),
        ([wire.Decision(8, -1, ""), frame(9), frame(9)], 2),
    ],
    ids=["before its decision", "behind it", "again"],
)
def test_a_key_frame_begins_a_file_with_what_follows_it(
    log: Path, messages: list[wire.Message], files: int
) -> None:
    with SplitWriter(log, {}, split=SMALL) as writer:
        added(writer, said(*messages))
        writer.finish({}, {"coordinator": len(messages)})
    assert len(part_paths(log)) == files


def test_a_key_frame_that_comes_twice_begins_no_file_the_second_time(
    log: Path,
) -> None:
    """Its file would lack it."""
    first, *_ = heard = said(frame(9))
    with SplitWriter(log, {}, split=Split(10**6)) as writer:
        added(writer, heard)
        writer._split = SMALL
        added(writer, [first])
    assert len(part_paths(log)) == 1


def test_faults_go_where_their_sender_is(run: SplitRun) -> None:
    place = run.last_of(20)
    late = run.messages[place]
    fault = wire.Fault(late.message.sender, "odd")
    behind = 1 + run.frame(20)[0]
    order = [
        one._replace(
            sequence=one.sequence
            + (one.message.sender == fault.sender and one.sequence >= late.sequence)
        )
        for one in run.messages
    ]
    # Behind the key-frame, before a report on the last wave before it.
    odd = late._replace(message=fault, payload=wire.encode(fault))
    overtook = [*order[:place], *order[place + 1 : behind]]
    run.write([*overtook, odd, order[place], *order[behind:]])
    held = [list(file.messages(("fault",))) != [] for file in each_file(run.log)]
    assert [part for part, holds in enumerate(held) if holds] == [1]
    assert verify(run.log).same
