#!/usr/bin/env python3
"""Simulates whole swarms, with crashes, restarts, cuts and losses.

    tools/simulate [--schedules 20000] [--seed 0] [--only SEED]

Every schedule is a function of its seed: which sensors, which readings, who hosts the
cells, which message comes next, what is lost, cut, late, and who dies when. Whatever
happens, the run must come to the states and decisions that it comes to in process, and
its recording must hold each once, derive again, and say exactly what it lacks.

Exit code: 0 if all do, 1 if one does not; its seed is printed then.
"""

import argparse
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tools.simulate.case import simulate
from tools.simulate.simulated_faults import Tally


def simulated(
    seeds: Iterable[int], schedule: Callable[[int, Path], Tally] = simulate
) -> Tally:
    """Go through the schedules of seeds; return what happened in all.

    Raises:
        SystemExit: A schedule went wrong; the text names its seed, says what happened
            and how to see it again.
    """
    total = Tally()
    for seed in seeds:
        with tempfile.TemporaryDirectory(prefix="simulate-") as folder:
            try:
                total.add(schedule(seed, Path(folder)))
            except Exception:  # noqa: BLE001 - whatever it is, the schedule has found it
                again = f"tools/simulate --only {seed}"
                text = f"{traceback.format_exc()}\nseed {seed} fails; again: {again}"
                sys.exit(text)
    return total


def main(arguments: list[str] | None = None) -> int:
    """Simulate as the command line says; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--schedules", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0, help="of the first schedule")
    parser.add_argument("--only", type=int, help="the one seed to go through")
    given = parser.parse_args(arguments)
    seeds = range(given.seed, given.seed + given.schedules)
    began = time.perf_counter()
    total = simulated(seeds if given.only is None else [given.only])
    for name in total.__struct_fields__:
        print(f"{name.replace('_', ' '):<12}{getattr(total, name):>14,}")
    print(f"{'seconds':<12}{time.perf_counter() - began:>14,.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
