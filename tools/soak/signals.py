"""Ends runs by a signal at a random moment, and checks that each run ends cleanly.

A run is started anew each time and gets SIGINT, SIGTERM or SIGHUP, alone or with its
whole process group, at any moment from its first line to its last; before some of them
a part is killed, so that the signal meets a restart. It must end with 0 and a recording
that is whole and verified, or with 130 and one line where nothing had begun, and leave
no process, folder, socket or note.

A signal that comes before Python has run the program's first line is Python's to
answer: then only what is left is looked at, and the case is counted apart.
"""

import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import msgspec
import psutil

from neurosnap.errors import NeurosnapError
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.system.signals import SIGNALS
from tests.support.swarm_processes import parts_of

PATIENCE = 120.0  # seconds a run may take to end, on a busy machine
_GONE = 10.0  # seconds what a run leaves may take to go
_NEWS = ("going on", "first start:")  # what a run may say that goes well
CELLS = {"process": (), "worker": ("--cells", "worker")}


class Struck(msgspec.Struct, frozen=True, kw_only=True):
    """How a run ended that got a signal."""

    code: int
    """Its exit code."""
    lines: list[str]
    """What it said on stderr."""
    early: bool
    """The signal came before the program's first line."""
    wrong: list[str]
    """What is not as it should be; empty if all is well."""


class Struggle:
    """A run with a process group, a temporary folder and launcher notes of its own."""

    def __init__(
        self,
        folder: Path,
        *arguments: object,
        ignoring: signal.Signals | None = None,
    ) -> None:
        self.log = folder / "a.mcap"
        self._places = [folder / name for name in ("tmp", "run")]
        for place in self._places:
            place.mkdir(mode=0o700)
        self._said = folder / "stderr"
        where = dict(zip(("TMPDIR", "XDG_RUNTIME_DIR"), self._places, strict=True))
        self._marked = {name: str(place) for name, place in where.items()}
        run = ("run", "neurosnap/Path-v0", "--out", self.log, *arguments)
        with self._said.open("wb") as said:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "neurosnap", *map(str, run)],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=said,
                env=os.environ | self._marked,
                start_new_session=True,
                preexec_fn=partial(_heed, ignoring),
            )
        self._early = False

    def said(self) -> str:
        """Return what it has said on stderr."""
        return self._said.read_text()

    def parts(self) -> dict[str, psutil.Process]:
        """Return its parts that are there, by name."""
        with suppress(psutil.NoSuchProcess):
            return dict(parts_of(psutil.Process(self.process.pid)))
        return {}

    def hears(self) -> bool:
        """Tell whether the program's first line has run: it has a handler then."""
        with suppress(OSError, StopIteration):
            status = Path(f"/proc/{self.process.pid}/status").read_text()
            caught = next(x for x in status.splitlines() if x.startswith("SigCgt"))
            return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)
        return True  # it has ended

    def wait_until(self, happened: Callable[[], bool]) -> None:
        """Wait for something to happen, or for the end of the run."""
        limit = time.monotonic() + PATIENCE
        while not happened() and self.process.poll() is None:
            if time.monotonic() > limit:
                raise TimeoutError("a run must come so far, did not")
            time.sleep(0.02)  # to look at all processes takes as long

    def strike(self, number: signal.Signals, *, group: bool) -> None:
        """Send it, or all of its process group, a signal."""
        self._early = self._early or not self.hears()
        with suppress(ProcessLookupError):
            if group:
                os.killpg(self.process.pid, number)
            elif self.process.poll() is None:
                self.process.send_signal(number)

    def judge(self) -> Struck:
        """Wait for the run's end, and return its result."""
        wrong = []
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            wrong.append(f"must end within {PATIENCE:g} s, goes on")
            self.process.kill()
        code = self.process.wait()
        wrong += self._left()
        lines = [line for line in self.said().splitlines() if line.strip()]
        if not self._early:
            wrong += self._misbehaved(code, lines)
        return Struck(code=code, lines=lines, early=self._early, wrong=wrong)

    def _left(self) -> Iterator[str]:
        """Yield what it has left behind."""
        _, alive = psutil.wait_procs(self._family(), timeout=_GONE)
        for process in alive:
            with suppress(psutil.NoSuchProcess):
                yield f"must leave no process, left {process.name()}"
                process.kill()
        for place in self._places:
            for path in place.rglob("*"):
                if path.name != "neurosnap" or not path.is_dir():  # the notes' folder
                    yield f"must leave nothing, left {path}"

    def _family(self) -> list[psutil.Process]:
        """Return every process that has our places in its environment."""
        found = []
        for process in psutil.process_iter():
            with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
                if process.environ().items() >= self._marked.items():
                    found.append(process)
        return found

    def _misbehaved(self, code: int, lines: list[str]) -> Iterator[str]:
        """Yield what is wrong with how it ended."""
        others = [line for line in lines if not line.startswith(_NEWS)]
        if code == 130:
            if self.log.exists():
                yield "must not have begun to record, with exit code 130"
            if others != ["interrupted"]:
                yield f"must say that it was interrupted, said {others}"
            return
        if code != 0:
            yield f"must end with 0 or 130, got {code}"
        if others:
            yield f"must have nothing to say, said {others}"
        try:
            recording = Recording.open(self.log)
            balance = recording.balance(recording.sequences())
            if recording.cut is not None or not balance.whole:
                yield "must leave a recording that is whole"
            elif _ticks(recording) and not verify(self.log).same:
                yield "must leave a recording that can be derived again"
        except NeurosnapError as error:
            yield f"must leave a recording: {error}"

    def close(self) -> None:
        """Leave nothing of it, whatever happened."""
        for process in [*self._family(), self.process]:
            with suppress(psutil.NoSuchProcess, ProcessLookupError):
                process.kill()
        self.process.wait()


def _ticks(recording: Recording) -> int:
    return int((recording.totals or {}).get("ticks", 0))


def _heed(ignored: signal.Signals | None) -> None:
    """Heed a hang-up, even below a `nohup`; ignore one signal, if any."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    if ignored is not None:
        signal.signal(ignored, signal.SIG_IGN)


@contextmanager
def struggling(
    *arguments: object, ignoring: signal.Signals | None = None
) -> Iterator[Struggle]:
    """Start a run that is to get a signal; leave nothing of it.

    Args:
        arguments: Of the run.
        ignoring: A signal that is ignored from the start, as by ``nohup``.
    """
    with tempfile.TemporaryDirectory(prefix="ns-") as folder:
        struggle = Struggle(Path(folder), *arguments, ignoring=ignoring)
        try:
            yield struggle
        finally:
            struggle.close()


def struck_at_random(
    chance: random.Random,
    number: signal.Signals,
    *,
    group: bool,
    cells: str,
    ticks: int,
    length: float,
) -> Struck:
    """Run once, with a signal at a random moment; one in three meets a restart."""
    more = (*CELLS[cells], "--ticks", ticks, "--set", "supervision.backoff=0.3")
    with struggling(*more) as run:
        if chance.random() < 1 / 3:
            run.wait_until(run.log.exists)
            victim = chance.choice(["hub", "recorder", "coordinator", "world"])
            with suppress(psutil.NoSuchProcess, KeyError):
                run.parts()[victim].kill()
            time.sleep(chance.uniform(0, length / 3))
        else:
            time.sleep(chance.uniform(0, length))
        run.strike(number, group=group)
        return run.judge()


def strike_runs(times: int, seed: int, ticks: int) -> bool:
    """Send runs signals and print how they end; tell whether all ended in order.

    Args:
        times: How often each signal is sent to each receiver, with each kind of cells.
        seed: Draws the moments.
        ticks: Of each run.
    """
    began = time.monotonic()
    with struggling("--ticks", ticks) as run:
        run.process.wait()
    length = time.monotonic() - began
    print(f"a run of {ticks} ticks takes {length:.1f} s", flush=True)
    ways = [(n, g, c) for n in SIGNALS for g in (False, True) for c in CELLS]
    ended: Counter[str] = Counter()
    wrong = 0
    for turn in range(times):
        for number, group, cells in ways:
            chance = random.Random(f"{seed} {turn} {number} {group} {cells}")
            found = struck_at_random(
                chance, number, group=group, cells=cells, ticks=ticks, length=length
            )
            ended["before the first line" if found.early else f"code {found.code}"] += 1
            if found.wrong:
                wrong += 1
                to = "group" if group else "leader"
                print(f"{number.name} to {to}, {cells}, turn {turn}: {found}")
        print(f"{(turn + 1) * len(ways)} signals, {wrong} wrong, {ended}", flush=True)
    return not wrong
