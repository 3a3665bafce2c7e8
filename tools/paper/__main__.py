#!/usr/bin/env python3
"""Repeat the paper's experiments, or draw one of its model spaces.

    tools/paper figures [--only learning-empirical,growth] [--runs 2 --steps 200]
    tools/paper model six-arcs --out arcs.png

`figures` writes pictures, data, and whether the paper's claims hold. What is finished
is kept in DIR/cells: after Ctrl-C the same command goes on. With fewer --runs and
--steps it takes less time, and proves less.

`model` draws a poc set (an order on sensors) and its dual (the space of their states):
one of the paper's, what a recording holds, or sensors and the implications between them
("a, b : a < b*").
"""

import argparse
import os
import sys
from pathlib import Path

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from neurosnap.errors import NeurosnapError
from neurosnap.system.durable import replace_file
from neurosnap.system.picture import KINDS, encoded
from tools.paper.figure import STEPS, FigureOptions
from tools.paper.model import LIMIT, find
from tools.paper.model_picture import picture
from tools.paper.run import FIGURES, run_figures
from tools.paper.spaces import EXAMPLES


def main(arguments: list[str] | None = None) -> int:
    """Do what is asked for; return the exit code."""
    given = _parser().parse_args(arguments)
    try:
        (_figures if given.verb == "figures" else _model)(given)
    except (NeurosnapError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _figures(given: argparse.Namespace) -> None:
    options = FigureOptions(
        only=_names(given.only),
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


def _model(given: argparse.Namespace) -> None:
    found = find(given.what, given.at, given.limit, _names(given.only))
    print(found.title, *found.measures(), sep="\n")
    if given.out is not None:
        figure = picture(found)
        replace_file(given.out, encoded(figure, given.out.suffix[1:].lower(), 120))
        print(f"wrote {given.out}")


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(",") if name.strip())


def _picture_file(text: str) -> Path:
    path = Path(text)
    if path.suffix[1:].lower() not in KINDS:
        raise argparse.ArgumentTypeError(f"must end in .{', .'.join(KINDS)}")
    return path


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="tools/paper",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    verbs = parser.add_subparsers(dest="verb", required=True)
    figures = verbs.add_parser("figures", help="repeat the experiments")
    add = figures.add_argument
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
    model = verbs.add_parser("model", help="draw a poc set and its dual")
    add = model.add_argument
    add("what", metavar="NAME|LOG|EXPR", help=f"names: {', '.join(EXAMPLES)}")
    add("--out", type=_picture_file, help="a .png, .svg or .pdf; replaced")
    add("--at", type=int, metavar="TICK", help="of a recording: after this tick")
    add("--limit", type=int, default=LIMIT, help="list no more vertices than this")
    add("--only", default="", metavar="A,B", help="keep these sensors only")
    return parser


if __name__ == "__main__":
    sys.exit(main())
