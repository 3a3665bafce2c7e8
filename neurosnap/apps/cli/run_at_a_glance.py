"""A run at a glance: rows at the foot of a terminal while a swarm is at work."""

import os
import sys
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import msgspec
from rich.live import Live
from rich.table import Table
from rich.text import Text

from neurosnap.apps.cli.terminal_output import printable, screen, warn
from neurosnap.errors import NeurosnapError
from neurosnap.health.alarm import lasted
from neurosnap.runtime.parts.job import WavesSoFar
from neurosnap.runtime.request import RunRequest
from neurosnap.sources.live.journal import Content, journal_of, read_journal
from neurosnap.sources.live.statistics import received_line
from neurosnap.sources.open import is_live

_SPAN = 5.0  # seconds that the rates are taken over
_STEP = 0.25  # seconds between two of the states that are kept for that
_AGAIN = 2.0  # seconds between two looks into the journal
_SILENT = 2.0  # seconds without a tick that are told
_SHOWN = 3  # findings, and names of parts that are gone
_LAST = b"\0\n"  # what nothing is printed behind
_HEIGHTS = 8  # of them the depth is shown, the greatest


class Glance:
    """The parts, rates, depths, findings and losses of a run, for people to look at.

    Any thread may feed it.

    Args:
        ticks: How many there are to be; None if that is open.
        parts: The cells or workers that are expected; others are counted as they come.
        log: The recording of a run that reads from outside; None for another run.
        clock: Seconds that never go back.
    """

    def __init__(
        self,
        ticks: int | None = None,
        parts: Iterable[str] = (),
        log: Path | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._ticks = ticks
        self._parts = dict.fromkeys(parts, False)  # whether each is there
        self._journal = None if log is None else journal_of(log)
        self._clock = clock
        self._lock = threading.Lock()  # rich draws on a thread of its own
        self._waves = WavesSoFar()
        self._since = clock()  # the last tick
        self._past: deque[tuple[float, int, int]] = deque()  # when; tick, wave
        self._findings: deque[str] = deque(maxlen=_SHOWN)
        self._readings, self._look = "", clock()

    def waves(self, waves: WavesSoFar) -> None:
        """Take in the waves so far."""
        with self._lock:
            now = self._clock()
            if self._past and waves.tick < self._past[-1][1]:
                self._past.clear()  # it goes on from an earlier tick
            if waves.tick != self._waves.tick:
                self._since = now
            if not self._past or now - self._past[-1][0] >= _STEP:
                self._past.append((now, waves.tick, waves.number))
            while now - self._past[0][0] > _SPAN and len(self._past) > 1:
                self._past.popleft()
            self._waves = msgspec.structs.replace(waves, deepest={**waves.deepest})

    def presence(self, who: str, alive: bool) -> None:
        """Take in that a part has come up, or is gone."""
        with self._lock:
            if who.startswith(("cell/", "worker/")) and who.count("/") == 1:
                self._parts[who] = alive

    def found(self, line: str) -> None:
        """Take in a finding."""
        with self._lock:
            if line not in self._findings:  # a tick may be done again
                self._findings.append(line)

    @contextmanager
    def shown(self) -> Iterator[None]:
        """Show it on standard error, if that is a terminal, while this is entered."""
        if not screen.is_terminal:
            yield
            return
        # What goes to another file than the terminal stays on its way there.
        both = sys.stdout.isatty()
        with (
            _standard_error_above(),
            Live(
                self,
                console=screen,
                transient=True,
                redirect_stdout=both,
                redirect_stderr=False,
            ),
        ):
            yield

    def __rich__(self) -> Table:
        """Return what rich draws; a row is cut at the width of the terminal."""
        grid = Table.grid(padding=(0, 2))
        grid.add_column(no_wrap=True, min_width=8)
        grid.add_column(no_wrap=True, overflow="ellipsis")
        for name, text in self.rows():
            grid.add_row(name, Text(printable(text)))  # it may hold what is markup
        return grid

    def rows(self) -> list[tuple[str, str]]:
        """Return what there is to say now: a name and a text for each row."""
        lost = [*self._lost()]  # reads a file: who feeds it is not to wait for that
        with self._lock:
            return [*self._progress(), *self._alive(), *lost, *self._found()]

    def _progress(self) -> Iterator[tuple[str, str]]:
        waves, now = self._waves, self._clock()
        if not waves.number:
            yield "ticks", "none yet"
            return
        began, tick, number = self._past[0]
        seconds = max(now - began, _STEP)
        rate, of, left = (waves.tick - tick) / seconds, "", ""
        if self._ticks is not None:
            of = f" of {self._ticks:,}"
            left = f", {lasted((self._ticks - waves.tick) / rate)} left" if rate else ""
        yield "ticks", f"{waves.tick:,}{of}; {rate:.3g} a second{left}"
        if (silent := now - self._since) >= _SILENT:
            yield "silent", f"{silent:.0f} s since the last tick"
        if waves.behind is not None:
            yield "behind", waves.behind.line()
        yield "waves", f"{(waves.number - number) / seconds:.3g} a second"
        by_height = sorted(waves.deepest.items(), reverse=True)[:_HEIGHTS]
        at = ", ".join(f"{hops} at {height}" for height, hops in by_height)
        yield "depth", f"{waves.depth} hops; deepest by height: {at}"
        yield "height", f"{waves.height}, the longest chain of implications now"

    def _alive(self) -> Iterator[tuple[str, str]]:
        if not self._parts:
            return
        gone = [who for who, alive in self._parts.items() if not alive]
        kind = next(iter(self._parts)).partition("/")[0]
        text = f"{len(self._parts) - len(gone)} of {len(self._parts)} alive"
        more = f" and {len(gone) - _SHOWN} more" if len(gone) > _SHOWN else ""
        named = f"; not there: {', '.join(gone[:_SHOWN])}{more}" if gone else ""
        yield f"{kind}s", text + named

    def _lost(self) -> Iterator[tuple[str, str]]:
        if self._journal is not None and self._clock() >= self._look:
            self._look = self._clock() + _AGAIN
            try:
                content = read_journal(self._journal)
            except NeurosnapError as error:  # the run itself says it, and ends
                self._readings = str(error)
            else:
                self._readings = _readings(content, self._waves.tick)
        if self._readings:
            yield "readings", self._readings

    def _found(self) -> Iterator[tuple[str, str]]:
        for number, line in enumerate(reversed(self._findings)):
            yield "" if number else "findings", line


@contextmanager
def _standard_error_above() -> Iterator[None]:
    """Print what the parts of a run, and this process, write to standard error.

    They have the file, not the console: without this they would write into the rows,
    and the next picture would be drawn over their lines.
    """
    terminal = os.dup(2)
    reading, writing = os.pipe()
    os.dup2(writing, 2)
    os.close(writing)

    def print_lines() -> None:
        with os.fdopen(reading, "rb") as lines:
            for line in lines:
                said = line.removesuffix(_LAST)  # a part may have died within a line
                if said:
                    warn(said.decode(errors="replace").rstrip("\n"))
                if said != line:
                    return

    printing = threading.Thread(target=print_lines, name="glance/stderr")
    with os.fdopen(terminal, "w") as file:
        screen.file = file
        printing.start()
        try:
            yield
        finally:
            os.write(2, _LAST)
            printing.join()
            os.dup2(terminal, 2)
            screen.file = sys.stderr


def _readings(content: Content, tick: int) -> str:
    """Return what became of the readings that came in, up to a tick."""
    counts = msgspec.structs.asdict(content.taken.received)
    in_ticks = content.received.shown - content.shown_after(tick)
    counts["kept"], counts["shown"] = counts["shown"] - in_ticks, in_ticks
    outages = counts["outages"] + (content.taken.deaf is not None)
    line = received_line(counts).removeprefix("readings: ")
    line = line.replace("kept for a resumed run", "waiting")
    return f"{line}; could not listen {outages} times" if outages else line


def glance_at(request: RunRequest) -> Glance:
    """Return what shows a run that is about to begin."""
    options = request.options
    parts = () if options.cells == "inline" else options.host_names()
    log = request.written if is_live(options.source) else None
    return Glance(options.ticks, parts, log)
