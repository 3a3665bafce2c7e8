"""``neurosnap salvage``: copies what is intact of a damaged recording."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.shared import LOST, Json, Log, app, errors, print_json, say


@app.command()
def salvage(
    log: Log,
    out: Annotated[
        Path,
        typer.Option("--out", "-o", metavar="FILE.mcap", help="Where to; a new file."),
    ],
    as_json: Json = False,
) -> None:
    """Write all that can be proved of a damaged recording into a new one."""
    from neurosnap.recording.write.salvage import salvage as write

    with errors():
        found = write(log, out)
        console = say(as_json)
        for line in found.lost:
            console.print(f"lost: {line}", markup=False, soft_wrap=True)
        kept, missing = found.completeness.messages, found.completeness.missing
        lacks = f", {sum(missing.values())} are missing" if missing else ""
        console.print(
            f"wrote {found.path}: {kept} messages{lacks}", markup=False, soft_wrap=True
        )
        if as_json:
            print_json(msgspec.to_builtins(found))
        if found.lost or missing:
            raise typer.Exit(LOST)
