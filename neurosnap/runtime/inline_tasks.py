"""Runs parts as tasks of this event loop, on a network in memory."""

import asyncio
from collections.abc import Collection, Sequence
from functools import partial

import msgspec

from neurosnap.fabric.in_memory import MemoryHub
from neurosnap.runtime.parts.job import (
    Job,
    PartConnection,
    PartContext,
    Reporter,
    carry_out,
    decode_report,
)
from neurosnap.runtime.starter import Listener


class InlineTasks:
    """Starts every part as a task."""

    has_hub = False

    def __init__(self) -> None:
        self._hub = MemoryHub()
        self._tasks: set[asyncio.Task[bool]] = set()

    async def open(self, listener: Listener) -> None:
        """Nothing needs opening."""
        self._listener = listener

    async def make_room(self, parts: Collection[str], stop: asyncio.Event) -> None:
        """Do nothing: tasks take no room of the system's."""

    async def start(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start a task per job."""
        for job, connection in jobs:
            local = msgspec.structs.replace(connection, local=self._hub)
            reporter = Reporter(
                connection.who, _InlineLine(self._listener), every_tick=True
            )
            part = PartContext(local, asyncio.Event(), reporter)
            task = asyncio.create_task(carry_out(job, part), name=connection.who)
            self._tasks.add(task)
            self._listener.began(connection.who, _TaskHandle(task, part.stop))
            task.add_done_callback(partial(self._end, connection.who))

    def _end(self, who: str, task: asyncio.Task[bool]) -> None:
        """Take in that a task has ended."""
        self._tasks.discard(task)
        failed = task.cancelled() or task.exception() is not None
        in_order = not failed and task.result()
        self._listener.ended(who, "its task", in_order=in_order)

    async def close(self) -> None:
        """Cancel what is left."""
        if left := set(self._tasks):
            for task in left:
                task.cancel()
            await asyncio.wait(left)


class _TaskHandle:
    """A task that was started."""

    def __init__(self, task: asyncio.Task[bool], stop: asyncio.Event) -> None:
        self._task = task
        self._stop = stop

    def ask(self) -> None:
        """Ask it to end in order."""
        self._stop.set()

    def kill(self) -> None:
        """End it at once."""
        self._task.cancel()


class _InlineLine:
    """Hands reports over at once; parts report on the event loop alone."""

    def __init__(self, listener: Listener) -> None:
        self._listener = listener

    def send_bytes(self, buf: bytes, /) -> None:
        """Hand over one report."""
        self._listener.receive(decode_report(buf))
