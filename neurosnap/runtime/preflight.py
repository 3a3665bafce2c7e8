"""Checks before a start whether the run fits this machine.

What it takes grows with the sensors in two ways: every cell that is a process takes
memory, threads and open files; and what is learned of every pair of sensors takes
memory, in the coordinator or, inline, in the one process there is.
"""

import math

from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.runtime.starting.child_processes import allow_files
from neurosnap.system.resources import (
    BYTES_A_CELL,
    BYTES_A_PAIR,
    BYTES_BESIDE,
    THREADS_A_CELL,
    free_memory,
    process_limits,
)

_SERVICES = 4  # hub, recorder, coordinator, world


def check_sensors(sensors: int) -> None:
    """Refuse more sensors than there is memory for all their pairs.

    Raises:
        InvalidValueError: There are more.
    """
    free = free_memory()
    most = math.isqrt(max(0, free - BYTES_BESIDE) // BYTES_A_PAIR)
    if sensors > most:
        rule = (
            f"must be at most {most:,} here: {BYTES_A_PAIR} bytes for every pair are"
            f" {BYTES_A_PAIR * sensors**2 / 1e9:,.1f} GB, free are {free / 1e9:.1f} GB"
            " (take fewer, or a machine with more memory)"
        )
        raise InvalidValueError("sensors", rule, sensors)


def check_cells(cells: int) -> None:
    """Refuse more cells that are processes than fit beside what else a run takes.

    Raises:
        InvalidValueError: There are more.
    """
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
