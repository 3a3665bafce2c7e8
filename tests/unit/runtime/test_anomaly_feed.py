"""The anomaly feed of a swarm tolerates any message."""

import asyncio
from typing import Any, Self

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.agent.growth_in_decisions import Changed, Context
from neurosnap.agent.memory import AgentMemory
from neurosnap.fabric.protocol import Handler
from neurosnap.fabric.zenoh.discovery import FoundSwarm
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.anomaly_feed import Fed, _Alarms, _Incarnation
from neurosnap.runtime.parts.coordinator_process import RunDescription
from neurosnap.runtime.request import Watcher
from tests.support.patience import PATIENCE

OPTIONS = RunOptions(source="none", body=Body(own=("door", "motion")), watch=True)
LINK = wire.WeighedLink(0, 0, 2, 9.0, 1.0, 3)
GOOD = wire.Anomaly(5, 4, (0,), (0, 1), True, 1, (LINK,))
BAD = msgspec.structs.replace(GOOD, culprits=(7,))


class Swarm:
    """A swarm whose coordinator says something before it is asked what the run is."""

    who = "watcher"

    def __init__(
        self,
        before: list[wire.Message],
        after: list[wire.Message],
        options: RunOptions = OPTIONS,
    ) -> None:
        self._options = options
        self._before = before
        self._after = after

    def to(self, *_: str) -> Self:
        return self

    def fabric(self) -> Self:
        return self

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self._handler([])

    async def subscribe(self, _: tuple[str, ...], handler: Handler) -> None:
        self._handler = handler

    async def watch(self, _: object) -> None:
        """Nobody comes or goes."""

    async def ask(self) -> bytes:
        self._say(self._before)
        asyncio.get_running_loop().call_soon(self._say, self._after)
        return RunDescription(options=self._options).to_bytes()

    def _say(self, messages: list[wire.Message]) -> None:
        self._handler([wire.Delivery(m.key, 0, 0, wire.encode(m)) for m in messages])


async def test_an_anomaly_that_cannot_be_is_passed_over_early_and_late() -> None:
    heard: list[tuple[str, ...]] = []

    def hear(told: Fed) -> None:
        assert isinstance(told, NamedAnomaly)
        heard.append(told.culprits)

    waves: list[int] = []
    watcher = Watcher(on_waves=lambda so_far: waves.append(so_far.number))
    reached = wire.Reached(1, 7, (0,), b"", 1, 1, 1, 1)
    said: list[wire.Message] = [BAD, GOOD, reached]
    swarm: Any = Swarm(said, [*said, wire.Leave("coordinator")])
    async with asyncio.timeout(PATIENCE):
        incarnation = _Incarnation(hear, _Alarms(hear, None), None, watcher)
        in_order = await incarnation.look_on(swarm, FoundSwarm("demo"), asyncio.Event())
    assert in_order
    assert heard == [("door",), ("door",)]
    assert waves == [7, 7]


def grown(tick: int, literals: tuple[int, ...], sensor: int) -> wire.Decision:
    return wire.Decision(tick, 0, "", born=sensor, literals=literals)


async def test_births_are_told_also_by_who_came_after_the_first() -> None:
    body = Body.full(["door", "dark"], ["push"], room=4)
    first = body.size
    memory = AgentMemory(body)
    memory.body = body.grow(Context(0, (0, 2))).grow(Context(0, (1, 3)))
    frame = wire.KeyFrame(7, b"", agent=memory.to_bytes())
    early: list[wire.Message] = [
        grown(6, (1, 3), first + 1),
        frame,
    ]  # that of `first` was not heard
    late: list[wire.Message] = [
        grown(8, (0, 2), first + 2),
        wire.Decision(9, 0, "", retires=first),
        wire.Leave("coordinator"),
    ]
    options = RunOptions(source="none", body=body, agent="planner")
    heard: list[object] = []
    async with asyncio.timeout(PATIENCE):
        swarm: Any = Swarm(early, late, options)
        incarnation = _Incarnation(heard.append, _Alarms(heard.append, None), None)
        await incarnation.look_on(swarm, FoundSwarm("demo"), asyncio.Event())
    assert heard == [
        Changed(6, first + 1, "push&~door&~dark"),
        Changed(8, first + 2, "push&door&dark#2"),
        Changed(9, first, "push&door&dark", retires=True),
    ]
