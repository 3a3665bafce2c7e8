"""Logs the messages that the hub denied, with a limit on their number.

Zenoh reports refusals in its own log alone, and that goes to the standard output of the
process. Here that output is read, refusals are told apart and logged, in bounded number
whatever intruders do, and all else passes on.

A refused *session* always shows. A refused *message* (a certificate that may connect
but not publish that) is dropped without a word, unless the hub traces every decision
it takes (`audit`): one or two lines of its log a message, which multiplies what a
message costs it. Without that, such an attempt shows as a gap in its sender's running
numbers, if it bothers with them.
"""

import logging
import os
import re
import sys
import threading
import time
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TypeVar

import zenoh

T = TypeVar("T")

_LOG = logging.getLogger(__name__)
_WINDOW = 10.0  # seconds
_MOST = 300  # different refusals told in one window, of all subjects
_MOST_OF_A_KIND = 10  # and of one subject's at one kind of message
_LONGEST = 300  # characters of one
_CHUNK = 1 << 16
_SESSIONS = 1 << 14  # whose role is remembered
_THREADS = 1 << 10  # of the hub, whose decisions in advance are told apart

_ACCESS = "zenoh::net::routing::interceptor::access_control"
_COLOURS = re.compile(r"\x1b\[[0-9;]*m")
_LINE = re.compile(
    r"\S+Z\s+(?P<level>[A-Z]+)\s+(?:\S+ )?(?P<thread>ThreadId\(\d+\)) "
    r"(?P<target>[\w:]+): (?P<text>.*)"
)
_LINKS = re.compile(r"zenoh_(link|transport)")
_HINT = " Hint: increase the system open file limit."  # said whatever the reason is
_CACHING = re.compile(r"ACL \((?P<flow>\w+)\): caching permissions for `(?P<key>.*)`.*")
_DECISION = re.compile(
    r"(?P<cached>Using cached result: )?(?P<zid>[0-9a-f]+)"
    r"( on \S*CertCommonName\((?P<role>[^)]*)\)\S*)?"
    r" is (?P<not>un)?authorized to (?P<what>.+?) \(ingress\) on (?P<key>.*)"
)


class DeniedConnections:
    """Finds refusals in the lines of Zenoh's log, and reports them.

    In each window of some seconds a refusal is reported once, and at most a few
    different ones of each certificate at each kind of message: so one intruder's noise
    hides neither what another tries nor what it puts itself. The number of those left
    out is reported, for each of these, when the next window begins.

    Args:
        report: Gets a line for people. Control characters in it are escaped.
        clock: Seconds.
    """

    def __init__(
        self,
        report: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._report = report
        self._clock = clock
        self._until = 0.0
        # By what a refusal begins with: who, and what kind of message.
        self._reported: dict[str, set[str]] = {}
        self._unreported: Counter[str] = Counter()
        self._count = 0  # told, in all
        self._roles = _Latest[str](_SESSIONS)  # by session
        # By thread: key, session.
        self._caching = _Latest[tuple[str, str | None]](_THREADS)

    def read(self, line: str) -> bool:
        """Read one line; return false if it is not from Zenoh's log."""
        found = _LINE.fullmatch(_COLOURS.sub("", line))
        if found is None:
            return False
        if found["target"] == _ACCESS:
            self._decided(found["thread"], found["text"])
        elif found["level"] == "WARN" and _LINKS.match(found["target"]):
            self._refuse("session refused:", found["text"].removesuffix(_HINT))
        return True

    def _decided(self, thread: str, text: str) -> None:
        """Take in a decision about a message, unless it is one made in advance.

        For a key declared to it the hub decides in advance about whatever may come;
        it says so, and its thread then lists all of it for one session.
        """
        caching = _CACHING.fullmatch(text)
        if caching is not None:
            # What goes out is no attempt, and is not read below.
            key = caching["key"] if caching["flow"] == "ingress" else ""
            self._caching[thread] = (key, None)
            return
        made = _DECISION.fullmatch(text)
        if made is None:
            return
        if made["role"] is not None:
            self._roles[made["zid"]] = made["role"]
        key, session = self._caching.get(thread, ("", None))
        if not made["cached"] and key == made["key"] and session in (None, made["zid"]):
            self._caching[thread] = (key, made["zid"])
            return
        self._caching.pop(thread, None)
        if made["not"]:
            role = self._roles.get(made["zid"], "stranger")
            self._refuse(f"{role} refused: {made['what']}", f"on {made['key']}")

    def _refuse(self, kind: str, rest: str) -> None:
        now = self._clock()
        if now >= self._until:
            self.close()
            self._until = now + _WINDOW
        told = self._reported.setdefault(kind, set())
        alike = re.sub(r"\d+", "0", rest)
        if alike in told or len(told) == _MOST_OF_A_KIND or self._count == _MOST:
            self._unreported[kind] += 1
            return
        told.add(alike)
        self._count += 1
        self._report(_plain(f"{kind} {rest}"))

    def close(self) -> None:
        """Say how many were left out, and begin anew."""
        for kind, count in self._unreported.items():
            self._report(_plain(f"{kind} and {count} more like these"))
        self._unreported.clear()
        self._reported.clear()
        self._count = 0


class _Latest(OrderedDict[str, T]):
    """A dictionary of what was set last; what was set before is dropped."""

    def __init__(self, most: int) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, key: str, value: T) -> None:
        super().__setitem__(key, value)
        self.move_to_end(key)
        if len(self) > self._most:
            self.popitem(last=False)


def _plain(text: str) -> str:
    """Return `text` cut, and with nothing in it that a terminal would act on."""
    return text[:_LONGEST].encode("unicode_escape").decode()


@contextmanager
def telling_refusals(*, audit: bool = False) -> Iterator[None]:
    """Log what a hub in this process refuses, as warnings, until the end.

    To be entered before the hub opens. Takes the process's standard output meanwhile,
    and passes on what is not Zenoh's. Once in a process counts: Zenoh's log cannot be
    set up again.

    Args:
        audit: Refused messages too; see the module.
    """
    refusals = DeniedConnections(lambda text: _LOG.warning("%s", text))
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
        zenoh.init_log_from_env_or(f"warn,{_ACCESS}=trace" if audit else "warn")
        yield
    finally:
        sys.stdout.flush()
        os.dup2(own, 1)  # nothing writes into the pipe any more: the reader ends
        reader.join()
        os.close(read)
        os.close(own)


def _read(pipe: int, own: int, refusals: DeniedConnections) -> None:
    """Take in all that comes through `pipe`; pass on what is not Zenoh's."""
    rest = b""
    while chunk := os.read(pipe, _CHUNK):
        *lines, rest = (rest + chunk).split(b"\n")
        for line in lines:
            if not refusals.read(line.decode(errors="replace")):
                _pass_on(own, line + b"\n")
    if rest:
        _pass_on(own, rest)
    refusals.close()


def _pass_on(own: int, data: bytes) -> None:
    """Write, unless nothing reads: the hub goes on, and refusals are logged.

    Were nothing read any more, the hub would soon wait for room to log.
    """
    with suppress(OSError):
        os.write(own, data)
