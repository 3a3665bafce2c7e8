"""A recorder that stands still holds the run up, and nothing is lost.

What is for it waits in its session and in the hub's queues; once these are full, the
hub takes nothing more from anybody, and every part's next message blocks. Only when it
is silent for longer than a session's lease is a recorder taken for dead.
"""

import asyncio
import signal
from pathlib import Path

import msgspec
import psutil
import pytest

from neurosnap.agent.body import Body
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import Recording
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.request import Outcome, RunRequest, Watcher
from neurosnap.runtime.run import run
from tests.support.course import course

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]

HELD = 4  # reports of the same tick, a quarter of a second apart
OPTIONS = RunOptions(
    source="neurosnap/Path-v0",
    arguments={"places": 5},
    body=Body(
        own=("below_1", "below_2", "below_3", "below_4"), actions=("forward", "back")
    ),
    ticks=1_000_000,  # it is stopped, once the recorder was held up enough
    seed=3,
)


def recorder() -> psutil.Process:
    """Return the process that records, of the one swarm that runs."""
    (found,) = (
        child
        for child in psutil.Process().children(recursive=True)
        if child.name() == "recorder"
    )
    return found


class Standstill:
    """Stops the recorder at a tick, until no tick has been made for a while.

    Ends the run once that goes on.
    """

    def __init__(self, log: Path) -> None:
        self.over = asyncio.Event()
        self.stopped_at = self.held_at = 0
        self.grown = -1  # bytes, while the recorder stood still
        self._log = log
        self._process: psutil.Process | None = None
        self._reports = 0

    def follow(self, tick: int) -> None:
        """Take in a report of the run's tick."""
        if self._process is None:
            if tick >= 20:
                self._process, self.stopped_at = recorder(), tick
                self._process.send_signal(signal.SIGSTOP)
                self._size = self._log.stat().st_size
            return
        if self.grown >= 0:
            if tick > self.held_at:
                self.over.set()
            return
        self._reports = self._reports + 1 if tick == self.held_at else 0
        self.held_at = tick
        if self._reports == HELD:
            self.grown = self._log.stat().st_size - self._size
            self._process.send_signal(signal.SIGCONT)


def check_whole(log: Path, outcome: Outcome) -> None:
    """Check that nothing was lost: it is what an undisturbed run comes to."""
    assert outcome.completeness is not None
    assert outcome.completeness.whole
    recording = Recording.open(log)
    completeness = recording.completeness()
    assert (completeness.missing, completeness.foreign) == ({}, 0)
    assert recording.cut is None
    ticks, calm = outcome.totals.ticks, log.with_name("calm")
    inline = msgspec.structs.replace(OPTIONS, cells="inline", ticks=ticks)
    asyncio.run(run(RunRequest(inline, calm), asyncio.Event()))
    assert course(log, ticks) == course(calm)
    verdict = verify(log)
    assert (verdict.same, verdict.complete, verdict.ticks) == (True, True, ticks)


def test_a_recorder_that_stands_still_holds_the_run_up(tmp_path: Path) -> None:
    log = tmp_path / "log"
    standstill = Standstill(log)
    outcome = asyncio.run(
        run(RunRequest(OPTIONS, log), standstill.over, Watcher(standstill.follow))
    )
    assert 20 <= standstill.stopped_at <= standstill.held_at < outcome.totals.ticks
    assert standstill.grown == 0
    check_whole(log, outcome)
