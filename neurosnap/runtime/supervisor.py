"""Supervises child processes: starts them, reads their reports, ends them.

Whatever happens, nothing is left running: leaving the supervisor kills what has not
ended in order, and children end by themselves when the parent dies.
"""

import asyncio
import multiprocessing
import os
import resource
import sys
import threading
import time
import types
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess
from types import TracebackType
from typing import TYPE_CHECKING, Self

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.fabric.events import wait_any
from neurosnap.runtime.parts.child_process import END, child, serve_children
from neurosnap.runtime.parts.job import Job, PartConnection
from neurosnap.runtime.parts.reports import (
    Done,
    Failed,
    Grown,
    Health,
    Progress,
    Ready,
    Report,
    read_report,
)

if TYPE_CHECKING:
    from neurosnap.agent.growth.changed import Changed

# Per child: a sentinel and the pipe that makes it, here; the same again in the server.
_FILES_A_CHILD = 3
_FILES_BESIDE = 200

_hiding = threading.Lock()  # of the main module, which is the whole process's


class Child:
    """One child process, as the parent knows it."""

    def __init__(self, process: ForkServerProcess) -> None:
        self.process = process
        self.ready = asyncio.Event()
        self.ended = asyncio.Event()
        self.result: bytes | None = None
        self.done_at: float | None = None
        """When its result came, as `time.perf_counter` counts."""


class Supervisor:
    """Starts children and watches over them.

    A child that ends before it was asked to, or with another exit code than 0, makes
    `failed` fire; `error` then names it and says why, in the child's own words where it
    left any. Use as an async context manager.
    """

    def __init__(self) -> None:
        self.failed = asyncio.Event()
        self.error: Exception | None = None
        self.progressed = asyncio.Event()
        """Set whenever a part says how far it is: `tick`."""
        self.tick = 0
        self.changes: list[Changed] = []
        """What was grown or retired since somebody looked."""
        self.standings: list[bytes] = []
        """How the sensors of the home were since somebody looked, as JSON."""
        self.has_begun = False
        """The coordinator has said that every part is there."""
        self._context = multiprocessing.get_context("forkserver")
        self._children: dict[str, Child] = {}
        self._early: dict[str, list[Report]] = {}  # of children not in `_children` yet
        self._reasons: dict[str, Failed] = {}
        self._expected: set[str] = set()
        self._killed: set[str] = set()  # by this supervisor
        self._closing = False
        self._starting: set[asyncio.Future[None]] = set()  # threads at work
        self._loop = asyncio.get_running_loop()
        self._lines: list[Connection] = []
        self._shared: Connection | None = None

    async def __aenter__(self) -> Self:
        """Start the fork server with all a cell needs loaded."""
        serve_children()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Kill what is left, and what is being started."""
        self._closing = True
        self._kill_all()
        if self._starting:  # whoever waited for it was cancelled
            await asyncio.wait(self._starting)
            self._kill_all()
        for child_ in self._children.values():
            if not child_.ended.is_set():
                self._loop.remove_reader(child_.process.sentinel)
            await asyncio.to_thread(child_.process.join)
            child_.process.close()
        for line in self._lines:
            self._loop.remove_reader(line.fileno())
            line.close()
        if self._shared is not None:
            self._shared.close()

    def _kill_all(self) -> None:
        for child_ in self._children.values():
            if not child_.ended.is_set():
                child_.process.kill()

    async def start(self, job: Job, connection: PartConnection) -> Child:
        """Start `job` in a child with a pipe of its own."""
        reading, writing = self._context.Pipe(duplex=False)
        self._listen(reading)
        process = self._process(job, connection, writing)

        def start() -> None:
            with writing:  # the child has its own; nobody else may keep it open
                self._start(process)

        await self._aside(start)
        return self._children[connection.who]

    async def start_many(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start a child per job, with one pipe for all: reports must be short."""
        if self._shared is None:
            reading, self._shared = self._context.Pipe(duplex=False)
            self._listen(reading)
        processes = [
            self._process(job, connection, self._shared) for job, connection in jobs
        ]

        def start() -> None:  # one thread for all is cheaper than one each
            for process in processes:
                if self._closing or self.failed.is_set():
                    return
                self._start(process)

        await self._aside(start)

    async def _aside(self, start: Callable[[], None]) -> None:
        """Start children in a thread, which goes on if the caller is cancelled."""
        starting = self._loop.run_in_executor(None, start)
        self._starting.add(starting)
        starting.add_done_callback(self._starting.discard)
        await asyncio.shield(starting)

    def _start(self, process: ForkServerProcess) -> None:
        """Start a child. Called in a thread, which has not ended before `_adopt`."""
        with _without_main():
            process.start()
        self._loop.call_soon_threadsafe(self._adopt, process)

    def _process(
        self, job: Job, connection: PartConnection, line: Connection
    ) -> ForkServerProcess:
        return self._context.Process(
            target=child, args=(job, connection, line), name=connection.who
        )

    def _adopt(self, process: ForkServerProcess) -> None:
        """Watch over a child that has started."""
        self._children[process.name] = Child(process)
        self._loop.add_reader(process.sentinel, self._ended, process.name)
        for report in self._early.pop(process.name, ()):
            self._take(report)

    def _listen(self, line: Connection) -> None:
        self._lines.append(line)
        self._loop.add_reader(line.fileno(), self._read, line)

    def _read(self, line: Connection) -> None:
        """Take in the reports that wait in one pipe."""
        try:
            while line.poll():
                self._take(read_report(line))
        except (EOFError, ConnectionResetError):
            self._loop.remove_reader(line.fileno())

    def _take(self, report: Report) -> None:
        child_ = self._children.get(report.who)
        if child_ is None:
            # It is quicker than the thread that starts it, on a busy machine.
            self._early.setdefault(report.who, []).append(report)
            return
        match report:
            case Ready():
                child_.ready.set()
            case Progress(tick=tick):
                self.tick = tick
                self.has_begun = True
                self.progressed.set()
            case Grown(changes=changes):
                self.changes += changes
                self.progressed.set()
            case Health(standing=standing):
                self.standings.append(bytes(standing))  # told with the next progress
            case Done(result=result):
                self._expected.add(report.who)
                child_.result = bytes(result)
                child_.done_at = time.perf_counter()
            case Failed():
                self._reasons[report.who] = report

    def _ended(self, who: str) -> None:
        """Take in that a child has ended."""
        child_ = self._children[who]
        self._loop.remove_reader(child_.process.sentinel)
        child_.process.join()
        for line in self._lines:  # its reason may still be waiting
            self._read(line)
        child_.ended.set()
        code = child_.process.exitcode
        # Asked to by a signal before it could hear one, it has ended, too.
        ended = who in self._expected and code in (0, -END)
        if ended or who in self._killed:
            return
        how = f"signal {-code}" if code is not None and code < 0 else f"code {code}"
        reason = self._reasons.get(who)
        if reason is None:
            rule = "must not end before it is asked to"
            self.blame(PartDiedError(f"{who}: {rule}, ended with {how}"))
        else:
            kind = PartDiedError if reason.died else SwarmError
            what = reason.what.removeprefix(f"{who}: ")
            self.blame(kind(f"{who}: {what}"))

    def blame(self, error: Exception) -> None:
        """Let the first error be the run's, but for a death.

        Who cannot go on may suffer from another's death, which shows a moment later.
        """
        died = isinstance(error, PartDiedError)
        if self.error is None or (died and not isinstance(self.error, PartDiedError)):
            self.error = error
            self.failed.set()

    async def wait(self, *events: asyncio.Event) -> None:
        """Return once one of `events` is set.

        Raises:
            Exception: A child failed, now or before, or something else was blamed.
        """
        await wait_any(self.failed, *events)
        if self.error is not None:
            raise self.error

    def has_ended(self, who: str) -> bool:
        """Return whether a part was started and is no more."""
        return who in self._children and self._children[who].ended.is_set()

    async def kill(self, parts: Collection[str]) -> None:
        """End `parts` at once."""
        children = [self._children[who] for who in parts if who in self._children]
        for child_ in children:
            if not child_.ended.is_set():
                self._killed.add(child_.process.name)
                child_.process.kill()
        for child_ in children:
            await child_.ended.wait()

    async def end(self, parts: Collection[str], grace: float) -> list[str]:
        """Ask `parts` to end and wait for it; return who had to be killed."""
        self._expected.update(parts)
        children = [self._children[who] for who in parts if who in self._children]
        for child_ in children:
            if not child_.ended.is_set():
                _ask(child_)
        late = []
        try:
            async with asyncio.timeout(grace):
                for child_ in children:
                    await child_.ended.wait()
        except TimeoutError:
            for child_ in children:
                if not child_.ended.is_set():
                    late.append(child_.process.name)
                    self._killed.add(child_.process.name)
                    child_.process.kill()
                    await child_.ended.wait()
        return late


def _ask(child_: Child) -> None:
    """Ask a child to end."""
    if child_.process.is_alive() and child_.process.pid is not None:
        with suppress(ProcessLookupError):
            os.kill(child_.process.pid, END)


@contextmanager
def _without_main() -> Iterator[None]:
    """Hide the main module, which multiprocessing would run again in every child.

    No child needs it, and where it is a test runner or a notebook, a thousand cells
    would import that a thousand times.
    """
    with _hiding:  # two at once could put each other's blank one back
        main = sys.modules["__main__"]
        sys.modules["__main__"] = types.ModuleType("__main__")
        try:
            yield
        finally:
            sys.modules["__main__"] = main


def allow_files(children: int) -> None:
    """Raise this process's limit of open files as far as the system allows.

    As far as it allows, and not as far as `children` need: the fork server keeps the
    limit of its first swarm, and the next one may be larger.

    Raises:
        SwarmError: The system's own limit is lower than what `children` need.
    """
    needed = _FILES_A_CHILD * children + _FILES_BESIDE
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < needed:
        raise SwarmError(
            f"open files: limit must be at least {needed} for {children} processes,"
            f" got {hard} (raise it with ulimit -Hn)"
        )
    if hard != resource.RLIM_INFINITY:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    elif soft != resource.RLIM_INFINITY and soft < needed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (needed, hard))
