"""A slow link between hubs, which can be cut.

It stands between two ends of a TCP connection. What it holds back is delivered in
order when its time has come; what is lost on a real network is sent again by TCP, so
that loss is delay, too.
"""

import socket
import threading
import time
from contextlib import suppress
from typing import Self

_HOST = "127.0.0.1"
_CHUNK = 1 << 16


class SlowLink:
    """Passes on every connection to `port` to a hub on this machine.

    Args:
        port: Where it listens.
        target: Where the hub listens.
        delay: Seconds that anything takes to cross it.
    """

    def __init__(self, port: int, target: int, delay: float = 0.0) -> None:
        self._listener = socket.create_server((_HOST, port))
        self._target = target
        self._delay = delay
        self._whole = threading.Event()
        self._whole.set()
        self._lock = threading.Lock()  # for the next two
        self._broken = False
        self._ends: list[socket.socket] = []
        self._threads = [threading.Thread(target=self._accept, name="slow link")]

    def __enter__(self) -> Self:
        self._threads[0].start()
        return self

    def __exit__(self, *_: object) -> None:
        self._listener.shutdown(socket.SHUT_RDWR)  # which ends `accept`
        self._threads[0].join()
        self._listener.close()
        self.sever()
        self._whole.set()
        for thread in self._threads[1:]:
            thread.join()
        for end in self._ends:
            end.close()

    def cut(self) -> None:
        """Hold back everything, both ways, until `heal`; neither end is told."""
        self._whole.clear()

    def heal(self) -> None:
        """Deliver what was held back, and whatever comes."""
        with self._lock:
            self._broken = False
        self._whole.set()

    def sever(self) -> None:
        """Close all connections, and refuse others until `heal`."""
        with self._lock:
            self._broken = True
            for end in self._ends:
                with suppress(OSError):
                    end.shutdown(socket.SHUT_RDWR)

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                with self._lock:
                    if self._broken or not self._connect(near):
                        near.close()

    def _connect(self, near: socket.socket) -> bool:
        """Pass on what comes, both ways; return whether the hub is there."""
        try:
            far = socket.create_connection((_HOST, self._target))
        except OSError:
            return False
        self._ends += [near, far]
        for ends in (near, far), (far, near):
            thread = threading.Thread(target=self._pass_on, args=ends)
            self._threads.append(thread)
            thread.start()
        return True

    def _pass_on(self, one: socket.socket, other: socket.socket) -> None:
        with suppress(OSError):
            while chunk := one.recv(_CHUNK):
                time.sleep(self._delay)  # it is the link that is slow
                self._whole.wait()
                other.sendall(chunk)
        with suppress(OSError):
            other.shutdown(socket.SHUT_RDWR)  # the one end has gone, so this one goes
