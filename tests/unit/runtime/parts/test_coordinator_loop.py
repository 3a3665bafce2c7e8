"""The event loop passes messages to its core in order and reports every failure."""

import asyncio
import logging
from collections.abc import Callable, Sequence

import pytest

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.parts import coordinator_loop
from neurosnap.runtime.parts.coordinator_loop import (
    Deadlines,
    WorldDeadline,
    _CoordinatorLoop,
    run_coordinator,
)
from neurosnap.runtime.parts.coordinator_process import answer_within
from tests.support.patience import PATIENCE


class Core:
    """A core that starts waves and notes what it is asked, until told to finish."""

    def __init__(self, waves: int = 0) -> None:
        self.finished = False
        self.asked: list[str] = []
        self._waves = waves
        self._next = 1
        self._flying: list[int] = []

    @property
    def tick(self) -> int:
        return 7

    @property
    def in_flight(self) -> tuple[int, ...]:
        return tuple(self._flying)

    def begin(self) -> list[wire.Message]:
        self.asked.append("begin")
        return [self._start(0) for _ in range(self._waves)]

    def receive(self, message: wire.Message) -> list[wire.Message]:
        """Let the wave settle that a report is on; what else comes is an error."""
        if message.sender == "coordinator":
            return []
        assert isinstance(message, wire.CellReport), "nothing else is expected"
        self.asked.append(f"settled {message.wave}")
        self._flying.remove(message.wave)
        return []

    def overdue(self, number: int) -> list[wire.Message]:
        self.asked.append(f"overdue {number}")
        self._flying.remove(number)
        return [self._start(number)]

    def stop(self) -> list[wire.Message]:
        self.asked.append("stop")
        self.finished = True
        return []

    def _start(self, repeats: int) -> wire.Message:
        self._flying.append(self._next)
        self._next += 1
        return wire.WaveStart(
            self._next - 1, 1, "state", 0, 1, repeats=repeats, fence=1
        )


class Clock:
    """What the shell takes for `time`."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(coordinator_loop, "time", clock)
    return clock


async def test_late_waves_are_repeated_one_after_the_other(clock: Clock) -> None:
    """A repeat wires all cells anew, which another's reports would fall into."""
    core, fabric = Core(3), MemoryHub().fabric("coordinator")
    shell_ = _CoordinatorLoop(
        core, fabric, (), Deadlines(1.0), lambda _: None, lambda _: None
    )

    def settle(wave: int) -> None:
        report = wire.CellReport(wave, 0, 0, (0,), (0,), (0,), 0)
        payload = wire.encode(report)
        shell_.handle([wire.Delivery(report.key, 0, 0, payload)])

    shell_.begin()
    clock.now = 1.5
    shell_._find_overdue()
    shell_._find_overdue()
    assert core.asked == ["begin", "overdue 1"]
    settle(4)
    assert core.asked[2:] == ["settled 4", "overdue 2"]
    clock.now = 3.0
    shell_._find_overdue()
    assert core.asked[4:] == ["overdue 5"]  # a repeat that is late itself goes first
    settle(6)
    assert core.asked[5:] == ["settled 6", "overdue 3"]
    settle(7)
    assert core.asked[7:] == ["settled 7"]


class Broken(MemoryFabric):
    """A network that takes no more once a wave has been started."""

    def publish(self, *messages: wire.Message) -> None:
        if any(isinstance(m, wire.WaveStart) and m.repeats for m in messages):
            raise RuntimeError("the session is closed")
        super().publish(*messages)


CALM = Deadlines(100.0)


async def conduct(
    core: Core,
    fabric: MemoryFabric,
    stop: asyncio.Event | None = None,
    *,
    parts: Sequence[str] = (),
    deadlines: Deadlines = CALM,
    on_progress: Callable[[int], None] = lambda _: None,
) -> None:
    async with asyncio.timeout(PATIENCE), fabric:
        await run_coordinator(
            core,
            fabric,
            stop or asyncio.Event(),
            parts=parts,
            deadlines=deadlines,
            on_progress=on_progress,
        )


async def test_whatever_goes_wrong_at_a_deadline_ends_the_run() -> None:
    with pytest.raises(RuntimeError, match="the session is closed"):
        fabric = Broken(MemoryHub(), "coordinator")
        await conduct(Core(1), fabric, deadlines=Deadlines(0.02))


async def test_a_run_that_failed_before_it_began_does_not_begin() -> None:
    hub, core = MemoryHub(), Core()
    publish = hub.fabric("world").publish
    loop = asyncio.get_running_loop()
    loop.call_soon(loop.call_soon, publish, wire.Observation(1, b"\x01"))
    with pytest.raises(AssertionError, match="nothing else is expected"):
        await conduct(core, hub.fabric("coordinator"), parts=["cell/0"])
    assert core.asked == []


async def test_a_part_that_never_comes_up_is_named() -> None:
    fabric, core = MemoryHub().fabric("coordinator"), Core()
    rule = r"^swarm: every part must come up within 0\.01 s, missing: cell/0, cell/2$"
    with pytest.raises(SwarmError, match=rule):
        deadlines = Deadlines(100.0, parts=0.01)
        await conduct(core, fabric, parts=["cell/2", "cell/0"], deadlines=deadlines)
    assert core.asked == []


async def test_a_second_part_is_refused_and_the_run_begins_once_it_is_gone() -> None:
    hub, core, stop = MemoryHub(), Core(), asyncio.Event()
    faults: list[wire.Message] = []
    asked_before, there = list[str](), list[str]()

    def hear(deliveries: list[wire.Delivery]) -> None:
        faults.extend(wire.decode(one.key, one.payload) for one in deliveries)
        asked_before.extend(core.asked)
        assert "world" in there
        hub.leave("cell/0/b")

    hub.fabric("service").listen(("fault/coordinator",), hear)
    for who in ("cell/0", "cell/0/b"):
        hub.announce(who)
    # Not before the recorder hears it: it would be missing.
    asyncio.get_running_loop().call_soon(hub.announce, "world")
    hub.watch("recorder", lambda who, _: there.append(who))
    fabric, parts = hub.fabric("coordinator"), ["cell/0", "world"]
    await conduct(core, fabric, stop, parts=parts, on_progress=lambda _: stop.set())
    assert (asked_before, core.asked) == ([], ["begin", "stop"])
    what = "cell/0/b: must be there once, is the second of its name"
    assert faults == [wire.Fault("coordinator", what)]


@pytest.mark.parametrize("second", ["cell/0/b", "coordinator/b"])
async def test_a_second_part_ends_a_run_that_has_begun(second: str) -> None:
    hub = MemoryHub()
    hub.announce("cell/0")
    asyncio.get_running_loop().call_soon(hub.announce, second)
    with pytest.raises(PartDiedError, match=rf"^{second}: must be there once"):
        await conduct(Core(), hub.fabric("coordinator"), parts=["cell/0"])


async def test_it_says_that_it_goes_on_even_if_nothing_happens(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(coordinator_loop, "_WORD", 0.001)
    core, stop, said = Core(), asyncio.Event(), list[int]()

    def on_progress(tick: int) -> None:
        said.append(tick)
        if len(said) == 4:
            stop.set()

    fabric = MemoryHub().fabric("coordinator")
    await conduct(core, fabric, stop, on_progress=on_progress)
    assert said[:4] == [7] * 4
    assert core.asked == ["begin", "stop"]


# The deadline of the world ------------------------------------------------------------

DECISION = wire.Decision(6, -1, "why")
WAVE = wire.WaveStart(1, 7, "state", 0, 1)
STATE = wire.State(7, 1, b"", False, 0, 0, 0, 0, 0)


def test_a_world_that_does_not_answer_is_named(clock: Clock) -> None:
    answer = WorldDeadline(3.0)
    answer.published(DECISION)
    clock.now += 3.0
    answer.check()
    clock.now += 0.1
    said = r"^world: must answer the decision of tick 6 within 3 s, got nothing$"
    with pytest.raises(PartDiedError, match=said):
        answer.check()


def test_who_is_waited_for_is_said_once_a_decision(
    clock: Clock, caplog: pytest.LogCaptureFixture
) -> None:
    answer = WorldDeadline(3.0)
    with caplog.at_level(logging.WARNING):
        for tick in (6, 7):
            answer.published(wire.Decision(tick, -1, ""))
            for _ in range(5):
                clock.now += 0.5
                answer.check()
    assert caplog.messages == [
        "waiting for world: tick 7, 1.5 s",
        "waiting for world: tick 8, 1.5 s",
    ]


@pytest.mark.parametrize(
    ("patience", "said"),
    [
        (3.0, []),  # before the run begins
        (3.0, [DECISION, WAVE, STATE]),  # waves have deadlines of their own
        (None, [DECISION]),  # what is outside may take any time
    ],
)
def test_the_world_is_waited_for_only_while_it_has_to_answer(
    clock: Clock, patience: float | None, said: list[wire.Message]
) -> None:
    answer = WorldDeadline(patience)
    for message in said:
        clock.now += 2.0
        answer.published(message)
    clock.now += 10**6
    answer.check()


@pytest.mark.parametrize(
    ("source", "seconds"),
    [("-", None), ("zenoh:", None), ("mqtt:", None), ("log.csv", 6.0)],
)
def test_only_what_is_outside_has_no_deadline(
    source: str, seconds: float | None
) -> None:
    options = RunOptions(source=source, body=Body(own=("a",)), deadline=2.0)
    assert answer_within(options) == seconds
