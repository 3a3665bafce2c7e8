"""``neurosnap info``, ``graph``, ``model`` and ``doctor``: print and draw."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import FLAG, option
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
    from neurosnap.apps.cli.relations import learned_lines
    from neurosnap.recording.read.info import describe, render
    from neurosnap.recording.read.recording import Recording

    with errors():
        recording = Recording.open_file(log)
        found = describe(recording)
        say(as_json).print(render(found), markup=False, soft_wrap=True)
        for line in learned_lines(log, recording, found):
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
    from neurosnap.recording.read.births import births_of
    from neurosnap.recording.read.learned_at import snapshot_at
    from neurosnap.recording.read.recording import Recording

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
def model(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME|LOG|EXPR",
            help="The name of a model (--list shows them), or a recording, or sensors"
            ' and the implications between them: "a, b : a < b*".',
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Where to put the picture, a .png, .svg, .pdf or .tex (TikZ); replaces"
            " what is there.",
            show_default="NAME.png; none with --json",
        ),
    ] = None,
    at: OptionalTick = None,
    limit: Annotated[
        int,
        typer.Option(help="Do not draw the dual if it has more vertices than this."),
    ] = 256,
    only: Annotated[
        str,
        typer.Option(
            metavar="A,B",
            help="Draw these sensors only, and the order among them.",
            show_default="all",
        ),
    ] = "",
    names: Annotated[
        bool,
        typer.Option("--list", metavar=FLAG, help="List the names of the models."),
    ] = False,
    as_json: Json = False,
) -> None:
    """Draw a poc set (an order on sensors) and its dual (the space of their states)."""
    from neurosnap.apps.drawing.find_model import find, listed
    from neurosnap.apps.drawing.measures import in_words, measure
    from neurosnap.apps.drawing.page import check_picture, draw_model
    from neurosnap.apps.drawing.structure import structure
    from neurosnap.system.picture import KINDS

    with errors():
        if names:
            for name, title in listed().items():
                say(as_json).print(f"{name:24} {title}", markup=False, soft_wrap=True)
            if as_json:
                print_json({"models": listed()})
            return
        if what is None:
            rule = "must be a name of --list, a recording or an expression"
            raise InvalidValueError("model", rule, "nothing")
        if out is not None or not as_json:
            check_picture(out or Path("a.png"))
        kept = [name.strip() for name in only.split(",") if name.strip()]
        found = find(what, at, limit, kept)
        path = Path(f"{found.name}.png") if out is None and not as_json else out
        numbers = measure(found)
        lines = [numbers.title, *in_words(numbers)]
        if path is not None:
            with unwinding():
                draw_model(found, numbers, path)
            lines.append(f"wrote {path}")
        for line in lines:
            say(as_json).print(line, markup=False, soft_wrap=True)
        if as_json:
            files = dict.fromkeys((*KINDS, "tex"))
            drawn = {} if path is None else {path.suffix[1:].lower(): str(path)}
            facts = {
                **msgspec.to_builtins(numbers),
                **msgspec.to_builtins(structure(found)),
            }
            print_json({**files, **drawn, **facts})
        if found.recording is not None:
            end_by(found.recording)


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
