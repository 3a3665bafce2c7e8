"""Whoever looks on at a swarm bears whatever comes."""

import asyncio
from typing import Any, Self

import msgspec

from neurosnap import wire
from neurosnap.agent.body import Body
from neurosnap.fabric.protocol import Handler
from neurosnap.fabric.zenoh.discovery import FoundSwarm
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.anomaly_feed import _look_on
from neurosnap.runtime.parts.run_description import RunDescription
from tests.support.patience import PATIENCE

OPTIONS = RunOptions(source="none", body=Body(own=("door", "motion")), watch=True)
GOOD = wire.Anomaly(5, 4, (0,), (0, 1), True, 1, (0,), (0,), (2,), (9.0,), (1.0,), (3,))
BAD = msgspec.structs.replace(GOOD, culprits=(7,))


class Swarm:
    """A swarm whose coordinator says something before it is asked what the run is."""

    who = "watcher"

    def __init__(self, before: list[wire.Message], after: list[wire.Message]) -> None:
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

    async def ask(self) -> bytes:
        self._say(self._before)
        asyncio.get_running_loop().call_soon(self._say, self._after)
        return RunDescription(options=OPTIONS).to_bytes()

    def _say(self, messages: list[wire.Message]) -> None:
        self._handler([wire.Delivery(m.key, 0, 0, wire.encode(m)) for m in messages])


async def test_an_anomaly_that_cannot_be_is_passed_over_early_and_late() -> None:
    heard: list[tuple[str, ...]] = []
    said: list[wire.Message] = [BAD, GOOD]
    swarm: Any = Swarm(said, [*said, wire.Leave("coordinator")])
    async with asyncio.timeout(PATIENCE):
        in_order = await _look_on(
            swarm,
            FoundSwarm("demo"),
            asyncio.Event(),
            lambda told: heard.append(told.culprits),
        )
    assert in_order
    assert heard == [("door",), ("door",)]
