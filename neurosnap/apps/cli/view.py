"""``neurosnap view``: opens the page for a recording or a running swarm."""

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
        str | None,
        typer.Argument(
            metavar="LOG|SWARM",
            help="A recording (.mcap); with --live the id of a swarm that runs here.",
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option(
            "--live", metavar=FLAG, help="Follow a swarm that runs on this machine."
        ),
    ] = False,
    port: Annotated[
        int,
        typer.Option(
            help="The port of the page, on this machine only. 0: any that is free."
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
    """Show a recording, or a swarm while it runs, in the browser."""
    with errors():
        log = _followed(what) if live else _named(what)
        run_async(
            lambda stop: look(log, stop, port=port, browser=browser, as_json=as_json)
        )


def _named(what: str | None) -> Path:
    """Return the recording that was named.

    Raises:
        InvalidValueError: None was.
    """
    if what is None:
        raise InvalidValueError("log", "must be given, or --live", "nothing")
    return Path(what)


def _followed(swarm: str | None) -> Path:
    """Return where a swarm of this machine is recorded.

    Args:
        swarm: Its id; None: the only one.

    Raises:
        InvalidValueError: There is none, or more than one, or it is not recorded.
    """
    from neurosnap.runtime.registry import find, only

    note = only() if swarm is None else find(swarm)
    if not note.log:
        rule = "must be recorded to be looked at"
        raise InvalidValueError("swarm", rule, note.swarm)
    return Path(note.log)
