"""Reserves free ports for the hubs of tests.

A port that the system calls free now may be anybody's a moment later, and several
processes run tests at once. So each holds a block of ports, below those that the
system gives out by itself, by holding the first of them.
"""

import atexit
import socket
from collections.abc import Iterator
from itertools import cycle

_HOST = "127.0.0.1"
_BLOCKS = range(12_000, 32_000, 100)
_held: list[socket.socket] = []
_numbers: Iterator[int] = iter(())


def free_port() -> int:
    """Return a free port out of this process's block."""
    global _numbers
    if not _held:
        first = _hold()
        _numbers = cycle(range(first + 1, first + _BLOCKS.step))
    for number in _numbers:
        with socket.socket() as probe:
            # As a hub does it: what listened here a moment ago does not matter.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((_HOST, number))
            except OSError:
                continue
            return number
    raise AssertionError("a cycle does not end")


def _hold() -> int:
    """Take the first block that is free; return its first port."""
    for first in _BLOCKS:
        lock = socket.socket()
        try:
            lock.bind((_HOST, first))
        except OSError:
            lock.close()
            continue
        atexit.register(lock.close)
        _held.append(lock)
        return first
    raise OSError("ports: every block is taken")
