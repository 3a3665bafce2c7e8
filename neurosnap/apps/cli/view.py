"""``neurosnap view``: opens the page for recordings or running swarms."""

from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli.options import FLAG
from neurosnap.apps.cli.page import look
from neurosnap.apps.cli.shared import app, errors, run_async
from neurosnap.errors import InvalidValueError


@app.command()
def view(
    what: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="LOG|SWARM...",
            help="Recordings (.mcap), one or more to compare; with --live the ids of"
            " swarms that run here.",
            show_default="all that run here, with --live",
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", metavar=FLAG, help="Follow swarms that run on this machine."
        ),
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            help="The port of the page, on this machine only. 0: that of the page"
            " before, or any that is free."
        ),
    ] = 0,
    browser: Annotated[
        bool, typer.Option(metavar=FLAG, help="Open the browser.")
    ] = True,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json",
            metavar=FLAG,
            help="Print the address of the page as a JSON object.",
        ),
    ] = False,
) -> None:
    """Show recordings, or swarms while they run, in the browser."""
    with errors():
        logs = _followed(what or []) if live else _named(what or [])
        run_async(
            lambda stop: look(logs, stop, port=port, browser=browser, as_json=as_json)
        )


def _named(given: list[str]) -> list[Path]:
    """Return the recordings that were named.

    Raises:
        InvalidValueError: None was.
    """
    if not given:
        raise InvalidValueError("log", "must be given, or --live", "nothing")
    return [Path(each) for each in given]


def _followed(given: list[str]) -> list[Path]:
    """Return where swarms of this machine are recorded.

    Args:
        given: Their ids; empty: all there are.

    Raises:
        InvalidValueError: There is none, or one is not recorded.
    """
    from neurosnap.runtime.registry import find, swarms

    notes = [find(each) for each in given] if given else swarms()
    if not notes:
        raise InvalidValueError("swarm", "must run on this machine", "none")
    for note in notes:
        if not note.log:
            rule = "must be recorded to be looked at"
            raise InvalidValueError("swarm", rule, note.swarm)
    return [Path(note.log) for note in notes]
