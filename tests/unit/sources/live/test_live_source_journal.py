"""A restarted run receives the same readings from the journal."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import NeurosnapError
from neurosnap.sources.live.journal import Journal, read_journal
from neurosnap.sources.live.latest_or_late import LatestReadings
from neurosnap.sources.live.live_source import ROOM, LiveSource
from neurosnap.sources.live.tick_schedule import Clocked, OnChange, TickSchedule
from neurosnap.wire import Outage, Received
from tests.support.fake_time import FakeTime, timed

NAMES = ["door", "motion"]


class Kept:
    """Opens sources on one journal, one after the other, as restarts do."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._open: list[LiveSource] = []

    def source(
        self,
        schedule: TickSchedule | None = None,
        time: FakeTime | None = None,
        *,
        most: int | None = None,
        done: list[int] | None = None,
    ) -> LiveSource:
        time = FakeTime() if time is None else time
        source = LiveSource(
            LatestReadings(NAMES),
            OnChange() if schedule is None else schedule,
            actions=() if done is None else ("rest", "ring"),
            actuate=None if done is None else done.append,
            journal=Journal(self.folder, NAMES),
            most=most,
        )
        timed(source, time)
        self._open.append(source)
        return source

    def rows(self) -> int:
        return len(read_journal(self.folder).rows)

    def close(self) -> None:
        for source in self._open:
            source.close()


@pytest.fixture
def kept(tmp_path: Path) -> Iterator[Kept]:
    kept = Kept(tmp_path / "run.mcap.journal")
    yield kept
    kept.close()


def taken(source: LiveSource, count: int) -> list[list[bool]]:
    """Return the next rows."""
    rows = [source.step(0) if source.given else source.first() for _ in range(count)]
    return [row.bits.tolist() for row in rows if row is not None]


def give(source: LiveSource, *numbers: int) -> None:
    for row in bits(*numbers):
        source.receive_whole(row)


def bits(*numbers: int) -> list[list[bool]]:
    return [[number & 1 > 0, number >> 1 & 1 > 0] for number in numbers]


def test_what_was_given_is_given_again_and_what_waited_follows(kept: Kept) -> None:
    source = kept.source()
    source.resume_after(0)
    give(source, 1, 2, 3, 0)
    assert taken(source, 3) == bits(1, 2, 3)
    source.resume_after(1)
    give(source, 1)
    assert taken(source, 4) == bits(2, 3, 0, 1)


def test_so_it_is_for_another_source_on_the_same_journal(kept: Kept) -> None:
    before = kept.source()
    before.resume_after(0)
    give(before, 1, 2, 3)
    assert taken(before, 2) == bits(1, 2)
    after = kept.source()
    assert after.resumed
    after.resume_after(1)
    give(after, 0)
    rows = [row for row in (after.step(0), after.step(0), after.step(0)) if row]
    assert [row.bits.tolist() for row in rows] == bits(2, 3, 0)
    # Something may have been missed between what was written and what came then.
    assert [row.begins for row in rows] == [False, False, True]


EVENTS = st.lists(
    st.one_of(
        st.tuples(
            st.just("whole"),
            st.lists(st.sampled_from([True, False, None]), min_size=2, max_size=2),
        ),
        st.tuples(
            st.just("single"),
            st.dictionaries(st.sampled_from([*NAMES, "lamp"]), st.booleans()),
        ),
        st.tuples(
            st.just("old"),
            st.dictionaries(st.sampled_from(NAMES), st.booleans(), min_size=1),
        ),
        st.tuples(st.just("refuse"), st.none()),
        st.tuples(st.just("tick"), st.none()),
        st.tuples(st.just("goes on"), st.none()),
    ),
    max_size=40,
)


@given(events=EVENTS)
def test_all_that_is_received_becomes_one_thing(
    tmp_path_factory: pytest.TempPathFactory, events: list[tuple[str, Any]]
) -> None:
    kept = Kept(tmp_path_factory.mktemp("kept") / "run.mcap.journal")
    source, handed_in, last = kept.source(), 0, 0
    for kind, what in events:
        match kind:
            case "whole":
                source.receive_whole(what)
            case "single":
                source.receive(what)
            case "old":
                source.receive(what, at=-1.0)
            case "refuse":
                source.refuse("line: must be a reading, got nothing")
            case "tick" if source._waiting:
                row = source.step(0) if source.given else source.first()
                assert row is not None
                last = row.received.total
            case "goes on":
                source = kept.source()
        handed_in += kind in ("whole", "single", "old", "refuse")
        counted = source.statistics()
        assert counted.received.total + counted.after == handed_in
        assert read_journal(kept.folder).received.total >= last
    kept.close()


def test_what_had_no_row_yet_is_in_the_first_of_the_next_process(kept: Kept) -> None:
    time = FakeTime(100.0)
    source = kept.source(time=time)
    source.receive({"door": True, "motion": True})
    assert taken(source, 1) == bits(3)
    assert source.receive({"door": False})
    assert source.receive({"motion": True}, at=50.0)  # late
    assert source.receive({"motion": False}, at=100.0)
    assert source.receive({}, wrong=["motion: must be on or off, got 'ajar'"])
    assert (kept.rows(), read_journal(kept.folder).received.shown) == (1, 1)
    after = kept.source(time=time)
    after.resume_after(1)
    assert taken(after, 1) == bits(0)
    *_, row = read_journal(kept.folder).rows
    assert row.received == Received(shown=3, late=1, refused=1)
    assert after.statistics().after == 0
    after.close()
    assert not after.receive({"door": True})  # it is for the next process


def test_readings_that_change_nothing_do_not_fill_the_disk(kept: Kept) -> None:
    source = kept.source()
    source.receive({"door": True, "motion": True})
    taken(source, 1)
    for _ in range(40_000):
        source.receive({"door": True})
    assert sum(path.stat().st_size for path in kept.folder.iterdir()) < 1 << 20
    assert kept.source().statistics().after == 40_000
    assert kept.rows() == 1


def test_the_next_row_says_when_nothing_was_listened_to(kept: Kept) -> None:
    time = FakeTime(100.0)
    source = kept.source(time=time)
    for moment, on in (
        (1.0, False),
        (2.0, True),
        (5.0, False),
        (5.5, False),
        (9.0, True),
    ):
        time.pass_until(100.0 + moment)
        source.listens(on)
    give(source, 1, 2)
    outages = [row.outages for row in read_journal(kept.folder).rows]
    assert outages == [(Outage(105.0, 109.0, "not connected"),), ()]
    assert source.statistics().received.outages == 1
    source.listens(False)
    assert source.statistics().received.outages == 2  # it has not ended


def test_a_process_that_follows_a_dead_one_says_since_when(kept: Kept) -> None:
    source = kept.source()
    give(source, 1)
    os.utime(next(iter(kept.folder.iterdir())), (50.0, 50.0))
    after = LiveSource(
        LatestReadings(NAMES),
        OnChange(),
        journal=Journal(kept.folder, NAMES, "intake: killed"),
    )
    timed(after, FakeTime(70.0))
    after.resume_after(1)
    assert after.statistics().received.outages == 1
    after._start()
    give(after, 2)
    *_, row = read_journal(kept.folder).rows
    assert row.outages == (Outage(50.0, 70.0, "intake: killed"),)
    assert (row.received.shown, row.received.outages) == (2, 1)


def test_each_of_two_processes_that_die_before_a_row_is_told_of(kept: Kept) -> None:
    give(kept.source(), 1)
    for moment, why in ((70.0, "killed"), (80.0, "killed again")):
        after = LiveSource(
            LatestReadings(NAMES), OnChange(), journal=Journal(kept.folder, NAMES, why)
        )
        timed(after, FakeTime(moment))
        after.resume_after(1)
        after._start()
        after.listens(True)
        if why == "killed again":
            after.listens(False)
    last = kept.source(time=FakeTime(90.0))
    last.resume_after(1)
    last._start()
    give(last, 2)
    *_, row = read_journal(kept.folder).rows
    whys = [outage.why for outage in row.outages]
    assert whys == ["killed", "killed again", "not connected"]
    assert row.received.outages == 3


def test_what_was_known_at_the_tick_is_told(kept: Kept) -> None:
    source = kept.source()
    source.resume_after(0)
    source.receive_whole([True, None])
    source.receive_whole([True, True])
    taken(source, 2)
    known = source.resume_after(1)
    assert known is not None
    assert known.tolist() == [True, False]
    assert source.resume_after(2) is None


FLOOD = [(number + 1.0, number % 2 == 1) for number in range(2 * ROOM)]


@pytest.mark.parametrize(
    ("schedule", "puts", "kept_"),
    [
        # Each change, within the limits of the schedule.
        (OnChange(), [(1.0, False), (2.0, True), (2.0, True), (2.0, False)], [2, 3, 2]),
        (Clocked(0.1), [(50.0, False)], [2]),  # ticks do not pile up
        (OnChange(), FLOOD, [2, 3] * (ROOM // 2)),  # nor do changes without end
    ],
)
def test_changes_that_nobody_asks_for_are_kept(
    kept: Kept,
    schedule: TickSchedule,
    puts: list[tuple[float, bool]],
    kept_: list[int],
) -> None:
    time = FakeTime()
    source = kept.source(schedule, time)
    source.resume_after(0)
    source.receive({"door": True, "motion": True})
    assert taken(source, 1) == bits(3)
    for moment, on in puts:
        time.at(moment, lambda on=on: source.receive({"door": on}))  # type: ignore[misc]
    time.at(3.0 * ROOM, source.wake_reader)
    source.keep_changes()
    assert kept.rows() == 1 + len(kept_)
    source.resume_after(1)
    assert taken(source, len(kept_)) == bits(*kept_)


def test_an_action_is_carried_out_once_however_often_it_is_decided(kept: Kept) -> None:
    done: list[int] = []
    source = kept.source(done=done)
    source.resume_after(0)
    give(source, 1, 2, 3)
    assert source.first() is not None
    assert source.step(1) is not None
    source.resume_after(1)
    assert source.step(1) is not None  # at the same tick
    assert done == [1]
    again = kept.source(done=done)
    again.resume_after(1)
    assert again.step(1) is not None
    assert done == [1]
    assert again.step(0) is not None
    assert done == [1, 0]


def test_no_more_is_taken_in_than_the_run_has_ticks(kept: Kept) -> None:
    source = kept.source(most=2)
    source.resume_after(0)
    give(source, 1, 2, 3)
    assert source.is_full
    assert not source.wait_for_room()
    assert kept.rows() == 2


def test_a_full_disk_fails_the_run_once_what_was_written_is_used(
    kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = kept.source()
    source.resume_after(0)
    give(source, 1)

    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "write", full)
    give(source, 2)
    assert not source.receive({"door": True})  # nobody is told that it arrived
    assert taken(source, 1) == bits(1)
    with pytest.raises(NeurosnapError, match=r"^journal: .* No space left on device"):
        source.step(0)
    assert np.all(source.statistics().received.dropped == 0)
