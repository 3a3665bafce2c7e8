"""The processes of a swarm, by the names of its parts."""

from collections.abc import Iterator
from contextlib import suppress

import psutil

_KINDS = {
    *("hub", "recorder", "coordinator", "intake", "world"),
    *("watcher", "worker", "cell"),
}
"""What the names of parts begin with."""


def parts_of(launcher: psutil.Process) -> Iterator[tuple[str, psutil.Process]]:
    """Yield the parts that a process has started, by name; who is gone is left out."""
    for process in launcher.children(recursive=True):
        with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
            name = process.name()
            if name.partition("/")[0] in _KINDS:
                yield name, process
