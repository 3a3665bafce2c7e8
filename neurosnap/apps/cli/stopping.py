"""Signal handling while a verb works; before that, see `neurosnap.system.signals`.

While a file is written it unwinds that, so that no draft stays. While a swarm runs it
asks that to end in order, and counts for nothing from then on.
"""

import asyncio
import signal
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from neurosnap.system.signals import heeded, quit_now, unheeded


@contextmanager
def unwinding() -> Iterator[None]:
    """Let signals end the block as an exception does, with exit code 128 + number."""
    before = {number: signal.getsignal(number) for number in heeded()}
    for number in before:
        signal.signal(number, _unwind)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _unwind(number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


@contextmanager
def heard(
    loop: asyncio.AbstractEventLoop, on_signal: Callable[[int], None]
) -> Iterator[None]:
    """Have `on_signal` called on the loop with the number of each signal.

    Once the block is left the program has ended in order, and has only to say so: where
    it would have quit at a signal before, it ignores it then. The loop's own
    ``add_signal_handler`` would leave a gap in which a signal kills.
    """
    before = {number: signal.getsignal(number) for number in heeded()}
    reading, writing = socket.socketpair()
    with reading, writing:
        reading.setblocking(False)
        writing.setblocking(False)

        def read() -> None:
            for number in reading.recv(4096):
                on_signal(number)

        loop.add_reader(reading, read)
        waker = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        for number in before:
            signal.signal(number, unheeded)
        try:
            yield
        finally:
            for number, handler in before.items():
                # Ignored in earnest: Python gives other handlers back before it ends.
                quits = handler is quit_now
                signal.signal(number, signal.SIG_IGN if quits else handler)
            signal.set_wakeup_fd(waker)
            loop.remove_reader(reading)
