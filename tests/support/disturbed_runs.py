"""Runs that continue after parts are killed."""

import asyncio
import signal
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import psutil

from neurosnap import wire
from neurosnap.errors import RecordingError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import Outcome, RunRequest, Site, Supervision, Watcher
from neurosnap.runtime.run_with_restarts import run
from tests.support import run_options
from tests.support.course import course
from tests.support.swarm_processes import parts_of

if TYPE_CHECKING:
    from neurosnap.runtime.request import Restart

PATH = "neurosnap/Path-v0"
SENSORS = 4
HERE = Site()
ENDLESS = 1_000_000  # ticks; such a run is ended by an event


def options_for(ticks: int) -> RunOptions:
    return run_options.options_for(PATH, 3, {"places": SENSORS + 1}, ticks=ticks)


def on_disk(log: Path) -> int:
    """Return the last tick of which a recording that grows holds the state."""
    last = max(part_paths(log).values(), default=log)
    try:
        recording = Recording.open(last)
        states = [recorded.message for recorded in recording.messages(("state",))]
    except RecordingError:  # it has just begun
        return 0
    return max((m.tick for m in states if isinstance(m, wire.State)), default=0)


class Disturbed:
    """A run of which parts are killed, each time once enough of it is on disk.

    It is not bound by its ticks: it ends in order once it has gone on after the last
    of the killings, however fast or slow the machine is.

    Args:
        options: Of the run.
        log: Where it is recorded.
        files: Each of its lives must also begin another file of the recording.
        supervision: As `Supervision` takes it.
    """

    def __init__(
        self,
        options: RunOptions,
        log: Path,
        *,
        files: bool = False,
        **supervision: object,
    ) -> None:
        self.restarts: list[Restart] = []
        self.flushed: list[int] = []
        """The last tick that was on disk, of each killing."""
        self._options = options
        self._log = log
        self._files = files
        self._size = 0  # of the recording, when it was last read
        self._supervision = msgspec.convert(
            {"backoff": 0.0, **supervision}, Supervision
        )

    def run(self, *killings: tuple[int, tuple[str, ...]]) -> Outcome:
        """Make the run; in each of its lives, parts are killed together.

        A killing is how many ticks of this life must be on disk, and who dies then.
        """
        return asyncio.run(self.running(*killings))

    async def running(
        self, *killings: tuple[int, tuple[str, ...]], site: Site = HERE
    ) -> Outcome:
        """Make the run, its parts at `site`."""
        stop = asyncio.Event()

        def on_progress(tick: int) -> None:
            life = len(self.restarts)
            begun = self.restarts[-1].tick if self.restarts else 0
            if life == len(self.flushed) < len(killings):
                ticks, victims = killings[life]
                # To read it all takes as long as many ticks.
                if tick < begun + ticks or not self._has_grown():
                    return
                if self._files and len(part_paths(self._log)) < life + 2:
                    return
                flushed = on_disk(self._log)
                if flushed < begun + ticks:
                    return
                if self.strike(victims):
                    self.flushed.append(flushed)
            elif killings and life == len(killings) and tick > begun:
                stop.set()

        request = RunRequest(
            self._options, self._log, site=site, supervision=self._supervision
        )
        watcher = Watcher(on_progress, on_restart=self.note)
        return await run(request, stop, watcher)

    def note(self, restart: "Restart") -> None:
        """Note that the run goes on."""
        self.restarts.append(restart)

    def strike(self, victims: tuple[str, ...]) -> bool:
        """Kill these parts at once; tell whether all of them were there."""
        found = dict(parts_of(psutil.Process()))
        if not found.keys() >= set(victims):
            return False
        for victim in victims:
            found[victim].send_signal(signal.SIGKILL)
        return True

    def _has_grown(self) -> bool:
        """Tell whether more of the recording is on disk than when this last said so."""
        try:
            size = sum(file.stat().st_size for file in part_paths(self._log).values())
        except FileNotFoundError:  # it is being moved
            return False
        grown, self._size = size != self._size, size
        return grown


def check_same(
    outcome: Outcome, disturbed: Disturbed, log: Path, options: RunOptions, calm: Path
) -> None:
    """Check that a run came to what one without deaths of as many ticks comes to."""
    check_whole(outcome, log, options, calm)
    killings = len(disturbed.flushed)
    assert (outcome.restarts, len(disturbed.restarts)) == (killings, killings)
    # Of the last tick on disk not all may be there; of the one before it all is.
    for restart, flushed in zip(disturbed.restarts, disturbed.flushed, strict=True):
        assert restart.tick >= flushed - 1
    reached = [restart.tick for restart in disturbed.restarts]
    assert reached == sorted(set(reached))
    assert reached[-1] < outcome.totals.ticks


def check_whole(outcome: Outcome, log: Path, options: RunOptions, calm: Path) -> None:
    """Check that nothing is missing, and that the run is what it is in one process."""
    ticks = outcome.totals.ticks
    inline = msgspec.structs.replace(options, ticks=ticks, cells="inline", split=0)
    undisturbed = asyncio.run(run(RunRequest(inline, calm), asyncio.Event()))
    assert undisturbed.totals.ticks == ticks
    assert outcome.implications == undisturbed.implications
    assert course(log, ticks) == course(calm)
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, ticks)
