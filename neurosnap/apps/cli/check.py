"""``neurosnap check``: what would keep a run from starting, in a file or here."""

from pathlib import Path
from typing import Annotated

import typer

from neurosnap.apps.cli.options import option
from neurosnap.apps.cli.output import print_facts, say
from neurosnap.apps.cli.shared import SET_UP, Format, app, errors


@app.command(rich_help_panel=SET_UP)
def check(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]",
            help="A TOML file that describes a run.",
            show_default="check the machine",
        ),
    ] = None,
    tls: str = option("tls", "Without a file: check the keys in this folder, too."),
    form: Format = "text",
) -> None:
    """Find all that would keep a run from starting, and say how to fix it.

    In a TOML file with line numbers; without one, on this machine.
    """
    with errors():
        if file is None:
            _check_machine(Path(tls) if tls else None, form)
        else:
            _check_file(file, form)


def _check_file(file: Path, form: str) -> None:
    from neurosnap.apps.config.load import load
    from neurosnap.apps.config.prepare import prepare
    from neurosnap.apps.config.problems import ConfigError

    try:
        prepare(load(file))
    except ConfigError as error:
        faults = {"faults": error.faults, "more": error.more}
        print_facts(form, {"file": str(file), **faults})
        raise
    say(form, f"{file}: no faults")
    print_facts(form, {"file": str(file), "faults": [], "more": 0})


def _check_machine(keys: Path | None, form: str) -> None:
    from neurosnap.apps.doctor import examine

    findings = examine(keys)
    for finding in findings:
        mark = "ok " if finding.ok else "bad"
        say(form, f"{mark} {finding.what}: {finding.found}")
        if not finding.ok:
            say(form, f"    → {finding.fix}")
    print_facts(form, {"findings": findings})
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)
