"""``neurosnap depth``: measures the depth of waves against the height of the order."""

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli.options import CELLS, HOSTS, option
from neurosnap.apps.cli.shared import (
    Json,
    app,
    end_by,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.apps.cli.stopping import unwinding
from neurosnap.errors import (
    InvalidValueError,
    MissingExtraError,
    NeurosnapError,
    NothingBegunError,
)
from neurosnap.protocol.run_options import HostKind, WiringKind


@app.command()
def depth(
    log: Annotated[
        Path | None,
        typer.Argument(
            metavar="[LOG]",
            help="Measure the waves in this recording, and start no swarm.",
        ),
    ] = None,
    heights: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="How long the chains of implications are, one after another.",
        ),
    ] = "1,2,4,8,16,32,64",
    wiring: WiringKind = option("wiring"),
    sensors: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="How many sensors the swarms have, one after another.",
            show_default="what the longest chain takes, and twice as many",
        ),
    ] = "",
    waves: Annotated[
        int, typer.Option(help="How many waves to start at each height.")
    ] = 10,
    cells: Annotated[
        HostKind, typer.Option(rich_help_panel=CELLS, help=HOSTS)
    ] = "process",
    workers: Annotated[
        int,
        typer.Option(
            min=1,
            rich_help_panel=CELLS,
            help="With cells in workers: how many processes share them.",
        ),
    ] = 2,
    edges: Annotated[
        int,
        typer.Option(
            help="Measure random orders with so many implications instead of chains.",
            show_default="0: chains",
        ),
    ] = 0,
    seed: int = option("seed", "Seed of the random orders."),
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR",
            help="The folder for depth.csv and its picture, as .png, .svg and .pdf.",
        ),
    ] = Path(),
    as_json: Json = False,
) -> None:
    """Measure how far a wave of messages travels, and how long that takes.

    Starts swarms whose implications form chains; writes a table and a picture.
    """
    from neurosnap.apps.cli import output
    from neurosnap.depth.measure import draw, fit, from_recording, measure, write_csv
    from neurosnap.depth.probe import Measured
    from neurosnap.recording.read.recording import Recording

    with errors():
        tall = _numbers("heights", heights)
        sizes = _numbers("sensors", sensors) if sensors else _sizes(tall)
        recording = None if log is None else Recording.open(log)
        if recording is not None:
            rows = from_recording(recording)
        else:
            total = len(sizes) * len(tall) * waves
            with output.progress(screen, "waves", total) as on_progress:

                async def work(stop: asyncio.Event) -> list[Measured]:
                    found = await measure(
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
                    if not found and stop.is_set():
                        rule = "must measure a wave, was asked to end first"
                        raise NothingBegunError(f"depth: {rule}")
                    return found

                rows = run_async(work)
        if not rows:
            raise NeurosnapError("depth: must have a wave to measure, got none")
        out.mkdir(parents=True, exist_ok=True)
        wrote = [out / "depth.csv"]
        with unwinding():
            write_csv(rows, wrote[0])
            try:
                wrote += draw(rows, out)
            except MissingExtraError as error:
                screen.print(f"no picture: {error}", markup=False, soft_wrap=True)
        line = fit(rows)
        output.depths(say(as_json), rows, line, wrote)
        if as_json:
            print_json(output.depth_facts(rows, line, wrote))
        if recording is not None:
            end_by(recording)


def _numbers(name: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidValueError(name, "must be whole numbers", text) from error


def _sizes(heights: tuple[int, ...]) -> tuple[int, ...]:
    """Return two swarm sizes: if only height counts, both take as long."""
    least = max(heights) + 1
    return (least, 2 * least)
