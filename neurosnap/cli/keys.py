"""``neurosnap keys``: make the keys that a swarm on a network needs."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.cli.shared import Json, app, errors, print_json, say


@app.command()
def keys(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where; must not exist yet.")
    ],
    host: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="The hub is reached under this, too."),
    ] = None,
    days: Annotated[int, typer.Option(help="How long they are valid.")] = 365,
    as_json: Json = False,
) -> None:
    """Make a private authority and a certificate a role, for --tls."""
    from neurosnap.fabric.keys import make_keys

    with errors():
        made = make_keys(folder, host or (), days=days)
        for line in (
            f"keys for {', '.join(made.roles)} in {made.folder}",
            f"the hub is {', '.join(made.hosts)}; valid until {made.until:%F}",
            "another machine needs ca.pem and its role's .pem and .key, never ca.key",
        ):
            say(as_json).print(line, markup=False, soft_wrap=True)
        if as_json:
            print_json(msgspec.to_builtins(made))
