#!/usr/bin/env python3
"""Fuzzes everything that reads external input; exit code 1 on a failure.

    tools/fuzz [--inputs 1000000] [--seed 1] [--minutes 15]
                  [--only decode,cell,worker,coordinator,recording,disk,bag]

Valid input (from the messages' own types, and from a small recorded run) is damaged in
ways that respect its structure, and for each target it must hold that

- what comes out is a message, a `Fault` that others can read, or an error of ours, and
  comes out soon;
- what was rejected, and what only came again, changed nothing: next to a twin that got
  the honest input alone, the target goes on saying the same;
- memory does not grow with the inputs.

What is accepted may change a core: one that was meddled with by a message it cannot
tell from a true one is replaced by a copy of its twin. Work is done in rounds, each a
function of the seed, the target and the round's number, so a failure is made again with
what is printed: ``--seed S --only TARGET --round R``.
"""

import argparse
import random
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import psutil

from tools.fuzz.disk import disk_target
from tools.fuzz.run import WORKERS, honest_run
from tools.fuzz.targets import (
    Count,
    FuzzError,
    Target,
    bag,
    cell,
    coordinator,
    decode,
    recording,
    worker,
)

_GROWTH = 128 * 2**20  # bytes a target may grow by
_SHOWN = 2000  # characters of an input that failed

TARGETS: dict[str, tuple[float, Callable[[Path], Target]]] = {
    "decode": (0.5, lambda folder: partial(decode, honest_run(folder))),
    "cell": (0.2, lambda folder: partial(cell, honest_run(folder))),
    "coordinator": (
        0.12,
        lambda folder: partial(
            coordinator, [honest_run(folder), honest_run(folder, WORKERS)]
        ),
    ),
    "recording": (0.03, lambda folder: partial(recording, honest_run(folder), folder)),
    "bag": (0.01, lambda folder: partial(bag, folder)),
    "worker": (0.2, lambda folder: partial(worker, honest_run(folder, WORKERS))),
    "disk": (0.002, lambda folder: disk_target(honest_run(folder, ticks=60), folder)),
}
"""The share of the inputs of each target, and how it is made in a folder of its own."""


def rounds(
    name: str, target: Target, seed: int, first: int = 0
) -> Iterator[tuple[int, Count]]:
    """Run round after round; yield each one's number and the count so far.

    Raises:
        FuzzError: An invariant does not hold; the text says how to make it again.
    """
    process, count = psutil.Process(), Count()
    base = None
    index = first
    while True:
        began = time.perf_counter()
        try:
            target(random.Random(f"{seed}/{name}/{index}"), count)
        except Exception as error:
            again = f"--seed {seed} --only {name} --round {index}"
            shown = f"{type(error).__name__}: {error}"
            text = f"{name}: {shown}\nagain: {again}\ninput: {count.last!r:.{_SHOWN}}"
            raise FuzzError(text) from error
        count.seconds += time.perf_counter() - began
        resident = process.memory_info().rss
        base = base or resident  # what the first round loads is not growth
        count.grown = max(count.grown, resident - base)
        if count.grown > _GROWTH:
            raise FuzzError(f"{name}: grew by {count.grown >> 20} MiB by round {index}")
        yield index, count
        index += 1


def fuzz(
    only: Sequence[str], inputs: int, seed: int, minutes: float, first: int | None
) -> dict[str, Count]:
    """Give each target its part of `inputs`, or until `minutes` are over.

    Args:
        only: Names of targets.
        inputs: For all together.
        seed: What is drawn is a function of it.
        minutes: For all together.
        first: A round to run alone; None: all from 0.

    Raises:
        FuzzError: An invariant does not hold.
    """
    ends = time.monotonic() + 60 * minutes
    all_shares = sum(TARGETS[name][0] for name in only)
    counts: dict[str, Count] = {}
    for name in only:
        share, make = TARGETS[name]
        wanted = inputs * share / all_shares
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            target = make(Path(folder))
            for _, count in rounds(name, target, seed, first or 0):
                counts[name] = count
                over = time.monotonic() > ends
                if count.inputs >= wanted or over or first is not None:
                    break
    return counts


def main() -> int:
    """Fuzz as the command line says; return the exit code."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--minutes", type=float, default=15.0)
    parser.add_argument("--only", default=",".join(TARGETS))
    parser.add_argument("--round", type=int, default=None)
    given = parser.parse_args()
    only = given.only.split(",")
    if unknown := set(only) - TARGETS.keys():
        parser.error(f"--only: must be of {', '.join(TARGETS)}, got {min(unknown)}")
    try:
        counts = fuzz(only, given.inputs, given.seed, given.minutes, given.round)
    except FuzzError as error:
        print(error, file=sys.stderr)
        return 1
    for name, count in counts.items():
        rate = count.inputs / max(count.seconds, 1e-9)
        print(
            f"{name:<12} {count.inputs:,} inputs, {rate:,.0f} a second,"
            f" {count.rejected:,} rejected, slowest {count.slowest * 1e3:.1f} ms,"
            f" grew {count.grown >> 20} MiB"
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak {peak:,.0f} MiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
