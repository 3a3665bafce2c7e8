"""Collects messages from a network, and waits for expected ones."""

import asyncio

from neurosnap import wire
from tests.support.patience import PATIENCE


class Heard:
    """What came, and a wait for a certain message."""

    def __init__(self) -> None:
        self.messages: list[wire.Message] = []
        self.sequences: list[int] = []
        self._more = asyncio.Event()

    def __call__(self, burst: list[wire.Delivery]) -> None:
        self.messages += [wire.decode(each.key, each.payload) for each in burst]
        self.sequences += [each.sequence for each in burst]
        self._more.set()

    async def wait(self, message: wire.Message) -> list[wire.Message]:
        async with asyncio.timeout(PATIENCE):
            while message not in self.messages:
                await self._more.wait()
                self._more.clear()
        return self.messages
