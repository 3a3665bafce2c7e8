"""Goes through many schedules, in several processes.

Not in the module that is run: a process finds what it is to do by its module's name,
and the one that is run has another name there.
"""

import functools
import multiprocessing
import tempfile
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

from tools.simulate.case import simulate
from tools.simulate.weather import Tally

Outcome = tuple[int, Tally | str]
"""A seed, and what happened or what went wrong."""
Schedule = Callable[[int, Path], Tally]


def outcome(seed: int, schedule: Schedule = simulate) -> Outcome:
    """Go through one schedule in a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="simulate-") as folder:
        try:
            return seed, schedule(seed, Path(folder))
        except Exception:  # noqa: BLE001 - whatever it is, the schedule has found it
            return seed, traceback.format_exc()


def outcomes(
    first: int, schedules: int, processes: int, schedule: Schedule = simulate
) -> Iterator[Outcome]:
    """Yield the outcomes of so many seeds, in order."""
    seeds = range(first, first + schedules)
    work = functools.partial(outcome, schedule=schedule)
    if processes == 1:
        yield from map(work, seeds)
        return
    with multiprocessing.get_context("forkserver").Pool(processes) as pool:
        yield from pool.imap(work, seeds, chunksize=20)
