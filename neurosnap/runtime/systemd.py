"""Notifies systemd: ready, status, watchdog, stopping.

The protocol is that of sd_notify(3): datagrams to the socket that the environment
names. Where it names none, as when started by hand, nothing is sent.
"""

import os
import socket
import time
from typing import Self

_STATUS = 1.0  # seconds between two words about how far it is


class ServiceManager:
    """The service manager that started this process; a context manager."""

    def __init__(self) -> None:
        self._address = os.environ.get("NOTIFY_SOCKET", "")
        if self._address.startswith("@"):  # not in the file system
            self._address = "\0" + self._address[1:]
        self._socket: socket.socket | None = None
        watchdog = os.environ.get("WATCHDOG_USEC", "")
        self._period = int(watchdog) / 2e6 if watchdog.isdecimal() else _STATUS
        self._is_up = False
        self._next = 0.0

    def __enter__(self) -> Self:
        if self._address:
            flags = socket.SOCK_DGRAM | socket.SOCK_CLOEXEC
            self._socket = socket.socket(socket.AF_UNIX, flags)
        return self

    def __exit__(self, *_: object) -> None:
        if self._socket is not None:
            self._tell("STOPPING=1")
            self._socket.close()
            self._socket = None

    def progress(self, tick: int) -> None:
        """Say that the run is up, if that was not said, and that it goes on.

        Called as long as it does, with the tick that it is at; says it once a second at
        most, or as often as the manager asks for.
        """
        now = time.monotonic()
        if self._socket is None or now < self._next:
            return
        self._next = now + min(self._period, _STATUS)
        ready = "" if self._is_up else "READY=1\n"
        self._is_up = True
        self._tell(f"{ready}WATCHDOG=1\nSTATUS=tick {tick}")

    def _tell(self, text: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(text.encode(), self._address)
        except OSError:  # a manager that does not listen is no reason to end a run
            self._socket.close()
            self._socket = None
