"""Logs the sessions that the hub denied, with a limit on their number.

Zenoh reports refusals in its own log alone, and that goes to the standard output of the
process. Here that output is read, refusals are told apart and logged, in bounded number
whatever intruders do, and all else passes on.

A refused *session* always shows. A refused *message* (a certificate that may connect
but not publish that) is dropped without a word. Such an attempt shows as a gap in its
sender's running numbers, if it bothers with them. Where ``RUST_LOG`` is set, Zenoh's
log goes out as it is: ``zenoh::net::routing::interceptor::access_control=trace`` there
logs every decision about a message.
"""

import logging
import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

import zenoh

_LOG = logging.getLogger(__name__)
_WINDOW = 10.0  # seconds
_MOST = 10  # different refusals reported in one window
_LONGEST = 300  # characters of one
_CHUNK = 1 << 16

_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LINE = re.compile(
    r"(?P<before>.*?)\d{4}-\d\d-\d\dT[\d:.]+Z\s+(?P<level>[A-Z]+)\s+(?:\S+ )?ThreadId\(\d+\) "
    r"(?P<target>[\w:]+): (?P<text>.*)"
)
_LINKS = re.compile(r"zenoh_(link|transport)")
_HINT = " Hint: increase the system open file limit."  # said whatever the reason is


class DeniedSessions:
    """Finds refused sessions in the lines of Zenoh's log, and reports them.

    In each window of some seconds a refusal is reported once, and at most a few
    different ones. The number of those left out is reported when the next window
    begins.

    Args:
        report: Gets a line for people. Control characters in it are escaped.
    """

    def __init__(self, report: Callable[[str], None]) -> None:
        self._report = report
        self._until = 0.0
        self._reported: set[str] = set()
        self._unreported = 0

    def read(self, line: str) -> str | None:
        """Read one line; return None if it is not from Zenoh's log.

        Returns:
            What this process had written of a line of its own before Zenoh's, whose end
            comes after it: mostly nothing.
        """
        found = _LINE.fullmatch(_COLOURS.sub("", line))
        if found is None:
            return None
        if found["level"] == "WARN" and _LINKS.match(found["target"]):
            self._refuse(found["text"].removesuffix(_HINT))
        return found["before"]

    def _refuse(self, why: str) -> None:
        now = time.monotonic()
        if now >= self._until:
            self.close()
            self._until = now + _WINDOW
        alike = re.sub(r"\d+", "0", why)
        if alike in self._reported or len(self._reported) == _MOST:
            self._unreported += 1
            return
        self._reported.add(alike)
        # Cut, and with nothing in it that a terminal would act on.
        plain = why[:_LONGEST].encode("unicode_escape").decode()
        self._report(f"session refused: {plain}")

    def close(self) -> None:
        """Log how many refusals were left out, and reset the count."""
        if self._unreported:
            self._report(f"session refused: and {self._unreported} more like these")
        self._unreported = 0
        self._reported.clear()


@contextmanager
def telling_refusals() -> Iterator[None]:
    """Log which sessions a hub in this process refuses, as warnings, until the end.

    To be entered before the hub opens. Takes the process's standard output meanwhile,
    and passes on what is not Zenoh's. Once in a process counts: Zenoh's log cannot be
    set up again.
    """
    if "RUST_LOG" in os.environ:
        zenoh.init_log_from_env_or("warn")
        yield
        return
    refusals = DeniedSessions(lambda text: _LOG.warning("%s", text))
    sys.stdout.flush()
    read, write = os.pipe()
    own = os.dup(1)
    os.dup2(write, 1)
    os.close(write)
    reader = threading.Thread(
        target=_read, args=(read, own, refusals), name="fabric/refusals"
    )
    reader.start()
    try:
        zenoh.init_log_from_env_or("warn")
        yield
    finally:
        sys.stdout.flush()
        os.dup2(own, 1)  # nothing writes into the pipe any more: the reader ends
        reader.join()
        os.close(read)
        os.close(own)


def _read(pipe: int, own: int, refusals: DeniedSessions) -> None:
    """Read all that comes through `pipe`; pass on what is not Zenoh's."""
    rest = b""
    while chunk := os.read(pipe, _CHUNK):
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            before = refusals.read(line.decode(errors="replace"))
            _pass_on(own, line + b"\n" if before is None else before.encode())
    if rest:
        _pass_on(own, rest)
    refusals.close()


def _pass_on(own: int, data: bytes) -> None:
    """Write, unless nothing reads: the hub goes on, and refusals are logged.

    Were nothing read any more, the hub would soon wait for room to log.
    """
    with suppress(OSError):
        os.write(own, data)
