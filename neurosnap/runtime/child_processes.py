"""Runs parts as child processes, forked from a fork server.

Children are forked from a server that has this module and the cell's loaded already, so
a cell costs a fork and a Zenoh session and nothing else. Whatever happens, nothing is
left running: children end by themselves when the parent dies.
"""

import asyncio
import ctypes
import gc
import multiprocessing
import multiprocessing.util
import os
import resource
import shutil
import signal
import sys
import threading
import types
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from multiprocessing.context import ForkServerProcess

from neurosnap.errors import SwarmError
from neurosnap.runtime.parts.hub_and_cell import ONE_THREAD, CellJob
from neurosnap.runtime.parts.job import (
    Job,
    PartConnection,
    PartContext,
    Reporter,
    carry_out,
    decode_report,
)
from neurosnap.runtime.starter import Listener
from neurosnap.system.signals import SIGNALS, unheeded

# Per child: a sentinel and the pipe that makes it, here; the same again in the server.
_FILES_A_CHILD = 3
_FILES_BESIDE = 200
END = signal.SIGUSR1
"""What asks a child to end. Not one of those that reach the whole process group: when
which part ends is for the launcher to say."""
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
# Seconds each part goes on once the launcher is dead: time for the coordinator to end
# its tick, for the others to leave, for the recorder to hear them.
_LINGER = {"coordinator": 0.0, "recorder": 2.0, "intake": 2.0, "hub": 5.0}
_LINGER_OTHERS = 1.0
_LOADED_BY = os.getpid()
"""The fork server, in children that it forked with this module loaded."""
_hiding = threading.Lock()  # of the main module, which is the whole process's


class ChildProcesses:
    """Starts every part as a process of this machine."""

    has_hub = True

    def __init__(self) -> None:
        self._context = multiprocessing.get_context("forkserver")
        self._alive: dict[str, ForkServerProcess] = {}
        self._ended: list[ForkServerProcess] = []
        self._closing = False
        self._starting: set[asyncio.Future[None]] = set()  # threads at work
        self._lines: list[Connection] = []
        self._shared: list[Connection] = []  # our ends of lines that several write to

    async def open(self, listener: Listener) -> None:
        """Start the fork server with all a cell needs loaded."""
        self._listener = listener
        self._loop = asyncio.get_running_loop()
        serve_children()

    async def make_room(self, parts: Collection[str], stop: asyncio.Event) -> None:
        """Allow as many open files as the parts take.

        Raises:
            SwarmError: The system does not allow so many.
        """
        allow_files(len(parts))

    async def start(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start a child per job; one has a pipe of its own, several share one."""
        reading, writing = self._context.Pipe(duplex=False)
        self._listen(reading)
        processes = [self._process(*each, writing) for each in jobs]
        if len(processes) > 1:
            self._shared.append(writing)

        def start() -> None:  # one thread for all is cheaper than one each
            for process in processes:
                if self._closing or self._listener.failed.is_set():
                    return
                self._start(process)

        def start_one() -> None:
            with writing:  # the child has its own; no other process may keep it open
                self._start(processes[0])

        await self._aside(start if len(processes) > 1 else start_one)

    async def close(self) -> None:
        """Kill what is left, and what is being started."""
        self._closing = True
        self._kill_all()
        if self._starting:  # the caller that waited for it was cancelled
            await asyncio.wait(self._starting)
            self._kill_all()
        for process in self._alive.values():
            self._loop.remove_reader(process.sentinel)
        for process in [*self._alive.values(), *self._ended]:
            await asyncio.to_thread(process.join)
            process.close()
        for line in self._lines:
            self._loop.remove_reader(line.fileno())
            line.close()
        for line in self._shared:
            line.close()

    def _kill_all(self) -> None:
        for process in self._alive.values():
            process.kill()

    async def _aside(self, start: Callable[[], None]) -> None:
        """Start children in a thread, which goes on if the caller is cancelled."""
        starting = self._loop.run_in_executor(None, start)
        self._starting.add(starting)
        starting.add_done_callback(self._starting.discard)
        await asyncio.shield(starting)

    def _start(self, process: ForkServerProcess) -> None:
        """Start a child. Called in a thread, which has not ended before `_adopt`."""
        with without_main():
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
        self._alive[process.name] = process
        self._loop.add_reader(process.sentinel, self._end, process)
        self._listener.began(process.name, ChildHandle(process))

    def _listen(self, line: Connection) -> None:
        self._lines.append(line)
        self._loop.add_reader(line.fileno(), self._read, line)

    def _read(self, line: Connection) -> None:
        """Take in the reports that wait in one pipe."""
        try:
            while line.poll():
                self._listener.receive(decode_report(line.recv_bytes()))
        except (EOFError, ConnectionResetError):
            self._loop.remove_reader(line.fileno())

    def _end(self, process: ForkServerProcess) -> None:
        """Take in that a child has ended."""
        self._ended.append(self._alive.pop(process.name))
        self._loop.remove_reader(process.sentinel)
        process.join()
        for line in self._lines:  # its reason may still be waiting
            self._read(line)
        code = process.exitcode
        how = f"signal {-code}" if code is not None and code < 0 else f"code {code}"
        # Asked to by a signal before it could hear one, it has ended, too.
        self._listener.ended(process.name, how, in_order=code in (0, -END))


class ChildHandle:
    """A child process that was started."""

    def __init__(self, process: ForkServerProcess) -> None:
        self._process = process

    def ask(self) -> None:
        """Ask it to end in order."""
        if self._process.is_alive() and self._process.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(self._process.pid, END)

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()


@contextmanager
def without_main() -> Iterator[None]:
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


def serve_children() -> None:
    """Start the fork server that children come from, unless there is one.

    It, the resource tracker and every child in its first moments have all signals to
    end blocked: none of them dies of one that is for the launcher.
    """
    blocked = {*SIGNALS, END}
    before = signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
    try:
        resource_tracker.ensure_running()  # unblocks some, in Python 3.11
        signal.pthread_sigmask(signal.SIG_BLOCK, blocked)
        forkserver.set_forkserver_preload([__name__])
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def child(job: Job, connection: PartConnection, line: Connection) -> None:
    """Run `job` in this process until it ends or `END` asks it to.

    What means the end to the launcher (Ctrl-C, SIGTERM, a closed terminal) may reach
    the whole process group; a child does not heed it. It ends when the launcher asks it
    to, and when that has died. It is born with all of these signals blocked: see
    `serve_children`.

    Exit code 0: ended in order. 1: failed, and the parent was told why.
    """
    _end_with_server()
    _call_itself(connection.who)
    # Asked to end before it lives, it lives and ends. There is one thread still.
    signal.pthread_sigmask(signal.SIG_BLOCK, {END})
    for number in SIGNALS:
        signal.signal(number, unheeded)
        signal.siginterrupt(number, False)
    # A world may start programs, which inherit what is blocked.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    if isinstance(job, CellJob):  # before Zenoh reads it; only of a process of its own
        os.environ.setdefault("ZENOH_RUNTIME", ONE_THREAD)
    reporter = Reporter(connection.who, line)
    # What the fork server loaded stays shared with it only while nothing walks over it.
    gc.freeze()

    async def live() -> bool:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(END, stop.set)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {END})
        try:
            with _ending_with_launcher(connection.who, stop):
                return await carry_out(job, PartContext(connection, stop, reporter))
        finally:
            # It is about to end: asked to now, it must not be killed by that, as it
            # would be once the loop is closed.
            loop.remove_signal_handler(END)
            signal.signal(END, signal.SIG_IGN)

    if not asyncio.run(live()):
        sys.exit(1)


@contextmanager
def _ending_with_launcher(who: str, stop: asyncio.Event) -> Iterator[None]:
    """End in order when the launcher dies without having said so."""
    parent = multiprocessing.parent_process()
    if parent is None:
        yield
        return
    loop, sentinel = asyncio.get_running_loop(), parent.sentinel
    linger = _LINGER.get(who, _LINGER_OTHERS)

    def on_death() -> None:
        loop.remove_reader(sentinel)
        # Of the fork server: its socket is there, and nothing else removes it.
        shutil.rmtree(multiprocessing.util.get_temp_dir(), ignore_errors=True)
        loop.call_later(linger, stop.set)

    loop.add_reader(sentinel, on_death)
    try:
        yield
    finally:
        loop.remove_reader(sentinel)


def _call_itself(who: str) -> None:
    """Let the part be found by its name among the system's processes."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_NAME, who.encode()[:15])


def _end_with_server() -> None:
    """Be asked to end when the fork server dies; it lives as long as any child.

    Where it has died already, end at once: no signal will come.
    """
    if sys.platform != "linux":
        return
    server = _LOADED_BY if os.getpid() != _LOADED_BY else os.getppid()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_PR_SET_PDEATHSIG, END) or os.getppid() != server:
        os._exit(1)
