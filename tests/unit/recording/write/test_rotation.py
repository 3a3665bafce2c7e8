"""A recording in several files: each a run by itself, and all together the run."""

import asyncio
import errno
import random
import threading
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import msgspec
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError, RecordingError
from neurosnap.fabric.location import Place
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.info import describe, render
from neurosnap.recording.read.reader import Recorded, Recording
from neurosnap.recording.read.split_files import (
    first_path,
    open_whole,
    part_path,
    part_paths,
)
from neurosnap.recording.replay.resume import find_resume_point, restore, whole_ticks
from neurosnap.recording.replay.verify import verify
from neurosnap.recording.write import rotation
from neurosnap.recording.write.rotation import LATE, Split, SplitWriter, split_of
from neurosnap.recording.write.writer import Writer
from neurosnap.runtime.inline import run_inline
from neurosnap.runtime.run import describe as facts_of
from tests.support.course import course
from tests.support.scripted_sources import Scripted

TICKS = 60
EVERY = 10
ACTIONS = ("go", "stay")


def options(workers: int = 0, ticks: int = TICKS) -> RunOptions:
    return RunOptions(
        source="scripted",
        body=Body.full(["s0", "s1", "s2"], ACTIONS),
        ticks=ticks,
        threshold=0.2,
        cells="worker" if workers else "inline",
        workers=max(workers, 1),
        keyframe_every=EVERY,
    )


def rows() -> list[list[bool | None]]:
    chance = random.Random(3)
    table: list[list[bool | None]] = []
    for _ in range(2 * TICKS):
        a, b, c = (chance.random() < 0.5 for _ in range(3))
        row: list[bool | None] = [a, a or b, c]
        table.append(
            [None if chance.random() < 0.1 else on for on in row[:2]] + row[2:]
        )
    return table


def made(
    log: Path, workers: int = 0, past: ResumePoint | None = None, ticks: int = TICKS
) -> Path:
    """Record a run in one process."""
    given = options(workers, ticks)
    with pytest.MonkeyPatch.context() as patch:
        source = Scripted(rows(), ACTIONS)
        patch.setattr("neurosnap.runtime.inline.open_source", lambda *_: source)
        stop, facts = asyncio.Event(), facts_of(given)
        asyncio.run(run_inline(given, log, facts, past, stop, lambda _: None))
    return log


@pytest.fixture(scope="module", params=[0, 2], ids=["cells", "workers"])
def whole(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """A run in one file."""
    return made(tmp_path_factory.mktemp("whole") / "log.mcap", request.param)


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every key-frame begin another file."""
    monkeypatch.setattr(rotation, "split_of", lambda _: Split(1))


def overtaking(recorded: Iterable[Recorded], seed: int) -> list[Recorded]:
    """Let senders overtake each other by some messages, each in its own order."""
    chance, due = random.Random(seed), dict[str, float]()
    keyed = []
    for place, one in enumerate(recorded):
        who = one.message.sender
        due[who] = max(due.get(who, 0.0), place + chance.random() * 40)
        keyed.append((due[who], place, one))
    return [one for _, _, one in sorted(keyed, key=lambda entry: entry[:2])]


def write(
    whole: Path, log: Path, recorded: Iterable[Recorded], step: int = 1
) -> dict[int, Path]:
    """Record messages again, `step` nanoseconds apart, as if they came now."""
    old = Recording.open(whole)
    with SplitWriter(log, old.metadata) as writer:
        for count, one in enumerate(recorded):
            now = 10**18 + count * step
            writer.add(one.delivery, now)
            if count % 8 == 0:  # a chunk each would be many to read
                writer.flush(now)
        writer.finish({}, old.noted().expected)
    return part_paths(log)


def content(recorded: Iterable[Recorded]) -> list[tuple[str, int, bytes]]:
    return sorted((m.message.sender, m.sequence, m.payload) for m in recorded)


# Each by itself, and all together -----------------------------------------------------


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("seed", [None, 0, 1, 2])
def test_every_file_is_a_run_by_itself(
    whole: Path, tmp_path: Path, seed: int | None
) -> None:
    recorded = list(Recording.open(whole).messages())
    if seed is not None:
        recorded = overtaking(recorded, seed)
    paths = write(whole, tmp_path / "log.mcap", recorded)
    assert list(paths) == list(range(TICKS // EVERY + 1))
    ends: dict[str, int] = {}
    for number, path in paths.items():
        recording = Recording.open(path)
        assert recording.finished
        assert (recording.part, recording.begins) == (number, number * EVERY)
        assert recording.completeness() == recording.noted().completeness
        assert recording.completeness().whole
        share, upcoming = recording.share, recording.noted().expected
        assert share is not None
        assert all(share.get(who, 0) == end for who, end in ends.items())
        ends = upcoming
        if number:
            verdict = verify(path)
            assert (verdict.difference, verdict.complete) == (None, True)
            last = number == len(paths) - 1
            assert (verdict.start, verdict.ticks) == (
                number * EVERY,
                0 if last else EVERY,
            )
    assert content(open_whole(paths[0]).messages()) == content(recorded)


@pytest.mark.usefixtures("small")
def test_every_file_says_where_parts_are(whole: Path, tmp_path: Path) -> None:
    old, places = Recording.open(whole), {"world": Place("oak", 4711)}
    log = tmp_path / "log.mcap"
    with SplitWriter(log, old.metadata) as writer:
        writer.note_places(places)
        for count, one in enumerate(old.messages()):
            writer.add(one.delivery, 10**18 + count)
        writer.finish({}, old.noted().expected)
    paths = part_paths(log)
    assert len(paths) > 1
    assert all(Recording.open(path).places == places for path in paths.values())
    assert open_whole(log).places == places
    assert verify(log).same


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("seed", [0, 1])
def test_all_files_are_the_run(whole: Path, tmp_path: Path, seed: int) -> None:
    recorded = overtaking(Recording.open(whole).messages(), seed)
    paths = write(whole, tmp_path / "log.mcap", recorded)
    alone, verdict = verify(whole), verify(paths[0])
    assert (verdict.same, verdict.complete, verdict.start) == (True, True, 0)
    assert verdict.files == len(paths) > 1
    counts = ("ticks", "wirings", "waves", "states", "decisions")
    assert [getattr(verdict, n) for n in counts] == [getattr(alone, n) for n in counts]
    assert open_whole(paths[0]).snapshot == Recording.open(whole).snapshot
    said = render(describe(Recording.open(paths[1])))
    assert f"files: {len(paths)}\n" in said
    assert "\tlog.mcap\n\tlog_0001.mcap\n" in said


@pytest.mark.usefixtures("small")
def test_what_is_tampered_with_is_found_in_its_file(
    whole: Path, tmp_path: Path
) -> None:
    recorded = list(Recording.open(whole).messages())
    for place, one in enumerate(recorded):
        if isinstance(one.message, wire.State) and one.message.tick == 25:
            message = msgspec.structs.replace(one.message, depth=one.message.depth + 1)
            changed = one._replace(message=message, payload=wire.encode(message))
            recorded[place] = changed
    paths = write(whole, tmp_path / "log.mcap", recorded)
    found = {number: verify(path).same for number, path in paths.items() if number}
    assert [number for number, same in found.items() if not same] == [2]
    assert not verify(paths[0]).same


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("seed", [None, 1])
def test_a_file_says_how_its_last_tick_was_decided(
    whole: Path, tmp_path: Path, seed: int | None
) -> None:
    recorded = list(Recording.open(whole).messages())
    decisions = {
        one.message.tick: one.message
        for one in recorded
        if isinstance(one.message, wire.Decision)
    }
    if seed is not None:
        recorded = overtaking(recorded, seed)
    paths = write(whole, tmp_path / "log.mcap", recorded)
    *before, last = paths.values()
    for number, path in enumerate(before):
        closing, tick = Recording.open(path).closing, (number + 1) * EVERY
        assert closing is not None
        # That of the run's last tick is told to nobody; the key-frame has it.
        assert closing == decisions.get(tick, closing)
        assert closing.tick == tick
        # With the one that opens it, and the one that closes it.
        assert verify(path).decisions == EVERY + 1 or not number
    assert Recording.open(last).closing is None
    assert open_whole(paths[0]).closing is None


def decided_otherwise(one: Recorded, tick: int) -> Recorded:
    message = one.message
    if not isinstance(message, wire.KeyFrame | wire.Decision) or message.tick != tick:
        return one
    message = msgspec.structs.replace(message, why="for fun")
    return one._replace(message=message, payload=wire.encode(message))


@pytest.mark.usefixtures("small")
def test_a_wrong_last_decision_is_found_in_its_file(
    whole: Path, tmp_path: Path
) -> None:
    recorded = Recording.open(whole).messages()
    changed = [decided_otherwise(one, 30) for one in recorded]
    paths = write(whole, tmp_path / "log.mcap", changed)
    found = {number: verify(path) for number, path in paths.items() if number}
    assert [number for number, verdict in found.items() if not verdict.same] == [2]
    said = found[2].difference
    assert said is not None
    assert said.startswith("tick 30: the decision of the last tick: recorded Decision(")


@pytest.mark.usefixtures("small")
def test_a_closing_decision_that_is_none_is_refused(
    whole: Path, tmp_path: Path
) -> None:
    with Writer(tmp_path / "log.mcap") as writer:
        writer.start(Recording.open(whole).metadata)
        writer.finish({"decision": '{"tick": -1}'}, {})
    with pytest.raises(RecordingError, match=r"decision: must hold a decision, got "):
        _ = Recording.open(tmp_path / "log.mcap").closing


# Given to the disk --------------------------------------------------------------------


class Disk:
    """A disk that takes nothing before it is told to."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.asked = threading.Event()
        self.takes = threading.Event()
        self.error: OSError | None = None
        self.threads: list[int] = []
        patch.setattr("os.fsync", self._sync)

    def _sync(self, _: int) -> None:
        self.threads.append(threading.get_ident())
        self.asked.set()
        assert self.takes.wait(10)
        if self.error is not None:
            raise self.error


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    made = Disk(monkeypatch)
    yield made
    made.takes.set()


def upto(recorded: Sequence[Recorded], tick: int) -> list[Recorded]:
    """Return what was recorded before the key-frame of a tick."""
    place = next(
        place
        for place, one in enumerate(recorded)
        if isinstance(one.message, wire.KeyFrame) and one.message.tick == tick
    )
    return list(recorded[:place])


@pytest.mark.usefixtures("small")
def test_recording_goes_on_while_the_disk_takes_a_file(
    whole: Path, tmp_path: Path, disk: Disk
) -> None:
    old, log = Recording.open(whole), tmp_path / "log.mcap"
    recorded = list(old.messages())
    shares = upto(recorded, 2 * EVERY)
    with SplitWriter(log, old.metadata) as writer:
        for count, one in enumerate(shares):
            writer.add(one.delivery, 10**18 + count)
        assert disk.asked.wait(10)
        writer.flush(10**18 + len(shares))
        # Whoever is killed now has lost nothing: the file that is over has its end, and
        # so the run goes on from the next one.
        assert Recording.open(log).finished
        assert Recording.open(log).completeness().whole
        assert find_resume_point(log)[1].part == 1
        assert threading.get_ident() not in disk.threads
        disk.takes.set()
        for count, one in enumerate(recorded[len(shares) :], len(shares)):
            writer.add(one.delivery, 10**18 + count)
        writer.finish({}, old.noted().expected)
    assert (verify(log).same, verify(log).complete) == (True, True)


@pytest.mark.usefixtures("small")
def test_a_file_that_the_disk_does_not_take_ends_the_recording(
    whole: Path, tmp_path: Path, disk: Disk
) -> None:
    old, log = Recording.open(whole), tmp_path / "log.mcap"
    disk.error = OSError(errno.EIO, "no disk")
    with SplitWriter(log, old.metadata) as writer:
        for count, one in enumerate(upto(list(old.messages()), 2 * EVERY)):
            writer.add(one.delivery, 10**18 + count)
        disk.takes.set()
        with pytest.raises(RecordingError, match=r"^log: must take .* got no disk"):
            writer.finish({}, {})


def test_files_are_deleted_once_a_newer_one_is_saved(
    whole: Path, tmp_path: Path, disk: Disk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rotation, "split_of", lambda _: Split(1, keep=1))
    old, log = Recording.open(whole), tmp_path / "log.mcap"
    with SplitWriter(log, old.metadata) as writer:
        for count, one in enumerate(upto(list(old.messages()), 2 * EVERY)):
            writer.add(one.delivery, 10**18 + count)
        assert disk.asked.wait(10)
        assert list(part_paths(log)) == [0, 1]
        disk.takes.set()
        writer.finish({}, {})
    assert list(part_paths(log)) == [1]


# What is late, lost, or comes again ---------------------------------------------------


def last_of(recorded: Sequence[Recorded], tick: int) -> int:
    """Return the place of the last report on the waves up to a tick."""
    frame = next(
        one.message
        for one in recorded
        if isinstance(one.message, wire.KeyFrame) and one.message.tick == tick
    )
    return max(
        place
        for place, one in enumerate(recorded)
        if isinstance(one.message, wire.CellReport | wire.WorkerReport)
        and one.message.wave <= frame.waves
    )


@pytest.mark.usefixtures("small")
def test_a_message_lost_at_the_end_of_a_file_is_missing_in_one(
    whole: Path, tmp_path: Path
) -> None:
    recorded = list(Recording.open(whole).messages())
    gone = recorded.pop(last_of(recorded, 20))
    paths = write(whole, tmp_path / "log.mcap", recorded)
    missing = [Recording.open(path).completeness().missing for path in paths.values()]
    assert [each for each in missing if each] == [{gone.message.sender: 1}]
    verdict = verify(paths[0])
    assert not verdict.complete


@pytest.mark.usefixtures("small")
def test_a_message_that_comes_again_in_a_later_file_is_left_out(
    whole: Path, tmp_path: Path
) -> None:
    recorded = list(Recording.open(whole).messages())
    again = recorded[last_of(recorded, 20)]
    paths = write(whole, tmp_path / "log.mcap", [*recorded[:-5], again, *recorded[-5:]])
    recording = open_whole(paths[0])
    assert recording.noted().completeness.duplicates == 1
    assert content(recording.messages()) == content(recorded)


@pytest.mark.usefixtures("small")
def test_a_key_frame_that_comes_again_begins_no_file(
    whole: Path, tmp_path: Path
) -> None:
    recorded = list(Recording.open(whole).messages())
    twice = [
        one
        for each in recorded
        for one in [each] * (1 + isinstance(each.message, wire.KeyFrame))
    ]
    paths = write(whole, tmp_path / "log.mcap", twice)
    assert len(paths) == TICKS // EVERY + 1
    assert verify(paths[0]).same


@pytest.mark.usefixtures("small")
def test_a_file_does_not_wait_for_whoever_is_silent(
    whole: Path, tmp_path: Path
) -> None:
    """What comes long after the next file began is the next one's."""
    recorded = list(Recording.open(whole).messages())
    late = recorded.pop(last_of(recorded, 20))
    who = late.message.sender
    later = [place for place, one in enumerate(recorded) if one.message.sender == who]
    resumed = next(place for place in later if recorded[place].sequence > late.sequence)
    order = [*recorded[:resumed], late, *recorded[resumed:]]
    # All between the key-frame and the late one takes longer than anybody waits.
    paths = write(whole, tmp_path / "log.mcap", order, step=LATE)
    assert all(Recording.open(path).completeness().whole for path in paths.values())
    assert (verify(paths[0]).same, verify(paths[0]).complete) == (True, True)


NOW = 10**18


def said(*messages: wire.Message) -> list[wire.Delivery]:
    return [
        wire.Delivery(message.key, number, NOW, wire.encode(message))
        for number, message in enumerate(messages)
    ]


def never_started(wave: int = 2**31 - 1) -> list[wire.Delivery]:
    """What a cell says of a wave that nobody has heard of, and then."""
    settled = wire.CellReport(wave, 0, 0, (), (), (0,), 0)
    return said(settled, wire.Fault("cell/0", "odd"))


@pytest.mark.usefixtures("small")
def test_what_answers_nothing_is_on_disk_after_a_while(tmp_path: Path) -> None:
    log, deliveries = tmp_path / "log.mcap", never_started()
    with SplitWriter(log, {}) as writer:
        for delivery in deliveries:
            writer.add(delivery, NOW)
        writer.flush(NOW + LATE)
        assert list(Recording.open(log).messages()) == []
        writer.flush(NOW + LATE + 1)
        assert [one.delivery for one in Recording.open(log).messages()] == deliveries


@pytest.mark.usefixtures("small")
def test_what_waits_is_written_when_a_recording_is_given_up(tmp_path: Path) -> None:
    log, deliveries = tmp_path / "log.mcap", never_started()
    with SplitWriter(log, {}) as writer:
        for delivery in deliveries:
            writer.add(delivery, NOW)
    recording = Recording.open(log)
    assert not recording.finished
    assert [one.delivery for one in recording.messages()] == deliveries


@pytest.mark.usefixtures("small")
def test_what_waits_does_not_hide_why_a_recording_is_given_up(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    rule = r"must take what is recorded, got No space"
    with (
        pytest.raises(RecordingError, match=rule),
        SplitWriter(tmp_path / "log.mcap", {}) as writer,
    ):
        for delivery in never_started():
            writer.add(delivery, NOW)
        monkeypatch.setattr(writer._newest._mcap, "flush", full)
        writer.flush(NOW)


@pytest.mark.usefixtures("small")
def test_what_is_lost_where_files_meet_is_missing_in_the_older(
    whole: Path, tmp_path: Path
) -> None:
    """Nobody who goes on from the newer one would find out."""
    recorded = list(Recording.open(whole).messages())
    heard = upto(recorded, 3 * EVERY)
    lost = heard.pop(last_of(recorded, 2 * EVERY))
    log = tmp_path / "log.mcap"
    with SplitWriter(log, Recording.open(whole).metadata) as writer:
        for one in heard:
            writer.add(one.delivery, NOW)
        senders = {one.message.sender for one in heard}
        writer.finish({}, {who: writer.upcoming(who) for who in senders})
    assert list(part_paths(log)) == [0, 1, 2]
    missing = [
        Recording.open(path).noted().completeness.missing
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
    recorded = list(Recording.open(whole).messages())
    lost = recorded[last_of(recorded, 2 * EVERY)]
    who, until = lost.message.sender, len(upto(recorded, 3 * EVERY)) + 1
    heard = [
        one
        for place, one in enumerate(recorded[: len(upto(recorded, 4 * EVERY))])
        if place > until or one.message.sender != who or one.sequence < lost.sequence
    ]
    log = tmp_path / "log.mcap"
    with SplitWriter(log, Recording.open(whole).metadata) as writer:
        for one in heard:
            writer.add(one.delivery, NOW)
        senders = {one.message.sender for one in heard}
        writer.finish({}, {each: writer.upcoming(each) for each in senders})
    assert list(part_paths(log)) == [0, 1, 2, 3]
    lacking = Recording.open(part_path(log, 2)).noted().completeness.missing
    assert lacking.keys() == {who}
    _, past = find_resume_point(log)
    assert (past.part, past.tick) == (2, 2 * EVERY)
    # The numbers of what is lost are not given again.
    assert past.counts[who] == lost.sequence + lacking[who]
    new = tmp_path / "new.mcap"
    made(new, options_workers(whole), past)
    assert Recording.open(part_path(new, 2)).noted().completeness.missing == lacking


def frame(tick: int) -> wire.KeyFrame:
    return wire.KeyFrame(tick, b"", waves=tick)


@pytest.mark.usefixtures("small")
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
    with SplitWriter(log, {}) as writer:
        for delivery in said(*messages):
            writer.add(delivery, NOW)
        writer.finish({}, {"coordinator": len(messages)})
    assert len(part_paths(log)) == files


@pytest.mark.usefixtures("small")
def test_a_run_that_goes_on_where_a_file_begins_says_so_in_that_file(
    whole: Path, tmp_path: Path
) -> None:
    """The head alone is larger than a file should be."""
    paths = write(whole, tmp_path / "log.mcap", Recording.open(whole).messages())
    _, past = find_resume_point(paths[0], 2 * EVERY)
    assert (past.tick, past.part) == (2 * EVERY, 2)
    new = tmp_path / "new.mcap"
    made(new, options_workers(whole), past)
    verdict = verify(part_path(new, 2))
    assert (verdict.difference, verdict.complete) == (None, True)
    assert (verdict.start, verdict.ticks) == (2 * EVERY, EVERY)


@pytest.mark.usefixtures("small")
def test_who_died_behind_a_key_frame_may_lack_in_the_file_before(
    whole: Path, tmp_path: Path
) -> None:
    """Its last report was on the way when all ended, and it never said another word."""
    recorded = list(Recording.open(whole).messages())
    lost = recorded[last_of(recorded, 20)]
    who = lost.message.sender
    heard = [
        one
        for one in recorded[: len(upto(recorded, 2 * EVERY)) + 1]
        if one.message.sender != who or one.sequence < lost.sequence
    ]
    log, old = tmp_path / "log.mcap", Recording.open(whole)
    with SplitWriter(log, old.metadata) as writer:
        for one in heard:
            writer.add(one.delivery, NOW)
        begun = set(part_paths(log))
        parts_there = {one.message.sender for one in recorded}
        upcoming = {each: writer.upcoming(each) + 1 for each in parts_there}
        balance = writer.finish({}, upcoming)
    assert begun == {0, 1, 2}
    assert balance.missing == dict.fromkeys(parts_there, 1)
    assert not Recording.open(part_path(log, 1)).finished
    assert not verify(log).complete
    _, past = find_resume_point(log)
    assert (past.part, past.tick) == (1, 2 * EVERY - 1)


def test_faults_go_where_their_sender_is(whole: Path, tmp_path: Path) -> None:
    old = Recording.open(whole)
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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rotation, "split_of", lambda _: Split(1))
        paths = write(whole, tmp_path / "log.mcap", order)
    held = {
        number
        for number, path in paths.items()
        if any(one.message == fault for one in Recording.open(path).messages())
    }
    assert held == {1}
    assert verify(paths[0]).same


# Which are kept, what they are called -------------------------------------------------


def test_the_newest_are_kept(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rotation, "split_of", lambda _: Split(1, keep=2))
    log = tmp_path / "log.mcap"
    paths = write(whole, log, Recording.open(whole).messages())
    assert list(paths) == [TICKS // EVERY - 1, TICKS // EVERY]
    verdict = verify(log)  # though the first is gone
    assert (verdict.same, verdict.complete) == (True, True)
    assert (verdict.start, verdict.ticks) == (TICKS - EVERY, EVERY)


def test_a_file_that_is_missing_between_is_noticed(
    whole: Path, tmp_path: Path, small: None
) -> None:
    paths = write(whole, tmp_path / "log.mcap", Recording.open(whole).messages())
    paths[3].unlink()
    verdict = verify(paths[0])
    assert not verdict.complete
    assert verdict.same
    lost = (3 * EVERY + 1, 4 * EVERY)
    assert verdict.missing == (lost,)
    assert verdict.ranges == ((1, lost[0] - 1), (lost[1] + 1, TICKS))
    assert "log_0004.mcap: the file before it is missing" in verdict.damage[0]


@pytest.mark.usefixtures("small")
def test_a_file_in_the_way_is_not_overwritten(whole: Path, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    other = part_path(log, 3)
    other.write_bytes(b"another's")
    with pytest.raises(RecordingError, match=r"must not exist yet, got .*log_0003"):
        SplitWriter(log, Recording.open(whole).metadata)
    assert other.read_bytes() == b"another's"
    assert list(tmp_path.iterdir()) == [other]


def test_files_have_names_in_order() -> None:
    log = Path("at/run.v2.mcap")
    names = [part_path(log, number) for number in (0, 1, 12, 9999)]
    assert names == sorted(names)
    assert [
        first_path(path, n) for path, n in zip(names, (0, 1, 12, 9999), strict=True)
    ] == [log] * 4


@pytest.mark.parametrize("text", ["-1", "65535", "many"])
def test_a_wrong_size_is_refused(text: str) -> None:
    with pytest.raises(RecordingError, match=r"^split: must be sizes, got "):
        split_of({"split": text})


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
    assert split_of(facts_of(RunOptions(**still))) == Split(65536, 2)
    assert split_of({}) is None


# Going on -----------------------------------------------------------------------------


@pytest.mark.usefixtures("small")
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_run_goes_on_in_its_last_file(
    whole: Path, tmp_path: Path, share: float
) -> None:
    workers = options_workers(whole)
    paths = write(whole, tmp_path / "log.mcap", Recording.open(whole).messages())
    for number in (4, 5, 6):
        if number > 4:
            paths[number].unlink()
    data = paths[4].read_bytes()
    chunks = Recording.open(paths[4]).layout.chunks
    at = chunks[int(share * len(chunks))].offset
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[:at])
    paths[4].write_bytes(data[:at])
    _, past = find_resume_point(paths[0])
    assert (past.log, past.part, past.begins) == (str(paths[4]), 4, 4 * EVERY)
    assert 4 * EVERY <= past.tick < 5 * EVERY
    assert past.tick == whole_ticks(paths[0])
    assert len(past.actions) == past.tick - 1
    paths[4].unlink()
    past = msgspec.structs.replace(past, log=str(cut))
    made(tmp_path / "log.mcap", workers, past)
    assert not part_path(cut, 4).exists()
    again = verify(paths[0])
    assert (again.difference, again.complete, again.ticks) == (None, True, TICKS)
    assert verify(paths[4]).same
    assert course(paths[0]) == course(whole)


def test_a_key_frame_is_no_proof_that_all_before_it_is_there(
    whole: Path, tmp_path: Path
) -> None:
    """Somebody's messages are lost from before a key-frame on, and nobody else's."""
    recorded = list(Recording.open(whole).messages())
    lost = recorded[last_of(recorded, 2 * EVERY)]
    log, who = tmp_path / "log.mcap", lost.message.sender
    with Writer(log) as writer:
        writer.start(Recording.open(whole).metadata)
        for one in recorded[: len(upto(recorded, 3 * EVERY)) + 1]:
            if one.message.sender != who or one.sequence < lost.sequence:
                writer.add(one.delivery, one.log_time)
    _, past = find_resume_point(log)
    assert past.tick == 2 * EVERY - 1
    core = restore(past, TICKS)
    assert (core.tick, core.in_flight) == (past.tick, ())
    assert whole_ticks(log) == past.tick


def test_what_is_restored_is_derived_from_the_last_key_frame_alone(
    whole: Path, tmp_path: Path
) -> None:
    """What was looked back on goes no further back: there it may lack something."""
    recorded = list(Recording.open(whole).messages())
    _, past = find_resume_point(whole, 3 * EVERY + 5)
    del recorded[last_of(recorded, 3 * EVERY)]
    log = tmp_path / "log.mcap"
    with Writer(log) as writer:
        writer.start(Recording.open(whole).metadata)
        for one in recorded:
            writer.add(one.delivery, one.log_time)
    core = restore(msgspec.structs.replace(past, log=str(log)), TICKS)
    assert (core.tick, core.in_flight) == (3 * EVERY + 5, ())


def options_workers(log: Path) -> int:
    recorded = msgspec.json.decode(Recording.open(log).metadata["options"])
    return int(recorded["workers"]) if recorded["cells"] == "worker" else 0


@pytest.mark.usefixtures("small")
def test_behind_a_file_without_end_nothing_counts(whole: Path, tmp_path: Path) -> None:
    """What a file lacks at its end, the next one is based on."""
    paths = write(whole, tmp_path / "log.mcap", Recording.open(whole).messages())
    layout = Recording.open(paths[2]).layout
    paths[2].write_bytes(paths[2].read_bytes()[: layout.chunks[-8].offset])
    _, past = find_resume_point(paths[0])
    assert (past.part, past.begins) == (2, 2 * EVERY)
    assert 2 * EVERY <= past.tick < 3 * EVERY


@pytest.mark.usefixtures("small")
def test_without_its_first_files_a_world_that_acts_cannot_go_on(
    whole: Path, tmp_path: Path
) -> None:
    paths = write(whole, tmp_path / "log.mcap", Recording.open(whole).messages())
    paths[1].unlink()
    rule = r"must have its decisions of ticks 1 to 59, to do them again, got 49"
    with pytest.raises(RecordingError, match=rule):
        find_resume_point(paths[6])
