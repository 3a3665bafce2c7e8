"""A stalled recorder makes the run wait, and no data is lost.

What is for it waits in its session and in the hub's queues; once these are full, the
hub takes nothing more from anybody, and every part's next message blocks. Only when it
is silent for longer than a session's lease is a recorder taken for dead.
"""

import asyncio
import signal
from pathlib import Path

import psutil
import pytest

from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run_with_restarts import run
from tests.support.disturbed_runs import ENDLESS, check_whole, options_for
from tests.support.swarm_processes import parts_of

pytestmark = [pytest.mark.zenoh, pytest.mark.slow]
HELD = 4  # reports of the same tick, a quarter of a second apart


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
                self._process = dict(parts_of(psutil.Process()))["recorder"]
                self.stopped_at = tick
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


def test_a_recorder_that_stands_still_holds_the_run_up(tmp_path: Path) -> None:
    log, options = tmp_path / "log", options_for(ENDLESS)
    standstill = Standstill(log)
    outcome = asyncio.run(
        run(RunRequest(options, log), standstill.over, Watcher(standstill.follow))
    )
    assert 20 <= standstill.stopped_at <= standstill.held_at < outcome.totals.ticks
    assert standstill.grown == 0
    assert outcome.completeness is not None
    assert (outcome.completeness.missing, outcome.completeness.foreign) == ({}, 0)
    check_whole(outcome, log, options, tmp_path / "calm")
