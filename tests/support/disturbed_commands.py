"""Commands that run a swarm of processes and are interrupted."""

import subprocess
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

from neurosnap.recording.replay.verify import Verdict, verify
from tests.support.commands import Command
from tests.support.patience import PATIENCE


def finish(process: Command) -> tuple[int, str, str]:
    """Wait for a command; return its exit code, stdout and stderr."""
    stdout, stderr = process.communicate(timeout=PATIENCE)
    return process.wait(PATIENCE), stdout, stderr


@contextmanager
def started(
    *arguments: object, folder: Path, largest: int | None = None
) -> Iterator[Command]:
    """Start a command in a new session; whatever happens, leave none of it."""
    with Command(
        *arguments, folder=folder, own_session=True, largest=largest
    ) as process:
        family = psutil.Process(process.pid)
        try:
            yield process
        finally:
            if process.poll() is None:
                kill([*family.children(recursive=True), family])


def wait_for_size(process: Command, log: Path, size: int) -> None:
    """Wait until a recording has grown to `size`; fail if the command ends before."""
    with pytest.raises(subprocess.TimeoutExpired):
        for _ in range(int(PATIENCE / 0.02)):
            try:
                process.wait(0.02)
            except subprocess.TimeoutExpired:
                if log.exists() and log.stat().st_size >= size:
                    raise
                continue
            pytest.fail(f"it ended early: {process.communicate()[1]}")
        pytest.fail(f"{log} did not grow")


def gone(processes: list[psutil.Process]) -> bool:
    _, alive = psutil.wait_procs(processes, timeout=PATIENCE)
    kill(alive)
    return not alive


def kill(processes: Iterable[psutil.Process]) -> None:
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            process.kill()


GROWN = 30_000  # bytes a recording has once the run is well under way


def sound(log: Path) -> Verdict:
    """Verify a recording of a run that was disturbed: what there is of it is true."""
    verdict = verify(log)
    assert verdict.difference is None
    assert verdict.ticks > 0
    return verdict
