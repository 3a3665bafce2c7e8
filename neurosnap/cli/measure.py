"""Verbs that measure: the depth of waves, and the paper's experiments."""

import asyncio
import os
from pathlib import Path
from typing import Annotated

import typer

from neurosnap.cli.heeding import unwinding
from neurosnap.cli.shared import (
    LOST,
    Json,
    app,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError, MissingExtraError, NeurosnapError
from neurosnap.experiment.learning import TruthKind
from neurosnap.swarm.options import HostKind, WiringKind


@app.command()
def depth(
    log: Annotated[
        Path | None,
        typer.Argument(metavar="[LOG]", help="Measure this recording instead."),
    ] = None,
    heights: Annotated[
        str, typer.Option(help="Heights of the chains, with commas.")
    ] = "1,2,4,8,16,32,64",
    wiring: Annotated[
        WiringKind, typer.Option(help="Which edges carry pulses.")
    ] = "hasse",
    sensors: Annotated[
        str,
        typer.Option(help="Cells in each swarm. \\[default: 1 and 2 × the tallest]"),
    ] = "",
    waves: Annotated[int, typer.Option(help="Waves at each height.")] = 10,
    cells: Annotated[
        HostKind, typer.Option(help="One OS process a cell, or one for many.")
    ] = "process",
    workers: Annotated[int, typer.Option(help="Processes that have many cells.")] = 2,
    edges: Annotated[
        int,
        typer.Option(help="Covers of a random order, both ways. \\[default: a chain]"),
    ] = 0,
    seed: Annotated[int, typer.Option(help="Draws random orders.")] = 0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write.")] = Path(),
    as_json: Json = False,
) -> None:
    """Measure how deep waves travel against the height of the order."""
    from neurosnap import show
    from neurosnap.depth import draw, fit, from_recording, measure, write_csv
    from neurosnap.record.whole import open_whole

    with errors():
        tall = _numbers("heights", heights)
        sizes = _numbers("sensors", sensors) if sensors else _sizes(tall)
        if log is not None:
            rows = from_recording(open_whole(log))
        else:
            total = len(sizes) * len(tall) * waves
            with show.progress(screen, "waves", total) as on_progress:
                rows = run_async(
                    lambda stop: measure(
                        tall,
                        wiring,
                        sizes,
                        waves,
                        stop,
                        on_progress,
                        cells=cells,
                        workers=workers,
                        edges=edges,
                        seed=seed,
                    )
                )
        if not rows:
            raise NeurosnapError("depth: must have a wave to measure, got none")
        out.mkdir(parents=True, exist_ok=True)
        wrote = [out / "depth.csv"]
        with unwinding():
            write_csv(rows, wrote[0])
            try:
                draw(rows, out / "depth.png")
                wrote.append(out / "depth.png")
            except MissingExtraError as error:
                screen.print(f"no picture: {error}", markup=False, soft_wrap=True)
        line = fit(rows)
        show.depths(say(as_json), rows, line, wrote)
        if as_json:
            print_json(show.depth_facts(rows, line, wrote))


@app.command()
def figures(
    only: Annotated[
        str, typer.Option(metavar="A,B", help="By name or number. \\[default: all]")
    ] = "",
    runs: Annotated[int, typer.Option(help="Runs of everything.")] = 50,
    steps: Annotated[int, typer.Option(help="Observations in each.")] = 8000,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where to write.")] = Path(
        "figures"
    ),
    seed: Annotated[int, typer.Option(help="Draws all that is random.")] = 0,
    truth: Annotated[
        TruthKind, typer.Option(help="What learned graphs are compared with.")
    ] = "contained",
    equivalences: Annotated[
        bool, typer.Option(help="Let learned graphs have equivalences.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(help="Threads. \\[default: one a core]")
    ] = None,
    as_json: Json = False,
) -> None:
    """Make the paper's experiments again: pictures, data, and what agrees.

    Finished cells are kept in DIR/cells: interrupted, the same command goes on.
    """
    from neurosnap import show
    from neurosnap.experiment.figure import FigureOptions
    from neurosnap.experiment.run import run_figures

    with errors():
        options = FigureOptions(
            only=tuple(name.strip() for name in only.split(",") if name.strip()),
            runs=runs,
            steps=steps,
            out=out,
            seed=seed,
            truth=truth,
            equivalences=equivalences,
            workers=(os.cpu_count() or 1) if workers is None else workers,
        )
        with show.progress(screen, "runs", None) as on_progress:
            results = run_async(
                lambda stop: asyncio.to_thread(
                    run_figures, options, on_progress, stop.is_set
                )
            )
        show.figures(say(as_json), results)
        if as_json:
            print_json(show.figure_facts(results))
        if results.missing:
            raise typer.Exit(LOST)


def _numbers(name: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidValueError(name, "must be whole numbers", text) from error


def _sizes(heights: tuple[int, ...]) -> tuple[int, ...]:
    """Return two swarm sizes: if only height counts, both take as long."""
    least = max(heights) + 1
    return (least, 2 * least)
