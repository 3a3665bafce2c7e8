#!/usr/bin/env python3
"""Repeat the paper's experiments.

    tools/paper [--only learning-empirical,growth] [--runs 2 --steps 200]

This writes pictures, data, and whether the paper's claims hold. What is finished
is kept in DIR/cells: after Ctrl-C the same command goes on. With fewer --runs and
--steps it takes less time, and proves less.
"""

import argparse
import os
import sys
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from neurosnap.errors import NeurosnapError
from tools.paper.figure import STEPS, FigureOptions
from tools.paper.run import FIGURES, run_figures


def main(arguments: list[str] | None = None) -> int:
    """Do what is asked for; return the exit code."""
    given = _parser().parse_args(arguments)
    try:
        _figures(given)
    except (NeurosnapError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _figures(given: argparse.Namespace) -> None:
    options = FigureOptions(
        only=tuple(filter(None, given.only.split(","))),
        runs=given.runs,
        steps=given.steps,
        seed=given.seed,
        truth=given.truth,
        workers=given.workers,
        homes=given.homes,
        alarms=given.alarms,
        out=given.out,
    )

    def on_progress(done: int, total: int) -> None:
        if sys.stderr.isatty():
            print(f"\r{done} of {total} runs ", end="", file=sys.stderr)

    for result in run_figures(options, on_progress):
        print(f"\n{result.title}: {', '.join(map(str, result.files))}")
        for line in result.lines:
            print(f"  {line}")
        for claim in result.claims:
            print(f"  {claim.verdict}: {claim.says} ({claim.numbers})")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tools/paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("--only", default="", metavar="A,B", help=f"of {', '.join(FIGURES)}")
    add("--runs", type=int, default=50, help="runs of each experiment")
    add("--steps", type=int, default=STEPS, help="observations in each run")
    add("--seed", type=int, default=0, help="seed of all random numbers")
    add(
        "--truth",
        choices=("contained", "thresholded"),
        default="contained",
        help="compare with what holds everywhere in the world, or with what an endless"
        " walk would learn",
    )
    add("--homes", type=Path, metavar="DIR", help="a folder of recorded homes")
    add("--alarms", default="1/week", help="the budget of alarms in these homes")
    add("--workers", type=int, default=os.cpu_count() or 1, help="processes")
    add("--out", type=Path, default=Path("figures"), metavar="DIR")
    return parser


if __name__ == "__main__":
    sys.exit(main())
