"""Standard input as a source: one JSON reading per line; see `json_reading`.

A whole reading is never skipped: what was read is handed in at once, and while too many
wait for their tick nothing more is read: the pipe holds back the writer. Single
readings become the latest ones, and the schedule decides when these are a tick. A line
that is no reading is logged with its number, and the run goes on; the end of the input
ends it in order.
"""

import logging
import math
import os
import select
import threading
import time
from collections.abc import Iterator
from contextlib import suppress

from neurosnap.errors import FabricError, InvalidValueError, within
from neurosnap.sensorium import Sensorium
from neurosnap.sources.conditions import Signals
from neurosnap.sources.live.first_stretch import Ranges
from neurosnap.sources.live.json_reading import LIMIT, hand_in, read, too_long
from neurosnap.sources.live.live_source import LiveSource
from neurosnap.sources.live.signal_readers import flattened
from neurosnap.sources.wanted import Wanted

STANDARD_INPUT = 0
_PIECE = 1 << 16
_LINES = 1000
"""Lines by which ranges are learned, at most; they wait for their ticks meanwhile."""
_logger = logging.getLogger(__name__)
_NAME = "standard input"


class StdinFeeder:
    """Reads lines on a thread of its own.

    Args:
        head: The first lines, where they were read
            already. A source that goes on with a run had what it says.
    """

    def __init__(self, head: bytes | None = None) -> None:
        self._head = head
        self._lines = Lines(LIMIT)
        self._thread: threading.Thread | None = None
        # The reading thread waits for input or for this, whichever comes first.
        self._heard, self._told = os.pipe()
        self._open = True

    def start(self, source: LiveSource) -> None:
        """Begin to read."""
        self._thread = threading.Thread(
            target=self._run, args=(source,), name="outside/lines", daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """Stop reading; what was read and not handed in is dropped."""
        if not self._open:
            return
        self._open = False
        os.close(self._told)
        if self._thread is not None:
            self._thread.join()
        os.close(self._heard)

    def _run(self, source: LiveSource) -> None:
        try:
            if self._head is not None:
                for number, line in self._lines.feed(self._head + b"\n"):
                    if not source.resumed:
                        self._receive_line(source, number, line)
            while source.wait_for_room():
                piece = self._read()
                for number, line in self._lines.feed(piece):
                    self._receive_line(source, number, line)
                if not piece:
                    break
            if self._open and not source.is_full:
                for number, line in self._lines.finish():
                    self._receive_line(source, number, line)
            source.end()
        except OSError as error:
            rule = f"must be readable, got {error.strerror}"
            source.fail(FabricError(f"{_NAME}: {rule}"))
        except BaseException as error:  # noqa: BLE001 - goes on to `step`, whole
            source.fail(error)

    def _read(self) -> bytes:
        """Wait for input and return some of it; nothing at its end, or ours."""
        poll = select.poll()  # `select.select` ends at descriptor 1023
        poll.register(STANDARD_INPUT, select.POLLIN)
        poll.register(self._heard, select.POLLIN)
        if self._heard in dict(poll.poll()):
            return b""
        return os.read(STANDARD_INPUT, _PIECE)

    def _receive_line(self, source: LiveSource, number: int, line: bytes) -> None:
        if source.is_full or not line.strip():
            return  # if it is full, the run has all its ticks
        try:
            hand_in(source, line, spare=True)
        except InvalidValueError as error:
            source.refuse(str(within(f"{_NAME}:{number}", error)))


def first_lines(seconds: float, bins: int) -> tuple[bytes, Signals]:
    """Return the first lines, and how the signals in them are read; read no more.

    Waits for the first, which names all signals, and reads what waits already, since a
    number may be 0 at first. Where there are numbers, or words of their own, more are
    waited for: for so many seconds, `_LINES` of them at most.

    Args:
        seconds: How long.
        bins: Parts that the range of a number is cut into.

    Raises:
        InvalidValueError: The first line is too long, or there is none; or it is no
            reading, or names none or not all of them.
    """
    head = _first_line()
    names, ranges = names_in(head), Ranges(Wanted(bins=bins))
    end, count, told = time.monotonic() + seconds, 1, ""
    line: bytes | None = head.strip()
    while line is not None:
        with suppress(InvalidValueError):  # a line that is no reading is told of later
            said = read(line).values(names)
            named = {name: said[name] for name in names if name in said}
            ranges.read(flattened(named, ranges))
        if count >= _LINES or len(head) >= LIMIT:
            break
        if not ranges.are_plain and not told:
            told = f"from {_LINES:,} lines, or {seconds:g} seconds"
            _logger.warning("learning the range: %s", told)
        if (line := _line(-math.inf if ranges.are_plain else end)) is not None:
            head += b"\n" + line
            count += 1
    return head, ranges.chosen(names)


def _first_line() -> bytes:
    """Return the first line that is not blank, with those before it."""
    head = b""
    while (line := _line(math.inf)) is not None:
        head += line
        if len(head) > LIMIT:
            raise within(_place(head), too_long())
        if line.strip():
            return head
        head += b"\n"
    rule = "must begin with a line that names the sensors (or name them: sensors)"
    raise InvalidValueError(_NAME, rule, "no line")


def _line(end: float) -> bytes | None:
    """Return the next line; None if none begins until then, or any more.

    It comes without its line feed, and is read byte by byte, so that the feeder misses
    nothing.
    """
    line = bytearray()
    try:
        poll = select.poll()
        poll.register(STANDARD_INPUT, select.POLLIN)
        left = end - time.monotonic()
        if not poll.poll(None if left == math.inf else max(0, 1000 * left)):
            return None
        while byte := os.read(STANDARD_INPUT, 1):
            if byte == b"\n":
                return bytes(line)
            line += byte
            if len(line) > LIMIT:
                break
    except OSError as error:
        rule = f"must be readable ({error.strerror})"
        raise InvalidValueError(_NAME, rule, STANDARD_INPUT) from error
    return bytes(line) or None


def names_in(line: bytes) -> tuple[str, ...]:
    """Return the signals that a first line names; blank ones may be before it.

    Raises:
        InvalidValueError: It is no reading, or names none or not all of them.
    """
    try:
        reading = read(line.strip())
        if not isinstance(reading.bits, dict):
            rule = "must name all sensors ({'bits': {...}}; or name them: sensors)"
            raise InvalidValueError("reading", rule, line.strip()[:80])  # noqa: TRY301
        return Sensorium(reading.bits).names
    except InvalidValueError as error:
        raise within(_place(line), error) from error


def _place(line: bytes | bytearray) -> str:
    """Return where a first line stands, with blank ones before it."""
    number = 1 + line.count(b"\n")
    return f"{_NAME}:{number}"


class Lines:
    """Numbers the lines of a stream that arrives in pieces of any size.

    Args:
        limit: Bytes of a line at most; of a longer one at least a byte more is kept.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._number = 0
        self._rest = b""
        """The beginning of the next line."""

    def feed(self, piece: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield the number and the text of every line that `piece` ends.

        The text comes without its line feed.
        """
        *ended, rest = (self._rest + piece).split(b"\n")
        self._rest = rest[: self._limit + 1]
        for line in ended:
            self._number += 1
            yield self._number, line

    def finish(self) -> Iterator[tuple[int, bytes]]:
        """Yield what follows the last line feed, if anything does."""
        if self._rest:
            yield from self.feed(b"\n")
