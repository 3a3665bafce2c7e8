"""The world process: its observations from a source, and waiting for a live one."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec
import numpy as np
import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import InvalidValueError, MessageError, NeurosnapError
from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.protocol.resume_point import ResumePoint, seen_after
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.world import World
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.parts.world_process import run_world
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sensorium import pack
from tests.support.patience import PATIENCE
from tests.support.scripted_sources import Live, Scripted

PLAIN = Body(own=("s0", "s1"))
ACTING = Body.full(["s0", "s1"], ["go", "stay"])
ROWS: list[list[bool | None]] = [
    [True, False],
    [None, True],
    [True, None],
    [False, False],
]


def told(world: World, tick: int, action: int = -1) -> wire.Observation | None:
    """Return what the world answers to a decision it hears."""
    decision = world.receive(wire.Decision(tick, action, "as asked"))
    assert decision is not None
    return world.answer(decision)


def believe(world: World, tick: int) -> None:
    """Let it hear a state that says nothing."""
    literals = pack([False] * (2 * len(ACTING.sensors)))
    world.receive(wire.State(tick, 1, literals, False, 0, 0, 0, 0, 0))


def past(tick: int, *actions: int, sensors: int = 2, state: bytes = b"") -> ResumePoint:
    packed = state or pack([False] * (2 * sensors))
    return ResumePoint("log", tick, actions, packed, {}, (tick,))


def test_a_run_does_not_go_on_from_other_readings() -> None:
    checksum = 0
    for row in ([True, None], [True, True]):
        known = b"" if None not in row else b"\x01"
        bits = pack([bit is True for bit in row])
        checksum = seen_after(checksum, bits, known)
    before = msgspec.structs.replace(past(2, -1), seen=(1, checksum))
    World(Scripted([[True, None], [True, True], [False, True]]), PLAIN, before)
    rule = r"^source: must have read at ticks 1 to 2 as recorded"
    for begin in ([True, False], [False, None]):
        with pytest.raises(InvalidValueError, match=rule):
            World(Scripted([begin, [True, True]]), PLAIN, before)


# What it makes of a source ------------------------------------------------------------


def test_what_is_unknown_is_off_and_said_to_be_unknown() -> None:
    world = World(Scripted(ROWS), PLAIN)
    assert [told(world, tick) for tick in range(5)] == [
        wire.Observation(1, b"\x01", True),
        wire.Observation(2, b"\x02", known=b"\x02"),
        wire.Observation(3, b"\x01", known=b"\x01"),
        wire.Observation(4, b"\x00"),
        None,
    ]


def test_a_source_that_knows_nothing_is_named() -> None:
    world = World(Scripted([[True, True], [None, None]]), PLAIN)
    told(world, 0)
    rule = r"^source: known readings at tick 2: must be 1 at least, got 0$"
    with pytest.raises(InvalidValueError, match=rule):
        told(world, 1)


def test_a_decision_that_came_before_changes_nothing() -> None:
    world = World(Scripted(ROWS), PLAIN)
    told(world, 0)
    assert world.receive(wire.Decision(0, -1, "again")) is None
    decision = world.receive(wire.Decision(1, -1, "once"))
    # Nor does one that comes again while the source is still being waited for.
    assert world.receive(wire.Decision(1, -1, "once")) is None
    assert decision is not None
    assert world.answer(decision) == wire.Observation(2, b"\x02", known=b"\x02")


BAD_STATE = wire.State(1, 1, b"\x00", False, 0, 0, 0, 0, 0)


@pytest.mark.parametrize(
    ("message", "rule"),
    [
        *[
            (wire.Decision(*wrong, "?"), "decision: must be for tick 1, of 2 actions")
            for wrong in ((2, 0), (1, 2), (1, -1))
        ],
        (wire.Decision(1, 0, "too early"), "decision: must come after the state of"),
        (BAD_STATE, "state: packed bits: must be 3 bytes long"),
    ],
)
def test_what_cannot_be_right_is_refused(message: wire.Message, rule: str) -> None:
    world = World(Scripted(ROWS, ACTING.actions), ACTING)
    told(world, 0)
    with pytest.raises(MessageError, match=rf"^{rule}"):
        world.receive(message)
    believe(world, 1)
    assert told(world, 1, 0) is not None


def test_a_source_is_brought_to_where_it_was() -> None:
    source = Scripted(ROWS, ACTING.actions)
    sensors = len(ACTING.sensors)
    world = World(source, ACTING, past(2, 1, sensors=sensors))
    assert source.taken == [1]
    observation = told(world, 2, 0)
    assert observation is not None
    assert (observation.tick, observation.begins) == (3, False)
    # What was unknown at tick 2 still is, in the context of what is done now.
    flags = np.unpackbits(np.frombuffer(observation.known, np.uint8), bitorder="little")
    unknown = {ACTING.sensors[k] for k in np.flatnonzero(flags[:sensors] == 0)}
    assert unknown == {"s1", "go&s0", "go&~s0"}


def test_a_live_source_goes_on_where_it_is_and_that_follows_no_action() -> None:
    source = Live(ROWS, ACTING.actions)
    source.let_go(2)
    world = World(source, ACTING, past(7, 1, 1, 0, sensors=len(ACTING.sensors)))
    assert source.taken == []
    first = told(world, 7, 1)
    believe(world, 8)
    second = told(world, 8, 0)
    assert first is not None
    assert second is not None
    assert source.taken == [1, 0]
    assert (first.tick, first.begins, first.bits) == (8, True, b"\x01\x00")
    assert (second.tick, second.begins) == (9, False)
    assert (first.cut, second.cut) == (True, False)
    assert second.bits[0] & 4  # the action is sensed


# How it waits -------------------------------------------------------------------------


class Watched:
    """A running world: what it says, and a way to tell it decisions."""

    def __init__(self, hub: MemoryHub) -> None:
        self.said: asyncio.Queue[wire.Message] = asyncio.Queue()
        self.stop = asyncio.Event()
        self._end = hub.fabric("coordinator")
        self._end.listen(("observation", "fault/**"), self._hear)

    def _hear(self, deliveries: list[wire.Delivery]) -> None:
        for delivery in deliveries:
            self.said.put_nowait(wire.decode(delivery.key, delivery.payload))

    def decide(self, tick: int) -> None:
        self._end.publish(wire.Decision(tick, -1, "as asked"))

    async def hear(self) -> wire.Message:
        async with asyncio.timeout(PATIENCE):
            return await self.said.get()


@asynccontextmanager
async def running(
    source: Scripted,
) -> AsyncIterator[tuple[Watched, asyncio.Task[None]]]:
    hub = MemoryHub()
    watched = Watched(hub)
    async with hub.fabric("world") as fabric, asyncio.TaskGroup() as group:
        task = group.create_task(run_world(source, PLAIN, fabric, watched.stop))
        listens = asyncio.Event()
        hub.watch("coordinator", lambda _who, _alive: listens.set())
        await listens.wait()
        yield watched, task


async def test_others_go_on_while_a_live_source_is_waited_for() -> None:
    source = Live(ROWS)
    async with running(source) as (world, _):
        world.decide(0)
        assert await asyncio.to_thread(source.waits.wait, 10)
        world.decide(5)  # heard, and refused, meanwhile
        fault = await world.hear()
        assert isinstance(fault, wire.Fault)
        assert fault.what.startswith("decision: must be for tick 0")
        source.let_go()
        assert await world.hear() == wire.Observation(1, b"\x01", True)
        world.stop.set()


@pytest.mark.parametrize("kind", [Live, Scripted])
async def test_a_source_that_is_over_ends_it_and_is_closed_if_it_is_live(
    kind: type[Scripted],
) -> None:
    source = kind(ROWS[:1])
    if isinstance(source, Live):
        source.let_go(2)
    async with running(source) as (world, task):
        world.decide(0)
        assert await world.hear() == wire.Observation(1, b"\x01", True)
        world.decide(1)
        async with asyncio.timeout(PATIENCE):
            await asyncio.wait([task])
    assert bool(source.closed) is (kind is Live)


async def test_a_live_source_that_fails_says_why() -> None:
    source = Live(ROWS)
    source.fails = True
    source.let_go()
    with pytest.raises(ExceptionGroup) as caught:
        async with running(source) as (world, task):
            world.decide(0)
            await asyncio.wait([task])
    (error,) = caught.value.exceptions
    assert isinstance(error, NeurosnapError)
    assert str(error) == "sensors: must answer, got nothing"
    assert source.closed


# In one process with all the others ---------------------------------------------------


async def test_a_swarm_in_one_process_ends_while_a_live_source_is_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source, log = Live(ROWS), tmp_path / "log.mcap"
    source.let_go(3)
    monkeypatch.setattr(
        "neurosnap.runtime.parts.world_process.open_source", lambda *_: source
    )
    options = RunOptions(source="scripted", body=PLAIN, cells="inline")
    stop = asyncio.Event()

    def on_progress(tick: int) -> None:
        if tick == 3:
            stop.set()

    async with asyncio.timeout(PATIENCE):
        ending = await run(RunRequest(options, log), stop, Watcher(on_progress))
    assert ending.stopped
    assert ending.totals.ticks == 3
    assert source.closed
    verdict = verify(log)
    assert (verdict.difference, verdict.complete, verdict.ticks) == (None, True, 3)
