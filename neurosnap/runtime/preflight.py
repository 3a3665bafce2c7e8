"""Checks before a start whether the run fits this machine.

What it takes grows with the sensors in two ways: every cell that is a process takes
memory, threads and open files; and what is learned of every pair of sensors takes
memory, in the coordinator or, inline, in the one process there is.
"""

import math
import os
import resource
from collections.abc import Iterator
from pathlib import Path

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.runtime.child_processes import allow_files

_SERVICES = 4  # hub, recorder, coordinator, world
THREADS_A_CELL = 9  # one of Python's, one that delivers, the rest Zenoh's
BYTES_A_CELL = 6_000_000
BYTES_BESIDE = 600_000_000  # coordinator, recorder and world with numpy and numba
BYTES_A_PAIR = 12
"""Of two sensors: their weights and dates, the order and its covers, a key-frame.
Measured: 10 in the coordinator of 3,000."""


def check_sensors(sensors: int) -> None:
    """Raise InvalidValueError for more sensors than memory holds all pairs of."""
    free = free_memory()
    most = math.isqrt(max(0, free - BYTES_BESIDE) // BYTES_A_PAIR)
    if sensors > most:
        rule = (
            f"must be at most {most:,} here: {BYTES_A_PAIR} bytes for every pair are"
            f" {BYTES_A_PAIR * sensors**2 / 1e9:,.1f} GB, free are {free / 1e9:.1f} GB"
            " (take fewer, or a machine with more memory)"
        )
        raise InvalidValueError("sensors", rule, sensors)


def check_world(name: str, value: object, sensors: int, needed: int) -> None:
    """Refuse a world that, or the pairs of its sensors, does not fit; see `check_fits`.

    Raises:
        InvalidValueError: It takes more memory than is free.
    """
    check_sensors(sensors)
    free = free_memory()
    if needed > free:
        rule = (
            f"must fit the memory: takes about {needed / 1e9:,.1f} GB, free are"
            f" {free / 1e9:.1f} GB (take fewer, or a machine with more memory)"
        )
        raise InvalidValueError(name, rule, value)


def check_cells(cells: int) -> None:
    """Raise InvalidValueError for more processes than fit beside the rest of a run."""
    free = free_memory()
    most = max(0, free - BYTES_BESIDE) // BYTES_A_CELL
    why = f"each takes {BYTES_A_CELL / 1e6:.0f} MB, free are {free / 1e9:.1f} GB"
    for name, limit, used in process_limits():
        room = max(0, limit - used)
        if room // THREADS_A_CELL - _SERVICES < most:
            most = max(0, room // THREADS_A_CELL - _SERVICES)
            why = f"each takes {THREADS_A_CELL} threads, {name} leaves {room:,}"
    remedy = "run fewer, or with --cells worker"
    if cells > most:
        rule = f"must be at most {most:,} here: {why} ({remedy})"
        raise InvalidValueError("cells", rule, cells)
    try:
        allow_files(cells + _SERVICES)
    except SwarmError as error:
        rule = f"must fit what may be open: {error}; or {remedy}"
        raise InvalidValueError("cells", rule, cells) from error


def process_limits() -> Iterator[tuple[str, int, int]]:
    """Yield the name of each limit that is set, its value and what is in use."""
    if hasattr(os, "geteuid") and os.geteuid() != 0:  # root is exempt
        soft, _ = resource.getrlimit(resource.RLIMIT_NPROC)  # it cannot be raised
        if soft != resource.RLIM_INFINITY:
            yield "the user's process limit (`ulimit -u`)", soft, 0
    load = _read(Path("/proc/loadavg"))  # its fourth word: running/all
    everyone = int(load.split()[3].split("/")[1]) if load else 0
    for name in ("threads-max", "pid_max"):
        limit = _read(Path("/proc/sys/kernel") / name)
        if limit:
            yield f"kernel.{name} (sysctl)", int(limit), everyone
    for folder in _cgroups("pids"):
        limit, used = _read(folder / "pids.max"), _read(folder / "pids.current")
        if limit.isdigit():
            yield f"{folder}/pids.max", int(limit), int(used or 0)


def _cgroups(controller: str) -> Iterator[Path]:
    """Yield this process's control groups for `controller`, the root's included."""
    for line in _read(Path("/proc/self/cgroup")).splitlines():
        _, controllers, path = line.split(":", 2)
        if controllers and controller not in controllers.split(","):
            continue
        base = Path("/sys/fs/cgroup") / (controller if controllers else "")
        inner = base / path.lstrip("/")
        yield from (f for f in (inner, *inner.parents) if f.is_relative_to(base))


def free_memory() -> int:
    """Return the bytes that can be had, within the control group's limit."""
    import psutil

    free = int(psutil.virtual_memory().available)
    for folder in _cgroups("memory"):
        limit, used = _read(folder / "memory.max"), _read(folder / "memory.current")
        if limit.isdigit() and used.isdigit():
            free = min(free, int(limit) - int(used))
    return free


def _read(path: Path) -> str:
    """Return what a file of the kernel's says; nothing where there is none."""
    try:
        return path.read_text().strip()
    except OSError:
        return ""
