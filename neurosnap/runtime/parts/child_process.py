"""A child process of a swarm: it runs one job and ends with its parent.

Children are forked from a server that has this module and the cell's loaded already, so
a cell costs a fork and a Zenoh session and nothing else.
"""

import asyncio
import ctypes
import gc
import multiprocessing
import multiprocessing.util
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import forkserver, resource_tracker
from multiprocessing.connection import Connection

from neurosnap.runtime.parts import cell_process as cell_process  # loaded, not used
from neurosnap.runtime.parts import hub_process as hub_process
from neurosnap.runtime.parts.job import Job, PartConnection, PartContext, carry_out
from neurosnap.runtime.parts.reports import Reporter
from neurosnap.system.signals import SIGNALS, unheeded

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
    reporter = Reporter(connection.who, line)
    # What the fork server loaded stays shared with it only while nobody walks over it.
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
