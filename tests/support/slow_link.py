"""A link between hubs that takes its time, can be cut, and counts what crosses it.

It stands between two ends of a TCP connection. What it holds back is delivered in
order when its time has come; what is lost on a real network is sent again by TCP, so
that loss is delay, too.
"""

import asyncio
import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Self

from tests.support.patience import PATIENCE

_HOST = "127.0.0.1"
_CHUNK = 1 << 16
_HELD = 64  # chunks under way in one direction; then the sender has to wait


class SlowLink:
    """Passes on every connection to `port` to a hub on this machine.

    Args:
        port: Where it listens.
        target: Where the hub listens.
        delay: Seconds that anything takes to cross it.
    """

    def __init__(self, port: int, target: int, delay: float = 0.0) -> None:
        self.port = port
        self.delay = delay
        self.crossed = 0
        """Bytes that have crossed it, both ways."""
        self._target = target
        self._broken = False
        self._writers: set[asyncio.StreamWriter] = set()
        self._tasks: set[asyncio.Task[None]] = set()
        self._loop = asyncio.new_event_loop()
        self._whole = asyncio.Event()
        self._whole.set()
        self._over = asyncio.Event()
        self._up = threading.Event()
        self._thread = threading.Thread(target=self._run, name="slow link")

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._up.wait(PATIENCE)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()

    def cut(self) -> None:
        """Hold back everything, both ways, until `heal`; neither end is told."""
        self._do(self._whole.clear)

    def heal(self) -> None:
        """Deliver what was held back, and whatever comes."""
        self._do(self._heal)

    def sever(self) -> None:
        """Close all connections, and refuse others until `heal`."""
        self._do(self._sever)

    def _do(self, work: Callable[[], None]) -> None:
        """Have the link's thread do it, and wait until it is done."""
        done = threading.Event()

        def do() -> None:
            work()
            done.set()

        self._loop.call_soon_threadsafe(do)
        assert done.wait(PATIENCE)

    def _heal(self) -> None:
        self._broken = False
        self._whole.set()

    def _sever(self) -> None:
        self._broken = True
        for writer in self._writers:
            writer.transport.abort()

    def _run(self) -> None:
        with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
            runner.run(self._serve())

    async def _serve(self) -> None:
        async with await asyncio.start_server(self._pass_on, _HOST, self.port):
            self._up.set()
            await self._over.wait()
            self._sever()
            self._whole.set()
            if self._tasks:
                await asyncio.wait(self._tasks)

    async def _pass_on(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._tasks.add(task)
        self._writers.add(writer)
        try:
            if not self._broken:
                with suppress(OSError):
                    await self._connect(reader, writer)
        finally:
            self._writers.discard(writer)
            self._tasks.discard(task)
            writer.close()

    async def _connect(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        there, back = await asyncio.open_connection(_HOST, self._target)
        self._writers.add(back)
        try:
            async with asyncio.TaskGroup() as group:
                for one, other in ((reader, back), (there, writer)):
                    held: asyncio.Queue[tuple[float, bytes]] = asyncio.Queue(_HELD)
                    group.create_task(self._take(one, held))
                    group.create_task(self._give(held, other))
        except* OSError:
            pass
        finally:
            self._writers.discard(back)
            back.close()

    async def _take(
        self, reader: asyncio.StreamReader, held: "asyncio.Queue[tuple[float, bytes]]"
    ) -> None:
        while True:
            chunk = await reader.read(_CHUNK)
            await held.put((self._loop.time() + self.delay, chunk))
            if not chunk:
                return

    async def _give(
        self, held: "asyncio.Queue[tuple[float, bytes]]", writer: asyncio.StreamWriter
    ) -> None:
        while True:
            due, chunk = await held.get()
            await asyncio.sleep(due - self._loop.time())
            await self._whole.wait()
            if not chunk:
                raise ConnectionResetError  # the other end has gone, so this one goes
            self.crossed += len(chunk)
            writer.write(chunk)
            await writer.drain()
