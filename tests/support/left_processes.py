"""Processes that a test may have left."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import psutil

from tests.support.patience import PATIENCE


@contextmanager
def no_process_left() -> Iterator[None]:
    """Fail if a process of the block outlives it."""
    before = passing()
    yield
    # The fork server may yet have to reap one.
    _, alive = psutil.wait_procs(passing() - before, timeout=PATIENCE)
    assert alive == []


def passing() -> set[psutil.Process]:
    """Return the processes below this one, but for those that serve for good."""
    found: set[psutil.Process] = set()
    for child in psutil.Process().children():
        with suppress(psutil.NoSuchProcess):  # it has ended meanwhile
            command = " ".join(child.cmdline())
            if "resource_tracker" not in command:
                found.update(child.children(recursive=True))
                if "forkserver" not in command:
                    found.add(child)
    return found
