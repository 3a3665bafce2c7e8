"""Reports of a part to whoever started it, through a pipe or as Ray carries them.

They do not go over the network: they must work when the network does not.
"""

import contextlib
import threading
import time
from multiprocessing.connection import Connection
from typing import Annotated, Protocol, TypeAlias

import msgspec

from neurosnap.agent.growth.changed import Changed

# A pipe keeps writes of up to 4,096 bytes whole, so that many cells can share one; four
# of them are the length of what follows.
_LONGEST = 4096 - 4
_PROGRESS = 0.05  # seconds between two reports of progress


class Ready(msgspec.Struct, frozen=True, tag=True):
    """The part is up."""

    who: str


class Progress(msgspec.Struct, frozen=True, tag=True):
    """The part has come so far."""

    who: str
    tick: Annotated[int, msgspec.Meta(ge=0)]


class Grown(msgspec.Struct, frozen=True, tag=True):
    """Sensors were grown, or retired."""

    who: str
    changes: list[Changed]


class Health(msgspec.Struct, frozen=True, tag=True):
    """The sensors of the home are so now: a `Standing`, which no cell has to know."""

    who: str
    standing: msgspec.Raw


class Done(msgspec.Struct, frozen=True, tag=True):
    """The part has done its work; `result` is what came of it."""

    who: str
    result: msgspec.Raw = msgspec.Raw(b"null")


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The part cannot go on."""

    who: str
    what: str
    died: bool = False
    """It would be able to if another part had not died."""


Report: TypeAlias = Ready | Progress | Grown | Health | Done | Failed

_encode = msgspec.json.encode
_decoder: msgspec.json.Decoder[Report] = msgspec.json.Decoder(Report)


def decode_report(content: bytes) -> Report:
    """Return a report as it was."""
    return _decoder.decode(content)


def read_report(connection: Connection) -> Report:
    """Return the next report. Blocks until there is one.

    Raises:
        EOFError: Nobody is left to report.
    """
    return decode_report(connection.recv_bytes())


class Line(Protocol):
    """Where reports go, such as a pipe."""

    def send_bytes(self, buf: bytes, /) -> None:
        """Send one report."""


class Reporter:
    """A part's line to what started it; any thread may report.

    Args:
        who: The part's name.
        line: Where reports go.
        every_tick: Report every tick; otherwise at most twenty a second, since a pipe
            is not read faster.
    """

    def __init__(self, who: str, line: Line, *, every_tick: bool = False) -> None:
        self._who = who
        self._line = line
        self._every_tick = every_tick
        self._tick = -1
        self._lock = threading.Lock()  # a long report is several writes
        self._next_progress = 0.0

    def ready(self) -> None:
        """Say that the part is up."""
        self._send(Ready(self._who))

    def progress(self, tick: int) -> None:
        """Report the tick it has come to, unless one was reported a moment ago."""
        now = time.monotonic()
        is_next = self._every_tick and tick != self._tick
        if now < self._next_progress and not is_next:
            return
        self._tick, self._next_progress = tick, now + _PROGRESS
        self._send(Progress(self._who, tick))

    def changed(self, changes: list[Changed]) -> None:
        """Say what was grown or retired. Only for parts with a pipe of their own."""
        if changes:
            self._send(Grown(self._who, changes))

    def health(self, standing: object) -> None:
        """Say how the sensors are. Only for parts with a pipe of their own."""
        self._send(Health(self._who, msgspec.Raw(msgspec.json.encode(standing))))

    def done(self, result: object = None) -> None:
        """Say what came of it. Only for parts with a pipe of their own."""
        self._send(Done(self._who, msgspec.Raw(msgspec.json.encode(result))))

    def failed(self, what: str, *, died: bool = False) -> None:
        """Say why it cannot go on; the end of a long text is what counts.

        That it is short enough shows once it is encoded: a character may take six
        bytes.
        """
        kept = what[-_LONGEST:]
        while len(_encode(report := Failed(self._who, kept, died))) > _LONGEST:
            kept = kept[len(kept) // 16 + 1 :]
        self._send(report)

    def _send(self, report: Report) -> None:
        # A line that is broken: nobody is left to be told.
        with self._lock, contextlib.suppress(BrokenPipeError):
            self._line.send_bytes(_encode(report))
