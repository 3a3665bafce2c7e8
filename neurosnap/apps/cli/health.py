"""``neurosnap health``: which sensors of a home seem broken, in readings there are."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.shared import Json, app, errors, print_json, say

_EXAMPLE = "Example: neurosnap health home-assistant_v2.db --alarms 1/month"


@app.command(epilog=_EXAMPLE)
def health(
    data: Annotated[
        Path,
        typer.Argument(
            metavar="DATA",
            help="A table of readings or a log of events (.csv, .parquet), a database of"
            " Home Assistant, or the intervals of a home (.sensors); with times.",
        ),
    ],
    alarms: Annotated[
        str,
        typer.Option(
            metavar="N/TIME",
            help="How many alarms the home may raise while nothing is wrong, such as"
            " 1/week or 2/month.",
        ),
    ] = "1/week",
    as_json: Json = False,
) -> None:
    """Tell which sensors of a home seem broken, since when, and why."""
    from neurosnap.apps.health_log import follow
    from neurosnap.sources.tables.open_readings import open_readings

    with errors():
        found = follow(open_readings(str(data)), alarms)
        console = say(as_json)
        for line in found.lines():
            console.print(line, markup=False, soft_wrap=True)
        if as_json:
            print_json(msgspec.to_builtins(found))
