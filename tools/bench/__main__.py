#!/usr/bin/env python3
"""Measure what docs/measurements.md says of speed, all in one run.

Ours and what it is compared with are measured in turns, everything is warm before the
clock starts, and the best of the repeats or the median counts: what else runs on the
machine only ever adds to a time. Not so plain numpy in the row `cycle`: it
takes so much longer that it is timed once, in one block. Each row is printed as soon as
it is there; one that cannot be measured says why, and the others are measured. Nothing
is judged: a mark says whether it came out as hoped, and the exit code is 0 either way.
"""

import argparse
import json
import sys
from importlib import import_module
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rich.console import Console

from tools.bench.report import (
    QUICK,
    Line,
    Sizes,
    as_json,
    markdown,
    markdown_head,
    table,
)

ROWS = {
    "spawn": "swarm",
    "hop": "swarm",
    "line": "swarm",
    "wave": "wave",
    "recording": "run",
    "observe": "observe",
    "lazy": "lazy",
    "cycle": "agent",
    "growth": "growth",
    "tick": "tick",
    "worker": "worker",
    "kinds": "kinds",
    "coordinator": "coordinator",
    "scale": "scale",
    "verify": "run",
    "page": "page",
    "seek": "seek",
}
"""The module that measures a row, in a function of the row's name."""


def main(arguments: list[str] | None = None) -> None:
    """Measure the rows asked for and print each when it is there."""
    given = _parser().parse_args(arguments)
    sizes = QUICK if given.quick else Sizes()
    # Of two outputs, the one for programs is alone on stdout's last line.
    waiting = Console(stderr=True)
    # Into a file or a pipe as wide as it is.
    console = Console(width=None if sys.stdout.isatty() else 160)
    if given.markdown:
        print(markdown_head())
    rows: dict[str, list[Line]] = {}
    for name in given.only:
        with waiting.status(name):
            rows[name] = measure(name, sizes)
        if given.markdown:
            print(markdown(rows[name]), flush=True)
        else:
            console.print(table(rows[name], head=len(rows) == 1))
            sys.stdout.flush()
    if given.json:
        print(json.dumps(as_json(rows)))


def measure(name: str, sizes: Sizes) -> list[Line]:
    """Return the lines of a row, or one that says why it cannot be measured."""
    try:
        module = import_module(f"tools.bench.{ROWS[name]}")
        lines: list[Line] = getattr(module, name)(sizes)
    except Exception as error:  # noqa: BLE001 - whatever it is, other rows stand alone
        return [Line(name, f"not measured: {_reason(error)}")]
    return lines


def _reason(error: Exception) -> str:
    """Return what went wrong, in a line."""
    while isinstance(error, ExceptionGroup):
        error = error.exceptions[0]
    return str(error).partition("\n")[0] or type(error).__name__


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
