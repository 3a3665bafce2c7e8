"""Where messages go that are late, lost or repeated where files meet."""

import errno
from collections.abc import Iterable
from pathlib import Path

import pytest

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.chunk_messages import Recorded
from neurosnap.recording.read.recording import Recording, part_path, part_paths
from neurosnap.recording.replay.resume import find_resume_point
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write.rotation import LATE, SplitWriter
from tests.support.split_runs import (
    EVERY,
    NOW,
    SMALL,
    TICKS,
    content,
    last_of,
    made,
    options_workers,
    said,
    upto,
    write,
)


def rewrite(
    whole: Path, log: Path, heard: Iterable[Recorded], *, more: Iterable[str] = ()
) -> Completeness:
    """Record what was heard, and end it as if that was all, and one more of `more`."""
    with SplitWriter(log, Recording.open_file(whole).metadata, split=SMALL) as writer:
        senders = set(more)
        for one in heard:
            writer.add(one.delivery, NOW)
            senders.add(one.message.sender)
        ends = {who: writer.upcoming(who) + (who in more) for who in senders}
        return writer.finish({}, ends)


def test_what_is_lost_is_missing_once_and_what_comes_again_is_left_out(
    whole: Path, tmp_path: Path
) -> None:
    recorded = list(Recording.open_file(whole).messages())
    place = last_of(recorded, 20)
    again = recorded[place]
    # Each key-frame twice: the second begins no file.
    twice = [
        one
        for each in [*recorded[:-5], again, *recorded[-5:]]
        for one in [each] * (1 + isinstance(each.message, wire.KeyFrame))
    ]
    paths = write(whole, tmp_path / "log.mcap", twice)
    frames = sum(isinstance(one.message, wire.KeyFrame) for one in recorded)
    assert len(paths) == TICKS // EVERY + 1
    recording = Recording.open(paths[0])
    assert recording.noted().completeness.duplicates == 1 + frames
    assert content(recording.messages()) == content(recorded)
    assert verify(paths[0]).same
    del recorded[place]
    paths = write(whole, tmp_path / "lost.mcap", recorded)
    missing = [
        Recording.open_file(path).completeness().missing for path in paths.values()
    ]
    assert [each for each in missing if each] == [{again.message.sender: 1}]
    assert not verify(paths[0]).complete


def test_a_file_does_not_wait_for_whoever_is_silent(
    whole: Path, tmp_path: Path
) -> None:
    """What comes long after the next file began is the next one's."""
    recorded = list(Recording.open_file(whole).messages())
    late = recorded.pop(last_of(recorded, 20))
    who = late.message.sender
    later = [place for place, one in enumerate(recorded) if one.message.sender == who]
    resumed = next(place for place in later if recorded[place].sequence > late.sequence)
    order = [*recorded[:resumed], late, *recorded[resumed:]]
    # All between the key-frame and the late one takes longer than anybody waits.
    paths = write(whole, tmp_path / "log.mcap", order, step=LATE)
    assert all(
        Recording.open_file(path).completeness().whole for path in paths.values()
    )
    assert (verify(paths[0]).same, verify(paths[0]).complete) == (True, True)


def never_started(wave: int = 2**31 - 1) -> list[wire.Delivery]:
    """What a cell says of a wave that nobody has heard of, and then."""
    settled = wire.CellReport(wave, 0, 0, (), (), (0,), 0)
    return said(settled, wire.Fault("cell/0", "odd"))


def test_what_answers_nothing_is_on_disk_after_a_while_or_at_the_end(
    tmp_path: Path,
) -> None:
    deliveries = never_started()
    for log, ends in ((tmp_path / "late.mcap", False), (tmp_path / "end.mcap", True)):
        with SplitWriter(log, {}, split=SMALL) as writer:
            for delivery in deliveries:
                writer.add(delivery, NOW)
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
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    rule = r"must take what is recorded, got No space"
    with (
        pytest.raises(RecordingError, match=rule),
        SplitWriter(tmp_path / "log.mcap", {}, split=SMALL) as writer,
    ):
        for delivery in never_started():
            writer.add(delivery, NOW)
        monkeypatch.setattr(writer._newest._mcap, "flush", full)
        writer.flush(NOW)


def test_what_is_lost_where_files_meet_is_missing_in_the_older(
    whole: Path, tmp_path: Path
) -> None:
    """Nobody who goes on from the newer one would find out."""
    recorded = list(Recording.open_file(whole).messages())
    heard = upto(recorded, 3 * EVERY)
    lost = heard.pop(last_of(recorded, 2 * EVERY))
    log = tmp_path / "log.mcap"
    rewrite(whole, log, heard)
    assert list(part_paths(log)) == [0, 1, 2]
    missing = [
        Recording.open_file(path).noted().completeness.missing
        for path in part_paths(log).values()
    ]
    assert missing == [{}, {lost.message.sender: 1}, {}]
    _, past = find_resume_point(log)
    assert (past.part, past.tick) == (1, 2 * EVERY - 1)


@pytest.mark.usefixtures("small")
def test_what_a_file_lacks_at_its_beginning_may_be_of_the_one_before(
    whole: Path, tmp_path: Path
) -> None:
    """A sender is lost from before one key-frame until after the next."""
    recorded = list(Recording.open_file(whole).messages())
    lost = recorded[last_of(recorded, 2 * EVERY)]
    who, until = lost.message.sender, len(upto(recorded, 3 * EVERY)) + 1
    heard = [
        one
        for place, one in enumerate(recorded[: len(upto(recorded, 4 * EVERY))])
        if place > until or one.message.sender != who or one.sequence < lost.sequence
    ]
    log = tmp_path / "log.mcap"
    rewrite(whole, log, heard)
    assert list(part_paths(log)) == [0, 1, 2, 3]
    lacking = Recording.open_file(part_path(log, 2)).noted().completeness.missing
    assert lacking.keys() == {who}
    _, past = find_resume_point(log)
    assert (past.part, past.tick) == (2, 2 * EVERY)
    # The numbers of what is lost are not given again.
    assert past.counts[who] == lost.sequence + lacking[who]
    new = tmp_path / "new.mcap"
    made(new, options_workers(whole), past)
    assert (
        Recording.open_file(part_path(new, 2)).noted().completeness.missing == lacking
    )


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
    tmp_path: Path, messages: list[wire.Message], files: int
) -> None:
    log = tmp_path / "log.mcap"
    with SplitWriter(log, {}, split=SMALL) as writer:
        for delivery in said(*messages):
            writer.add(delivery, NOW)
        writer.finish({}, {"coordinator": len(messages)})
    assert len(part_paths(log)) == files


@pytest.mark.usefixtures("small")
def test_a_run_that_goes_on_where_a_file_begins_says_so_in_that_file(
    whole: Path, tmp_path: Path
) -> None:
    """The head alone is larger than a file should be."""
    paths = write(whole, tmp_path / "log.mcap", Recording.open_file(whole).messages())
    _, past = find_resume_point(paths[0], 2 * EVERY)
    assert (past.tick, past.part) == (2 * EVERY, 2)
    new = tmp_path / "new.mcap"
    made(new, options_workers(whole), past)
    verdict = verify(part_path(new, 2))
    assert (verdict.difference, verdict.complete) == (None, True)
    assert (verdict.start, verdict.ticks) == (2 * EVERY, EVERY)


def test_who_died_behind_a_key_frame_may_lack_in_the_file_before(
    whole: Path, tmp_path: Path
) -> None:
    """Its last report was on the way when all ended, and it never said another word."""
    recorded = list(Recording.open_file(whole).messages())
    lost = recorded[last_of(recorded, 20)]
    who = lost.message.sender
    heard = [
        one
        for one in recorded[: len(upto(recorded, 2 * EVERY)) + 1]
        if one.message.sender != who or one.sequence < lost.sequence
    ]
    log, parts_there = tmp_path / "log.mcap", {one.message.sender for one in recorded}
    balance = rewrite(whole, log, heard, more=parts_there)
    assert list(part_paths(log)) == [0, 1, 2]
    assert balance.missing == dict.fromkeys(parts_there, 1)
    assert Recording.open_file(part_path(log, 1)).cut is not None
    assert not verify(log).complete
    _, past = find_resume_point(log)
    assert (past.part, past.tick) == (1, 2 * EVERY - 1)


def test_faults_go_where_their_sender_is(whole: Path, tmp_path: Path) -> None:
    old = Recording.open_file(whole)
    recorded = list(old.messages())
    place = last_of(recorded, 20)
    who, sequence = recorded[place].message.sender, recorded[place].sequence
    fault = wire.Fault(who, "odd")
    order = []
    for number, one in enumerate(recorded):
        mine = one.message.sender == who and one.sequence >= sequence
        if number == place:  # between two reports on the last waves before
            order.append(
                one._replace(message=fault, payload=wire.encode(fault), log_time=0)
            )
        order.append(one._replace(sequence=one.sequence + mine))
    paths = write(whole, tmp_path / "log.mcap", order)
    held = {
        number
        for number, path in paths.items()
        if any(one.message == fault for one in Recording.open_file(path).messages())
    }
    assert held == {1}
    assert verify(paths[0]).same
