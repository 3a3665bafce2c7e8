#!/usr/bin/env python3
"""Measure what the README says of speed, all in one run.

Ours and what it is compared with are measured in turns, everything is warm before the
clock starts, and the best of the repeats or the median counts: what else runs on the
machine only ever adds to a time. Not so plain numpy in the rows `cycle` and `learn`: it
takes so much longer that it is timed once, in one block. Nothing is judged: a mark says
whether it came out as hoped, and the exit code is 0 either way.
"""

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

# Run as a file, the folder of this file is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from rich.console import Console

from tools import (
    bench_agent,
    bench_learn,
    bench_observe,
    bench_page,
    bench_run,
    bench_swarm,
    bench_tick,
    bench_worker,
)
from tools.bench_report import QUICK, Line, Sizes, as_json, markdown, table

ROWS: dict[str, Callable[[Sizes], list[Line]]] = {
    "spawn": bench_swarm.spawn,
    "hop": bench_swarm.hop,
    "line": bench_swarm.line,
    "recording": bench_run.recording,
    "observe": bench_observe.observe,
    "learn": bench_learn.learn,
    "cycle": bench_agent.cycle,
    "tick": bench_tick.tick,
    "worker": bench_worker.worker,
    "verify": bench_run.verify,
    "page": bench_page.page,
}


def main(arguments: list[str] | None = None) -> None:
    """Measure the rows asked for and print them."""
    given = _parser().parse_args(arguments)
    sizes = QUICK if given.quick else Sizes()
    # Of two outputs, the one for programs is alone on stdout's last line.
    console = Console(stderr=True)
    rows = {}
    for name in given.only:
        with console.status(name):
            rows[name] = ROWS[name](sizes)
    lines = [line for name in given.only for line in rows[name]]
    if given.markdown:
        print(markdown(lines))
    else:
        # Into a file or a pipe as wide as it is.
        width = None if sys.stdout.isatty() else 160
        Console(width=width).print(table(lines))
    if given.json:
        print(json.dumps(as_json(rows)))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bench", description="Measure the speed of everything that counts."
    )
    parser.add_argument(
        "--only",
        type=_names,
        default=tuple(ROWS),
        metavar="A,B",
        help=f"rows to measure, of {', '.join(ROWS)}",
    )
    parser.add_argument("--quick", action="store_true", help="small sizes, to try it")
    parser.add_argument("--json", action="store_true", help="one object, last")
    parser.add_argument("--markdown", action="store_true", help="a Markdown table")
    return parser


def _names(text: str) -> tuple[str, ...]:
    """Return the rows that are named, in the table's order."""
    named = {name.strip() for name in text.split(",")}
    if unknown := sorted(named - set(ROWS)):
        raise argparse.ArgumentTypeError(
            f"must be of {', '.join(ROWS)}, got {', '.join(unknown)}"
        )
    return tuple(name for name in ROWS if name in named)


if __name__ == "__main__":
    main()
