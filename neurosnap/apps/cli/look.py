"""``neurosnap info``, ``graph`` and ``doctor``: print what there is to know."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import option
from neurosnap.apps.cli.relations import Every, Force, Out, answered_by
from neurosnap.apps.cli.shared import (
    LOST,
    Json,
    Log,
    OptionalTick,
    app,
    end_by,
    errors,
    print_json,
    say,
)
from neurosnap.apps.cli.stopping import unwinding
from neurosnap.errors import InvalidValueError


@app.command()
def info(log: Log, as_json: Json = False) -> None:
    """Show what a recording holds, what it learned, and what is missing from it."""
    from neurosnap.apps.cli.recording_info import describe, render
    from neurosnap.apps.cli.relations import learned_lines
    from neurosnap.recording.read.recording import Recording

    with errors():
        recording = Recording.open_file(log)
        found = describe(recording)
        for line in (*learned_lines(log, recording, found), render(found)):
            say(as_json).print(line, markup=False, soft_wrap=True)
        if as_json:
            print_json(msgspec.to_builtins(found))
        if not recording.whole:
            raise typer.Exit(LOST)


@app.command()
def graph(
    log: Log,
    at: OptionalTick = None,
    form: Annotated[
        str,
        typer.Option(
            "--format",
            help="Table: each implication with how often it was put to the test, and"
            " how often it failed. For programs: json, dot (for Graphviz), graphml.",
        ),
    ] = "table",
    out: Out = None,
    every: Every = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Print the implications that were learned: which sensor implies which."""
    from neurosnap.apps.cli.relations import check_out, show, write
    from neurosnap.apps.export.graph_text import diagram, parse_format, render
    from neurosnap.recording.read.recording import Recording
    from neurosnap.recording.replay.births import births_of
    from neurosnap.recording.replay.learning import snapshot_at

    with errors():
        table = form == "table" and not as_json
        if out is not None:
            check_out(out)
            if not table:
                rule = "must go with the table; other formats go to standard output"
                raise InvalidValueError("out", rule, str(out))
        wanted = "json" if as_json or table else parse_format(form)
        recording = Recording.open(log)
        tick, snapshot = snapshot_at(recording, at)
        if table:
            answered = answered_by(log, recording, tick, snapshot, every=every)
            if out is not None:
                with unwinding():
                    write(answered, out, log, force=force)
            show(say(as_json=False), answered, out, None)
            end_by(recording)
            return
        births = births_of(recording)
        drawn = diagram(tick, snapshot.poc_graph(), snapshot.sensorium, births)
        if as_json:
            print_json(msgspec.to_builtins(drawn))
        else:
            # For programs, which take it for UTF-8 whatever a terminal is.
            typer.echo(render(drawn, wanted).encode())
        end_by(recording)


@app.command()
def doctor(tls: str = option("tls"), as_json: Json = False) -> None:
    """Check whether this machine can run a swarm, and say how to mend what it lacks."""
    from neurosnap.apps.cli import output
    from neurosnap.apps.doctor import examine

    with errors():
        findings = examine(Path(tls) if tls else None)
        output.findings(say(as_json), findings)
        if as_json:
            print_json({"findings": msgspec.to_builtins(findings)})
        if not all(finding.ok for finding in findings):
            raise typer.Exit(1)
