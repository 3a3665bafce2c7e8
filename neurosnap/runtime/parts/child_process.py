"""What every child process of a swarm does: live, report, end with its parent.

Children come from a fork server that has this module loaded already, so a cell costs a
fork and a Zenoh session and nothing else. Reports go to the parent through a pipe and
not over the network: they must work when the network does not.
"""

import asyncio
import contextlib
import ctypes
import gc
import multiprocessing
import multiprocessing.util
import os
import shutil
import signal
import sys
import threading
import time
import traceback
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection
from typing import Annotated, TypeAlias

import msgspec

from neurosnap.errors import NeurosnapError, PartDiedError
from neurosnap.fabric.security.credentials import Credentials
from neurosnap.fabric.zenoh.client import ZenohFabric
from neurosnap.system.signals import SIGNALS, unheeded

END = signal.SIGUSR1
"""What asks a child to end. Not one of those that reach the whole process group: when
which part ends is for the launcher to say."""
_PR_SET_PDEATHSIG = 1
_PR_SET_NAME = 15
# A pipe keeps writes of up to 4,096 bytes whole, so that many cells can share one; four
# of them are the length of what follows.
_LONGEST = 4096 - 4
# Seconds each part goes on once the launcher is dead: time for the coordinator to end
# its tick, for the others to leave, for the recorder to hear them.
_LINGER = {"coordinator": 0.0, "recorder": 2.0, "intake": 2.0, "hub": 5.0}
_LINGER_OTHERS = 1.0
_PROGRESS = 0.05  # seconds between two reports of progress
_LOADED_BY = os.getpid()
"""The fork server, in children that it forked with this module loaded."""


class Ready(msgspec.Struct, frozen=True, tag=True):
    """The part is up."""

    who: str


class Progress(msgspec.Struct, frozen=True, tag=True):
    """The part has come so far."""

    who: str
    tick: Annotated[int, msgspec.Meta(ge=0)]


class Done(msgspec.Struct, frozen=True, tag=True):
    """The part has done its work; `result` is what came of it."""

    who: str
    result: msgspec.Raw = msgspec.Raw(b"null")


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The part cannot go on."""

    who: str
    what: str
    died: bool = False
    """It would be able to if another part had not died."""


Report: TypeAlias = Ready | Progress | Done | Failed

_encode = msgspec.json.encode
_decoder: msgspec.json.Decoder[Report] = msgspec.json.Decoder(Report)


def read_report(connection: Connection) -> Report:
    """Return the next report. Blocks until there is one.

    Raises:
        EOFError: Nobody is left to report.
    """
    return _decoder.decode(connection.recv_bytes())


class Seat(msgspec.Struct, frozen=True):
    """A part's place in a swarm."""

    who: str
    """Its name, as in `Message.sender`."""
    swarm: str
    """The run's id."""
    endpoint: str
    """Where the hub listens."""
    first: int = 0
    """The number of its first message."""
    credentials: Credentials | None = None
    """What it proves itself with."""
    insecure: bool = False
    """It may go over a network without proof."""
    located: bool = False
    """It says where it is, for the swarm is on several machines."""

    def fabric(self, *, swift: bool = False) -> ZenohFabric:
        """Return the part's end of the network, to be entered; see `ZenohFabric`."""
        return ZenohFabric(
            self.who,
            self.swarm,
            self.endpoint,
            first=self.first,
            swift=swift,
            credentials=self.credentials,
            insecure=self.insecure,
            located=self.located,
        )


class Reporter:
    """A child's line to its parent; any thread may report."""

    def __init__(self, who: str, connection: Connection) -> None:
        self._who = who
        self._connection = connection
        self._lock = threading.Lock()  # a long report is several writes
        self._next_progress = 0.0

    def ready(self) -> None:
        """Say that the part is up."""
        self._send(Ready(self._who))

    def progress(self, tick: int) -> None:
        """Say how far it has come; some of it, for nobody reads faster than that."""
        now = time.monotonic()
        if now < self._next_progress:
            return
        self._next_progress = now + _PROGRESS
        self._send(Progress(self._who, tick))

    def done(self, result: object = None) -> None:
        """Say what came of it. Only for parts with a pipe of their own."""
        self._send(Done(self._who, msgspec.Raw(msgspec.json.encode(result))))

    def failed(self, what: str, *, died: bool = False) -> None:
        """Say why it cannot go on; the end of a long text is what counts.

        That it is short enough shows once it is encoded: a character may take six
        bytes.
        """
        kept = what[-_LONGEST:]
        while len(_encode(report := Failed(self._who, kept, died))) > _LONGEST:
            kept = kept[len(kept) // 16 + 1 :]
        self._send(report)

    def _send(self, report: Report) -> None:
        # A line that is broken: nobody is left to be told.
        with self._lock, contextlib.suppress(BrokenPipeError):
            self._connection.send_bytes(_encode(report))


Job: TypeAlias = Callable[..., Awaitable[None]]


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
        forkserver.set_forkserver_preload(["neurosnap.runtime.parts.child_process"])
        forkserver.ensure_running()
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def child(
    job: Job, seat: Seat, connection: Connection, arguments: tuple[object, ...]
) -> None:
    """Run `job` in this process until it ends or `END` asks it to.

    What means the end to the launcher (Ctrl-C, SIGTERM, a closed terminal) may reach
    the whole process group; a child does not heed it. It ends when the launcher asks it
    to, and when that has died. It is born with all of these signals blocked: see
    `serve_children`.

    Exit code 0: ended in order. 1: failed, and the parent was told why.
    """
    _end_with_server()
    _call_itself(seat.who)
    # Asked to end before it lives, it lives and ends. There is one thread still.
    signal.pthread_sigmask(signal.SIG_BLOCK, {END})
    for number in SIGNALS:
        signal.signal(number, unheeded)
        signal.siginterrupt(number, False)
    # A world may start programs, which inherit what is blocked.
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    reporter = Reporter(seat.who, connection)
    # What the fork server loaded stays shared with it only while nobody walks over it.
    gc.freeze()

    async def live() -> None:
        stop = asyncio.Event()
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(END, stop.set)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {END})
        try:
            with _orphanage(seat.who, stop):
                await job(seat, stop, reporter, *arguments)
        finally:
            # It is about to end: asked to now, it must not be killed by that, as it
            # would be once the loop is closed.
            loop.remove_signal_handler(END)
            signal.signal(END, signal.SIG_IGN)

    try:
        asyncio.run(live())
    except NeurosnapError as error:
        reporter.failed(str(error), died=isinstance(error, PartDiedError))
        sys.exit(1)
    except Exception:  # noqa: BLE001 - the process ends here, and says why
        reporter.failed(traceback.format_exc())
        sys.exit(1)


@contextmanager
def _orphanage(who: str, stop: asyncio.Event) -> Iterator[None]:
    """End in order when the launcher dies without having said so."""
    parent = multiprocessing.parent_process()
    if parent is None:
        yield
        return
    loop, sentinel = asyncio.get_running_loop(), parent.sentinel
    linger = _LINGER.get(who, _LINGER_OTHERS)

    def on_death() -> None:
        loop.remove_reader(sentinel)
        # Of the fork server: its socket is there, and nobody else takes it away.
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
