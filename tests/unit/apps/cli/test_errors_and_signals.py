"""What ends a command, signals and errors: its exit code, and what it leaves behind."""

import os
import subprocess
import sys

import pytest
import typer

from neurosnap.apps.cli.errors_and_signals import errors

PROGRAM = """
import asyncio, os, signal
from neurosnap.apps.cli.errors_and_signals import heard
from neurosnap.system.signals import quit_at_once

class Last:
    '''What Python lets go of after it has given signal handlers back.'''

    def __del__(self, kill=os.kill, pid=os.getpid(), write=os.write):
        for number in (2, 15, 1):
            kill(pid, number)
        write(1, b"the end")

async def work():
    with heard(asyncio.get_running_loop(), lambda number: None):
        await asyncio.sleep(0)

signal.signal(signal.SIGHUP, signal.SIG_DFL)
quit_at_once()
last = Last()
asyncio.run(work())
"""


@pytest.mark.slow
def test_a_verb_that_has_ended_in_order_is_killed_by_no_signal() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        env=os.environ,
        check=False,
    )
    assert (ended.returncode, ended.stdout) == (0, b"the end")
    assert ended.stderr == b""


def test_too_little_memory_is_an_error_in_a_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(typer.Exit) as ended, errors():
        raise MemoryError("Unable to allocate 27.6 GiB")
    assert ended.value.exit_code == 1
    printed = capsys.readouterr().err
    assert printed.startswith("error: memory: must be enough for so many sensors")
    assert printed.rstrip().endswith("got: Unable to allocate 27.6 GiB")
