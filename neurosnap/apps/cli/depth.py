"""``neurosnap depth``: how far waves of messages travel, and how long that takes."""

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli import output
from neurosnap.apps.cli.options import options_of, with_parameters
from neurosnap.apps.cli.shared import (
    RECORDINGS,
    Force,
    Format,
    app,
    end_by,
    errors,
    people,
    print_facts,
    run_async,
    screen,
    unwinding,
)
from neurosnap.depth.measure import Sweep
from neurosnap.depth.probe import Measured
from neurosnap.errors import InvalidValueError, NeurosnapError, NothingBegunError

_SWEEP = options_of(Sweep)
Out = Annotated[
    Path,
    typer.Option(
        "--out",
        "-o",
        metavar="DIR",
        help="The folder for depth.csv and its picture, as .png, .svg and .pdf.",
    ),
]


@app.command(rich_help_panel=RECORDINGS)
@with_parameters(**{name: (o.kind, o.parameter(name)) for name, o in _SWEEP.items()})
def depth(
    context: typer.Context,
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
    sensors: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="How many sensors the swarms have, one after another.",
            show_default="what the longest chain takes, and twice as many",
        ),
    ] = "",
    out: Out = Path(),
    force: Force = False,
    form: Format = "text",
) -> None:
    """Measure how far a wave of messages travels, and how long that takes.

    Starts swarms whose implications form chains; writes a table and a picture.
    """
    from neurosnap.depth.measure import fit, from_recording, write_all
    from neurosnap.recording.read.recording import Recording

    with errors():
        given = {name: context.params[name] for name in _SWEEP}
        tall, sizes = _numbers("heights", heights), _numbers("sensors", sensors or "0")
        sweep = Sweep(heights=tall, sensors=sizes if sensors else (), **given)
        recording = None if log is None else Recording.open(log)
        if (table := out / "depth.csv").exists() and not force:
            rule = "must not exist yet, or come with --force"
            raise InvalidValueError("out", rule, str(table))
        rows = _swept(sweep) if recording is None else from_recording(recording)
        if not rows:
            raise NeurosnapError("depth: must have a wave to measure, got none")
        out.mkdir(parents=True, exist_ok=True)
        with unwinding():
            wrote, lacking = write_all(rows, out)
        if lacking:
            screen.print(f"no picture: {lacking}", markup=False, soft_wrap=True)
        line = fit(rows)
        output.depths(people(form), rows, line, wrote)
        print_facts(form, output.depth_facts(rows, line, wrote))
        if recording is not None:
            end_by(recording)


def _swept(sweep: Sweep) -> list[Measured]:
    """Start the swarms, and return what was measured."""
    from neurosnap.depth.measure import measure

    with output.progress(screen, "waves", sweep.total) as on_progress:

        async def work(stop: asyncio.Event) -> list[Measured]:
            found = await measure(sweep, stop, on_progress)
            if not found and stop.is_set():
                rule = "must measure a wave, was asked to end first"
                raise NothingBegunError(f"depth: {rule}")
            return found

        return run_async(work)


def _numbers(name: str, text: str) -> tuple[int, ...]:
    try:
        return tuple(int(part) for part in text.split(","))
    except ValueError as error:
        raise InvalidValueError(name, "must be whole numbers", text) from error
