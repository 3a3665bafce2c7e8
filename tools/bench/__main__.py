#!/usr/bin/env python3
"""Measures the speeds in docs/measurements.md, all in one run.

Two sides of a comparison are measured in turns, everything is warm before the clock
starts, and the best of the repeats or the median counts: what else runs on the machine
only ever adds to a time. Each row is printed as soon as it is measured, as lines of a
Markdown table. If a row cannot be measured, it says why, and the others are measured.
A mark says whether a row came out as hoped; the exit code is 0 either way.
"""

import argparse
import json
import os
import platform
import sys
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rich.console import Console

from tools.bench.report import HEAD, QUICK, Line, Sizes, markdown

ROWS = {
    "start": ("start", "the help, the version, and a first run beside a later one"),
    "spawn": ("swarm", "from the hub's start until every cell is wired; memory a cell"),
    "hop": ("swarm", "one hop of a wave along a chain, against bare Zenoh"),
    "tick": ("tick", "a tick of process cells, against bare Zenoh that sends as much"),
    "recording": ("run", "a tick with the recorder and without"),
    "observe": ("observe", "an observation of a snapshot in this process"),
    "growth": ("observe", "a decision while exploring Taxi, in this process"),
    "kinds": ("run", "ticks a second of the same run with each kind of cells"),
    "scale": ("scale", "processor time of each part, and a model of other sizes"),
    "large": ("scale", "ticks a second and memory of runs of many sensors"),
    "verify": ("run", "verify of a recording, against the run that made it"),
    "messages": ("messages", "messages of other programs (MCAP), read and cut"),
    "live": ("messages", "messages of ROS 2 by their type, in a live run"),
    "mqtt": ("field", "2,000 readings a second by MQTT, one a message"),
    "stdin": ("field", "so by standard input, each of one sensor"),
    "zenoh": ("field", "so over Zenoh"),
    "ros2": ("field", "so by messages of ROS 2"),
    "bag": ("messages", "the memory that a large bag takes"),
    "page": ("page", "ticks a second that the page shows"),
    "seek": ("page", "a far tick on the page"),
}
"""Each row's module, which has a function of the row's name, and what it times."""


def main(arguments: list[str] | None = None) -> None:
    """Measure the rows asked for and print each as soon as it is measured."""
    parser = argparse.ArgumentParser(
        prog="bench",
        description="Measure speed; print a Markdown table.",
        epilog="\n".join(f"  {name:12} {what}" for name, (_, what) in ROWS.items()),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--only", nargs="+", choices=ROWS, default=tuple(ROWS), help="rows to measure"
    )
    parser.add_argument("--quick", action="store_true", help="small sizes, as a trial")
    parser.add_argument(
        "--field", type=float, help="seconds that the field rows send for, each"
    )
    parser.add_argument("--json", action="store_true", help="add one object, last")
    given = parser.parse_args(arguments)
    # The table alone goes to stdout.
    waiting = Console(stderr=True)
    sizes = QUICK if given.quick else Sizes()
    sizes = replace(sizes, field=given.field or sizes.field)
    print(f"{markdown(HEAD)}\n{markdown(('---',) * len(HEAD))}")
    rows: dict[str, list[Line]] = {}
    for name in given.only:
        with waiting.status(name):
            rows[name] = measure(name, sizes)
        for line in rows[name]:
            print(markdown(line.cells()), flush=True)
    if given.json:
        print(json.dumps({"machine": _machine(), "rows": rows}, default=asdict))


def measure(name: str, sizes: Sizes) -> list[Line]:
    """Return the lines of a row, or one that says why it cannot be measured."""
    try:
        module = import_module(f"tools.bench.{ROWS[name][0]}")
        lines: list[Line] = getattr(module, name)(sizes)
    except Exception as error:  # noqa: BLE001 - whatever it is, other rows stand alone
        return [Line(name, f"not measured: {_reason(error)}")]
    return lines


def _reason(error: Exception) -> str:
    """Return what went wrong, in a line."""
    while isinstance(error, ExceptionGroup):
        error = error.exceptions[0]
    return str(error).partition("\n")[0] or type(error).__name__


def _machine() -> dict[str, object]:
    return {
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "platform": platform.platform(),
        "python": platform.python_version(),
    }


if __name__ == "__main__":
    main()
