"""An external source: its readings, timing, thread safety, and its journal."""

import errno
import logging
import os
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import FabricError, NeurosnapError
from neurosnap.sources.live.journal import Journal, read_journal
from neurosnap.sources.live.latest_or_late import (
    TOLERANCE,
    ClockMapping,
    LatestReadings,
)
from neurosnap.sources.live.live_source import CHANGES, ROOM, LiveSource
from neurosnap.sources.live.tick_schedule import Clocked, OnChange, TickSchedule
from neurosnap.sources.protocol import Observed
from neurosnap.wire import Outage, Received
from tests.support.fake_time import FakeTime, Told, timed
from tests.support.sources import readings

NAMES = ["door", "motion"]
EPOCH = 1_690_000_000.0
END = 60.0
Shown = list[bool | None]
Put = tuple[int, int, bool | None]


def source_of(
    time: FakeTime, schedule: TickSchedule, stale_after: float | None = None
) -> LiveSource:
    latest = LatestReadings(NAMES, stale_after=stale_after)
    return timed(LiveSource(latest, schedule), time, EPOCH)


def run(
    source: LiveSource, time: FakeTime, puts: list[Put], busy: Sequence[int]
) -> list[tuple[float, Shown]]:
    """Return the ticks and their times; the world is busy for a while after each."""
    for when, sensor, on in puts:
        time.at(when, lambda s=sensor, o=on: source.receive({NAMES[s]: o}))  # type: ignore[misc]
    time.at(END, source.close)
    ticks: list[tuple[float, Shown]] = []
    seen = source.first()
    while seen is not None:
        ticks.append((time.now, readings(seen)))
        time.pass_until(time.now + busy[len(ticks) % len(busy)])
        seen = source.step(-1)
    return ticks


def view(puts: list[Put], now: float, stale: float | None) -> Shown:
    """Return what all readings up to `now` come to."""
    found: Shown = []
    for sensor in range(len(NAMES)):
        mine = [(t, on) for t, s, on in puts if s == sensor and t <= now]
        when, on = mine[-1] if mine else (0, None)
        found.append(on if stale is None or now < when + stale else None)
    return found


PUTS = st.lists(
    st.tuples(
        st.integers(0, 25), st.integers(0, 1), st.sampled_from([True, False, None])
    ),
    max_size=15,
).map(lambda puts: sorted(puts, key=lambda p: p[0]))
BUSY = st.lists(st.integers(0, 6), min_size=1, max_size=5)
STALE = st.none() | st.integers(1, 8).map(float)


@given(PUTS, BUSY, STALE, st.integers(1, 4), st.none() | st.integers(4, 9))
def test_on_change_every_moment_is_judged_by_all_readings_so_far(
    puts: list[Put],
    busy: list[int],
    stale: float | None,
    least: int,
    most: int | None,
) -> None:
    time = FakeTime()
    schedule = OnChange(float(least), None if most is None else float(most))
    source = source_of(time, schedule, stale)
    ticks = run(source, time, puts, busy)

    expected: list[tuple[float, Shown]] = []
    free = 0.0
    for moment in np.arange(0.0, END):
        if moment < free:
            continue
        seen = view(puts, moment, stale)
        since = moment - expected[-1][0] if expected else np.inf
        changed = not expected or seen != expected[-1][1]
        must = bool(expected) and most is not None and since >= most
        if seen != [None, None] and ((changed and since >= least) or must):
            expected.append((float(moment), seen))
            free = moment + busy[len(expected) % len(busy)]
    assert ticks == expected


@given(PUTS, BUSY, STALE, st.integers(1, 6))
def test_by_the_clock_a_late_tick_comes_at_once_and_hides_those_before_it(
    puts: list[Put], busy: list[int], stale: float | None, interval: int
) -> None:
    time = FakeTime()
    ticks = run(source_of(time, Clocked(float(interval)), stale), time, puts, busy)

    expected: list[tuple[float, Shown]] = []
    free, due = 0.0, 0.0
    for moment in np.arange(0.0, END):
        seen = view(puts, moment, stale)
        if moment >= max(free, due) and seen != [None, None]:
            expected.append((float(moment), seen))
            free = moment + busy[len(expected) % len(busy)]
            while (due := due + interval) <= moment:
                pass
    assert ticks == expected


@pytest.mark.parametrize("fails", [False, True])
def test_whole_readings_have_a_tick_each_before_the_latest_or_a_failure_shows(
    fails: bool,
) -> None:
    source = source_of(FakeTime(), OnChange())
    source.receive_whole([True, None])
    source.receive_whole([True, None])
    source.receive_whole([None, None])  # says nothing, so there is nothing to show
    source.receive_whole([False, True])
    source.receive({"door": True})
    if fails:
        source.fail(FabricError("hub: gone"))
    else:
        source.end()
    seen = [source.first(), source.step(-1), source.step(-1)]
    assert [readings(each) for each in seen if each is not None] == [
        [True, None],
        [True, None],
        [False, True],
    ]
    if fails:
        with pytest.raises(FabricError, match=r"^hub: gone$"):
            source.step(-1)
        return
    latest = source.step(-1)
    assert latest is not None
    assert readings(latest) == [True, True]
    assert source.step(-1) is None


def test_a_whole_reading_that_is_late_has_its_tick_and_replaces_nothing() -> None:
    source = source_of(FakeTime(), OnChange())
    source.receive({"door": True})
    source.receive_whole([False, True], at=EPOCH)
    source.receive({"motion": False})
    assert source.first() is not None  # the whole one
    source.receive({"motion": True})
    source.receive_whole(
        [True, True], at=EPOCH - 10.0
    )  # late: the latest keeps its own
    assert source.step(-1) is not None
    assert source.step(-1) is not None
    source.receive({"motion": False})
    counted = source.statistics()
    assert (counted.received.late, counted.received.shown, counted.after) == (0, 5, 1)


@pytest.mark.parametrize(("busy", "told"), [(0.5, 0), (1.5, 1)])
def test_a_run_that_cannot_keep_up_is_told_so_once(
    busy: float, told: int, caplog: pytest.LogCaptureFixture
) -> None:
    time = FakeTime()
    source = source_of(time, Clocked(1.0))
    source.receive({"door": True})
    source.first()
    for _ in range(90):
        time.pass_until(time.now + busy)
        source.step(-1)
    assert sum("--cells inline" in line for line in caplog.messages) == told


def test_a_run_that_makes_up_for_a_restart_keeps_up(
    caplog: pytest.LogCaptureFixture,
) -> None:
    source = source_of(FakeTime(), OnChange())
    for number in range(90):
        source.receive_whole([number % 2 == 0, True])
    source.first()
    for _ in range(89):
        source.step(-1)
    assert caplog.messages == []


@pytest.mark.parametrize(
    ("schedule", "busy", "behind"),
    [
        (Clocked(1.0), 0.9, [0, 0, 0]),
        (Clocked(1.0), 1.4, [0, 0.8, 1.2]),  # of 1.4, 2.8 and 4.2, due at 1, 2 and 3
        (Clocked(10.0), 12.0, [2, 4, 6]),  # a second is allowed, not half of ten
        (OnChange(), 0.9, [0, 0, 0]),
        (OnChange(), 1.5, [1.5, 1.5, 1.5]),
        (OnChange(min_interval=0.5), 1.5, [1, 1, 1]),
    ],
)
def test_a_tick_is_behind_by_how_long_it_was_due(
    schedule: TickSchedule, busy: float, behind: list[float]
) -> None:
    time, found = FakeTime(), list[float]()
    source = source_of(time, schedule)
    source.receive({"door": True})
    assert source.first() is not None
    for turn in range(3):
        time.at(time.now + 0.1, lambda on=turn % 2: source.receive({"door": bool(on)}))  # type: ignore[misc]
        time.pass_until(time.now + busy)
        seen = source.step(-1)
        assert seen is not None
        found.append(seen.due and EPOCH + time.now - seen.due)
    assert found == pytest.approx(behind)


def test_a_change_that_comes_while_it_is_waited_for_is_not_late() -> None:
    time = FakeTime()
    source = source_of(time, OnChange())
    source.receive({"door": True})
    assert source.first() is not None
    time.at(50.0, lambda: source.receive({"door": False}))
    seen = source.step(-1)
    assert seen is not None
    assert (time.now, seen.due, seen.waiting) == (50.0, 0, 0)


def test_the_last_change_is_shown_at_the_end_whatever_the_pace() -> None:
    time = FakeTime()
    source = source_of(time, OnChange(min_interval=50.0))
    source.receive({"door": True})
    assert source.first() is not None
    source.receive({"door": False})
    source.end()
    seen = source.step(-1)
    assert seen is not None
    assert readings(seen) == [False, None]
    assert source.step(-1) is None
    assert time.now == 0.0


def test_only_the_first_tick_begins_and_so_does_one_that_goes_on() -> None:
    def begins(seen: Observed | None) -> bool:
        assert seen is not None
        return seen.begins

    source = source_of(FakeTime(), Clocked(1.0))
    source.receive({"door": True})
    said = [begins(source.first()), begins(source.step(0)), begins(source.first())]
    assert said == [True, False, True]
    assert not source.resumed

    source = source_of(FakeTime(), Clocked(1.0))
    source.receive({"door": True})
    assert [begins(source.step(0)) for _ in range(3)] == [True, False, False]
    assert source.resumed


def test_actions_are_carried_out_before_their_consequence() -> None:
    done: list[int] = []
    source = LiveSource(
        LatestReadings(NAMES),
        Clocked(1.0),
        actions=["ring", "wait"],
        actuate=done.append,
    )
    source.receive({"door": True})
    assert source.first() is not None
    source.close()
    assert source.step(1) is None
    assert done == [1]


def test_stamps_are_times_since_the_epoch() -> None:
    time = FakeTime(500.0)
    source = source_of(time, OnChange(), stale_after=10.0)
    source.receive({"door": True}, at=EPOCH + 495.0)
    source.receive({"door": False}, at=EPOCH + 494.0)
    source.receive({"motion": True}, at=EPOCH + 480.0)
    time.at(600.0, source.close)
    seen = source.first()
    assert seen is not None
    assert readings(seen) == [True, None]
    assert source.statistics().received.late == 1
    assert source.step(-1) is None  # at 505 nothing is known any more
    assert time.now == 600.0


def test_a_sensor_that_appears_under_way_is_refused(
    caplog: pytest.LogCaptureFixture,
) -> None:
    source = source_of(FakeTime(), OnChange())
    source.receive({"lamp": True, "door": True})
    assert caplog.messages == [
        "sensor: must be one the run began with, got 'lamp'"
        " (name it among the sensors and start again)"
    ]
    assert source.first() is not None  # of the door
    source.receive({"lamp": True})
    received = source.statistics().received
    assert (received.shown, received.refused) == (1, 1)


def test_a_flood_of_bad_input_is_a_line_a_second(
    caplog: pytest.LogCaptureFixture,
) -> None:
    time = FakeTime()
    source = source_of(time, OnChange())
    for _ in range(50):
        source.refuse("line 1: must be JSON, got 'x'")
        time.pass_until(time.now + 0.1)
    source.close()
    said = [r.getMessage() for r in caplog.records]
    assert all(r.levelno == logging.WARNING for r in caplog.records)
    assert said.count("line 1: must be JSON, got 'x'") <= 5
    untold = [int(line.split()[0]) for line in said if "more refused" in line]
    assert sum(untold) + len(said) - len(untold) == 50
    assert source.statistics().received.refused == 50


# Threads ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "end"),
    [("first", "close"), ("first", "end"), ("first", "fail"), ("room", "close")],
)
def test_who_waits_is_let_go(call: str, end: str) -> None:
    source = LiveSource(LatestReadings(NAMES), OnChange())
    source._condition = lock = Told()
    found: list[object] = []

    def wait() -> None:
        try:
            found.append(source.first())
        except FabricError as error:
            found.append(str(error))

    if call == "room":
        for _ in range(ROOM):
            source.receive_whole([True, True])
    target = wait if call == "first" else lambda: found.append(source.wait_for_room())
    waiting = threading.Thread(target=target)
    waiting.start()
    assert lock.waiting.wait(10)
    if end == "fail":
        source.fail(FabricError("hub: gone"))
    else:
        getattr(source, end)()
    waiting.join(10)
    assert found == [{"room": False}.get(call, "hub: gone" if end == "fail" else None)]
    source.close()


def test_a_feeder_is_not_started_once_the_source_is_closed() -> None:
    calls: list[str] = []

    class Noted:
        def start(self, source: LiveSource) -> None:
            calls.append("start")

        def stop(self) -> None:
            calls.append("stop")

    source = LiveSource(LatestReadings(NAMES), OnChange(), feeder=Noted())
    source.close()
    assert source.first() is None
    assert calls == ["stop"]


@given(
    st.lists(
        st.tuples(st.integers(0, 100), st.floats(-0.4, 0.4)), min_size=2, max_size=20
    )
)
def test_equal_stamps_stay_equal_and_order_is_kept(
    stamps: list[tuple[int, float]],
) -> None:
    made = ClockMapping(7.0, EPOCH)
    # The two clocks are never read at quite the same moment.
    converted = [
        (at, made.on_our_clock(EPOCH + at, now, EPOCH + now - 7.0 + jitter))
        for now, (at, jitter) in enumerate(stamps, 7)
    ]
    for at, ours in converted:
        for other, theirs in converted:
            assert (at < other) == (ours < theirs)


def test_a_wall_clock_put_right_counts_from_then_on() -> None:
    made = ClockMapping(0.0, 1000.0)
    assert made.on_our_clock(1004.0, 5.0, 1005.0 + TOLERANCE / 2) == 4.0
    assert made.on_our_clock(9004.0, 5.0, 9005.0) == 4.0
    assert made.on_our_clock(9006.0, 7.0, 9007.0) == 6.0


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


FLOOD = [(number + 1.0, number % 2 == 1) for number in range(2 * CHANGES)]


@pytest.mark.parametrize(
    ("schedule", "puts", "kept_"),
    [
        # Each change, within the limits of the schedule.
        (OnChange(), [(1.0, False), (2.0, True), (2.0, True), (2.0, False)], [2, 3, 2]),
        (Clocked(0.1), [(50.0, False)], [2]),  # ticks do not pile up
        (OnChange(), FLOOD, [2, 3] * (CHANGES // 2)),  # nor do changes without end
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
    time.at(3.0 * CHANGES, source.wake_reader)
    source.keep_changes()
    assert kept.rows() == 1 + len(kept_)
    source.resume_after(1)
    assert taken(source, len(kept_)) == bits(*kept_)


def test_whole_readings_wait_from_when_they_came_but_not_for_a_swarm(
    kept: Kept,
) -> None:
    time = FakeTime(100.0)
    source = kept.source(time=time)

    def due(now: float) -> tuple[float, int]:
        time.pass_until(now)
        seen = source.step(0) if source.given else source.first()
        assert seen is not None
        return seen.due, seen.waiting

    source.resume_after(0)
    give(source, 1, 2, 3)
    time.at(201.0, lambda: give(source, 1))
    assert [due(200.0), due(200.5)] == [(0, 0), (0, 0)]  # none asked until 200
    assert [due(203.0), due(204.0)] == [(200.0, 1), (201.0, 0)]
    time.pass_until(300.0)
    source.resume_after(1)  # another swarm goes on, after a death
    assert [due(300.0), due(302.0)] == [(0, 0), (300.0, 1)]


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
