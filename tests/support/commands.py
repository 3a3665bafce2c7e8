"""Runs `neurosnap` commands in separate, fast-starting processes.

A process of Python needs a second of work to load a verb, and the fork server, the
coordinator, the world and the recorder of a run need as much again, each time that they
are started. Here a verb is forked from the fork server of the tests, which has loaded
all of that (`tests.support.preloaded`), and makes its own fork server by a fork, too.
From then on it is what the command line is: a process with its arguments, its
environment and its three files, and with the parts of its swarm below it.

What hangs on how the program starts is for tests that start it by its command line.
"""

import multiprocessing
import os
import resource
import signal
import subprocess
import sys
import threading
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing import forkserver, util
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TextIO

from neurosnap.__main__ import main
from neurosnap.runtime import child_processes as parts
from neurosnap.runtime.child_processes import without_main
from tests.support import preloaded


class Command:
    """A verb in its own process, used as a `subprocess.Popen` of text.

    Args:
        *arguments: Of the command line; or ``-c`` and a program, which runs as by
            ``python -W error -c``.
        folder: Where it runs; if None, where the tests run.
        environment: What it finds in its environment.
        own_session: Whether it leads a session, and a process group.
        largest: Bytes that a file it writes may have, at most, or None.
    """

    def __init__(
        self,
        *arguments: object,
        folder: Path | None = None,
        environment: Mapping[str, str] = os.environ,
        own_session: bool = False,
        largest: int | None = None,
    ) -> None:
        self.args = list(map(str, arguments))
        (input_, into), (out_of, output), (err_of, errors) = (
            os.pipe() for _ in range(3)
        )
        theirs = (
            Connection(input_, writable=False),
            Connection(output, readable=False),
            Connection(errors, readable=False),
        )
        where = str(folder or Path.cwd())
        preloaded.start()
        self._process = multiprocessing.get_context("forkserver").Process(
            target=_be,
            args=(self.args, where, dict(environment), own_session, largest, theirs),
        )
        with without_main():
            self._process.start()
        for end in theirs:
            end.close()
        self.stdin: TextIO = open(into, "w")  # noqa: PTH123, SIM115
        self.stdout: TextIO = open(out_of)  # noqa: PTH123, SIM115
        self.stderr: TextIO = open(err_of)  # noqa: PTH123, SIM115
        self.pid = self._process.pid or 0
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return its exit code, negative for a signal, or None while it goes on."""
        if self.returncode is None:
            self.returncode = self._process.exitcode
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        self._process.join(timeout)
        code = self.poll()
        if code is None:
            raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        return code

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.pid, number)

    def kill(self) -> None:
        """Kill it, unless it has ended."""
        if self.poll() is None:
            self._process.kill()

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """End its input, wait for its end; return what is left of what it said."""
        said = ["", ""]

        def read(place: int, stream: TextIO) -> None:
            said[place] = stream.read()

        with suppress(BrokenPipeError):
            self.stdin.close()
        reading = [
            threading.Thread(target=read, args=each, daemon=True)
            for each in enumerate((self.stdout, self.stderr))
        ]
        for thread in reading:
            thread.start()
        for thread in reading:
            thread.join(timeout)
            if thread.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        self.wait(timeout)
        return said[0], said[1]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave nothing of it."""
        self.kill()
        self._process.join()
        self._process.close()
        with suppress(BrokenPipeError):
            self.stdin.close()
        self.stdout.close()
        self.stderr.close()


def _be(
    arguments: Sequence[str],
    folder: str,
    environment: Mapping[str, str],
    own_session: bool,
    largest: int | None,
    files: Sequence[Connection],
) -> None:
    """Be a verb, in a process that was forked for it."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # the tests may run below a `nohup`
    # The fork server may be one that a run in this process has started: it holds back
    # the signals that end a run.
    signal.pthread_sigmask(signal.SIG_SETMASK, ())
    if own_session:
        os.setsid()
    if largest is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest))
    for number, file in enumerate(files):
        os.dup2(file.fileno(), number)
        file.close()
    sys.stdin = open(0, closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
    sys.stderr = open(  # noqa: SIM115
        2, "w", buffering=1, errors="backslashreplace", closefd=False
    )
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ["neurosnap", *arguments]
    # Of the process that asked for this one, with all that is in there.
    vars(multiprocessing.current_process())["_config"].pop("tempdir", None)
    vars(forkserver._forkserver).update(vars(forkserver.ForkServer()))
    vars(util)["spawnv_passfds"] = _fork
    parts.serve_children()
    if arguments[0] == "-c":
        warnings.simplefilter("error")
        exec(arguments[1], {"__name__": "__main__"})
    else:
        main()


def _fork(program: bytes, arguments: Sequence[str], kept: Sequence[int]) -> int:
    """Do as the new interpreter would that is to be the fork server; return its id."""
    pid = os.fork()
    if pid:
        return pid
    try:
        lowest = 3
        for file in (*sorted(kept), os.sysconf("SC_OPEN_MAX")):
            os.closerange(lowest, file)
            lowest = file + 1
        parts._LOADED_BY = os.getpid()
        command: Any = compile(arguments[-1], "fork server", "exec")
        exec(command, {})
    finally:
        os._exit(0)
