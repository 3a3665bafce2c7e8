"""The health monitor of a run follows its readings, and catches up after a delay."""

import asyncio
import itertools
from itertools import pairwise
from pathlib import Path
from queue import Empty
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from msgspec.structs import replace

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.health.alarm import Standing
from neurosnap.health.follower import Follower
from neurosnap.health.ten_minute_steps import STEP
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts import health_listener
from neurosnap.runtime.parts.health_listener import HealthListener, Past
from neurosnap.sensorium import pack
from tests.support.lived_in import SENSORS, lived_in
from tests.support.patience import PATIENCE

DAYS = 16
FRIDGE = SENSORS.index("fridge")
OPTIONS = RunOptions(source="mqtt:", body=Body(own=SENSORS), alarms="1/week")
Home = list[tuple[float, np.ndarray]]
Course = list[tuple[wire.Observation, int]]


@pytest.fixture(scope="module")
def home() -> Home:
    """Return what is on from when on, in a home whose fridge stays open at the end."""
    spans = lived_in(DAYS, 1)
    left_open = max(on for on, _, sensor in spans if sensor == FRIDGE)
    spans = [
        (on, np.inf if on == left_open else off, sensor) for on, off, sensor in spans
    ]
    edges = sorted({at for on, off, _ in spans for at in (on, off) if at < np.inf})
    return [
        (at, np.isin(range(len(SENSORS)), [k for a, b, k in spans if a <= at < b]))
        for at in edges
    ]


def messages(home: Home) -> Course:
    return [
        (wire.Observation(tick, pack(on)), round(at * 1e9))
        for tick, (at, on) in enumerate(home, 1)
    ]


@pytest.fixture(autouse=True)
def _waits_for_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(health_listener, "_LAST", PATIENCE)


async def followed(course: Course) -> list[Standing]:
    """Return what is told of readings alone."""
    heard: list[Standing] = []
    listener = HealthListener(OPTIONS, heard.append)
    for message, sent in course:
        listener.receive(message, sent)
    stop = asyncio.Event()
    stop.set()
    await listener.serve(stop)
    return heard


@pytest.mark.slow
async def test_that_a_door_stays_open_is_told_although_nothing_is_read_any_more(
    home: Home, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock says so; whoever reads the recording further on says the same."""
    monkeypatch.setattr(health_listener, "_LOOK", 0.0)
    heard: list[Standing] = []
    stop = asyncio.Event()
    now = itertools.count(home[-1][0], STEP)
    clock = SimpleNamespace(time=lambda: next(now))
    monkeypatch.setattr(health_listener, "time", clock)

    def hear(standing: Standing) -> None:
        heard.append(standing)
        if [alarm.sensor for alarm in standing.alarms] == ["fridge"]:
            stop.set()

    listener = HealthListener(OPTIONS, hear)
    for message, sent in messages(home):
        listener.receive(message, sent)
    async with asyncio.timeout(PATIENCE):
        await listener.serve(stop)
    assert all(one != other for one, other in pairwise(heard))
    told = heard[-1].alarms[0]
    assert told.kind == "stuck"
    follower = Follower(SENSORS)
    for at, on in home:
        follower.observe(on, np.ones(len(SENSORS), np.bool_), at)
    assert not follower.standing.alarms
    follower.until(told.at)
    assert follower.standing.alarms == (told,)


@pytest.mark.slow
def test_a_file_of_long_ago_is_not_judged_by_todays_clock(
    home: Home, monkeypatch: pytest.MonkeyPatch
) -> None:
    heard: list[Standing] = []
    clock = SimpleNamespace(time=lambda: home[-1][0] + 300 * STEP)
    monkeypatch.setattr(health_listener, "time", clock)
    listener = HealthListener(replace(OPTIONS, source="home.csv"), heard.append)
    for message, sent in messages(home):
        listener.receive(replace(message, at=sent / 1e9), 0)
    waiting: list[object] = [listener._waiting.get() for _ in home]
    get = Mock(side_effect=[*waiting, Empty, None])  # a moment without a reading
    monkeypatch.setattr(listener, "_waiting", SimpleNamespace(get=get))
    listener._follow(heard.append)
    assert not heard[-1].alarms


async def test_a_tick_that_is_done_again_counts_once(home: Home) -> None:
    told = messages(home[:200])
    assert await followed([*told, *told[-9:]]) == await followed(told)


async def test_it_goes_on_without_a_recording(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    heard: list[Standing] = []
    past = Past(tmp_path / "gone.mcap", 9)
    one = replace(OPTIONS, body=Body(own=("a",)))
    listener = HealthListener(one, heard.append, past)
    listener.receive(wire.Observation(10, b"\x01"), 10**18)
    stop = asyncio.Event()
    stop.set()
    await listener.serve(stop)
    assert "health: learned from a part of the recording" in caplog.text
    assert [each.alarms for each in heard] == [()]


async def test_what_it_cannot_follow_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object, **__: object) -> None:
        raise OverflowError("no more room")

    monkeypatch.setattr(Follower, "observe", fails)
    heard: list[Standing] = []
    listener = HealthListener(OPTIONS, heard.append)
    listener.receive(wire.Observation(1, b"\x01"), 10**18)
    with pytest.raises(OverflowError, match="no more room"):
        async with asyncio.timeout(PATIENCE):
            await listener.serve(asyncio.Event())
