#!/usr/bin/env python3
"""Whole swarms in simulation, with crashes, restarts, cuts and losses.

    tools/simulate [--schedules 20000] [--seed 0] [--processes 2] [--only SEED]

Every schedule is a function of its seed: which sensors, which readings, who hosts the
cells, which message comes next, what is lost, cut, late, and who dies when. Whatever
happens, the run must come to the states and decisions that it comes to in process, and
its recording must hold each once, derive again, and say exactly what it lacks.

Exit code: 0 if all do, 1 if one does not; its seed is printed then.
"""

import argparse
import multiprocessing
import sys
import time
from collections.abc import Iterator
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tools.simulate.schedules import Outcome, outcome, outcomes
from tools.simulate.weather import Tally


def gathered(found: Iterator[Outcome]) -> Tally:
    """Return what happened in all.

    Raises:
        SystemExit: A schedule went wrong; the text names its seed, says what happened
            and how to see it again.
    """
    total = Tally()
    for seed, what in found:
        if isinstance(what, str):
            again = f"tools/simulate --only {seed}"
            sys.exit(f"{what}\nseed {seed} fails; again: {again}")
        total.add(what)
    return total


def table(total: Tally, seconds: float) -> str:
    """Return what happened, a line each."""
    lines = [
        f"{name.replace('_', ' '):<12}{getattr(total, name):>14,}"
        for name in total.__struct_fields__
    ]
    return "\n".join([*lines, f"{'seconds':<12}{seconds:>14,.1f}"])


def main(arguments: list[str] | None = None) -> int:
    """Simulate as the command line says; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--schedules", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first schedule")
    parser.add_argument("--processes", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--only", type=int, help="the one seed to go through")
    given = parser.parse_args(arguments)
    for name in ("schedules", "processes"):
        if getattr(given, name) < 1:
            parser.error(f"--{name}: must be 1 or more, got {getattr(given, name)}")
    began = time.perf_counter()
    if given.only is not None:
        found = iter([outcome(given.only)])
    else:
        found = outcomes(given.seed, given.schedules, given.processes)
    total = gathered(found)
    print(table(total, time.perf_counter() - began))
    return 0


if __name__ == "__main__":
    sys.exit(main())
