"""``neurosnap export``: converts a recording for other programs."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import FLAG
from neurosnap.apps.cli.shared import (
    LOST,
    Json,
    Log,
    OptionalTick,
    app,
    errors,
    print_json,
    say,
    screen,
)
from neurosnap.apps.cli.stopping import unwinding


@app.command()
def export(
    log: Log,
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="Csv or parquet: a table with a row for each tick. Graphml: the"
            " implications that were learned.",
        ),
    ] = "csv",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Where to write; must not exist yet.",
            show_default="beside the recording",
        ),
    ] = None,
    at: OptionalTick = None,
    only_readings: Annotated[
        bool,
        typer.Option(
            "--only-readings",
            metavar=FLAG,
            help="With csv: the time and the sensors only, a file that `neurosnap run`"
            " takes.",
        ),
    ] = False,
    force: Annotated[
        bool,
        typer.Option("--force", metavar=FLAG, help="Replace the file that is there."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Convert a recording to a table or a graph."""
    from neurosnap.apps.export.write import export as write
    from neurosnap.apps.export.write import parse_form

    with errors():
        with unwinding():
            exported = write(
                log,
                parse_form(form),
                out,
                at=at,
                only_readings=only_readings,
                force=force,
            )
        say(as_json).print(f"wrote {exported.path}", markup=False, soft_wrap=True)
        if exported.incomplete:
            say(as_json).print(f"{exported.incomplete} ticks lack something")
        if not exported.whole:
            for line in exported.damage:
                screen.print(f"damaged: {line}", markup=False, soft_wrap=True)
            screen.print("the recording is not whole: wrote what there is")
        if as_json:
            print_json(msgspec.to_builtins(exported))
        if not exported.whole:
            raise typer.Exit(LOST)
