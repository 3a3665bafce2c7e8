"""``neurosnap keys``: makes or revokes the certificates of a swarm."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.shared import Json, app, errors, print_json, ranges, say
from neurosnap.errors import InvalidValueError


@app.command()
def keys(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="DIR",
            help="The folder to make them in; must not exist yet, but with --revoke.",
        ),
    ],
    host: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="A name or address under which other machines reach the hub. May be"
            " repeated.",
        ),
    ] = None,
    parts: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND/RANGES",
            help="Make a certificate for each of these parts, which lets it speak for"
            " itself alone: cell/0-39, worker/0-1. May be repeated.",
        ),
    ] = None,
    days: Annotated[int, typer.Option(help="How many days the keys are valid.")] = 365,
    revoke: Annotated[
        str,
        typer.Option(
            metavar="WHO",
            help="Revoke the certificate of a part (cell/3) or a role, and make another"
            " in its place.",
        ),
    ] = "",
    as_json: Json = False,
) -> None:
    """Make the keys and certificates of a swarm on several machines, for --tls."""
    from neurosnap.fabric.security.make_keys import make_keys
    from neurosnap.fabric.security.make_keys import revoke as revoke_one

    with errors():
        if revoke:
            if host or parts:
                rule = "must come without --host and --parts"
                raise InvalidValueError("revoke", rule, revoke)
            until = revoke_one(folder, revoke)
            for line in (
                f"{revoke} has new files in {folder}, valid until {until:%F}",
                "the old ones count for nothing once the hub has been started again"
                " with this folder's names.json",
            ):
                say(as_json).print(line, markup=False, soft_wrap=True)
            if as_json:
                print_json({"revoked": revoke, "until": until})
            return
        made = make_keys(folder, host or (), _listed(parts or []), days=days)
        several = f" and {len(made.parts)} parts" if made.parts else ""
        for line in (
            f"keys for {', '.join(made.roles)}{several} in {made.folder}",
            f"the hub is {', '.join(made.hosts)}; valid until {made.until:%F}",
            "another machine needs ca.pem and the .pem and .key of its parts or roles,"
            " never ca.key",
        ):
            say(as_json).print(line, markup=False, soft_wrap=True)
        if as_json:
            print_json(msgspec.to_builtins(made))


def _listed(parts: list[str]) -> list[str]:
    """Return the parts in ``cell/0-39`` and the like, each once."""
    found: list[str] = []
    for text in parts:
        kind, _, numbers = text.partition("/")
        found += [f"{kind}/{number}" for number in ranges("parts", numbers)]
    if len(set(found)) < len(found):
        raise InvalidValueError("parts", "must name each once", ", ".join(parts))
    return found
