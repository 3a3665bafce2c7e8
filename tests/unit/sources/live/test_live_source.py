"""An external source: its readings, its timing and its thread safety."""

import logging
import threading
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from neurosnap.errors import FabricError
from neurosnap.sources.live.latest_or_late import (
    TOLERANCE,
    ClockMapping,
    LatestReadings,
)
from neurosnap.sources.live.live_source import ROOM, SLOW, LiveSource
from neurosnap.sources.live.tick_schedule import Clocked, OnChange, TickSchedule
from neurosnap.sources.protocol import Observed
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
    for _ in range(3 * SLOW):
        time.pass_until(time.now + busy)
        source.step(-1)
    assert sum("--cells inline" in line for line in caplog.messages) == told


def test_a_run_that_makes_up_for_a_restart_keeps_up(
    caplog: pytest.LogCaptureFixture,
) -> None:
    source = source_of(FakeTime(), OnChange())
    for number in range(3 * SLOW):
        source.receive_whole([number % 2 == 0, True])
    source.first()
    for _ in range(3 * SLOW - 1):
        source.step(-1)
    assert caplog.messages == []


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
