"""``neurosnap run`` and ``resume``: start a swarm, or continue a recorded run."""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    LOST,
    Format,
    Log,
    errors,
    new_log,
    run_async,
)
from neurosnap.apps.cli.run_at_a_glance import glance_at
from neurosnap.apps.cli.run_flags import (
    FLAG,
    NETWORK,
    Described,
    Given,
    option,
    request_of,
    with_run_options,
)
from neurosnap.apps.cli.serve_page import check_page, viewed
from neurosnap.apps.cli.terminal_output import (
    outcome_facts,
    outcome_lines,
    print_facts,
    say,
    watcher,
)
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.systemd import ServiceManager

if TYPE_CHECKING:
    from neurosnap.runtime.request import Outcome, RunRequest

_EXAMPLE = "Example: neurosnap run neurosnap/Path-v0 --ticks 300 --out a.mcap"


@app.command(epilog=_EXAMPLE)
@with_run_options(
    *("ticks", "seed", "agent", "target", "grow", "snapshot", "threshold"),
    *("cells", "workers", "elsewhere", "out", "listen", "connect", "tls"),
)
def run(
    context: typer.Context,
    source: Described,
    given: Given = None,
    swarm: Annotated[
        str,
        typer.Option(
            metavar="ID",
            rich_help_panel=NETWORK,
            help="Name of this swarm, by which others find it: letters and digits.",
            show_default="a random one",
        ),
    ] = "",
    view: Annotated[
        bool,
        typer.Option(
            "--view",
            metavar=FLAG,
            help="Show the run in the browser while it goes on.",
        ),
    ] = False,
    form: Format = "text",
) -> None:
    """Learn from a world, a file or live sensors, and record everything."""
    with errors():
        if view:
            check_page()
        request = request_of(context)
        if view and request.log is None:
            rule = "must go with a recording, which is what is looked at"
            raise InvalidValueError("view", rule, "no recording")
        outcome = _carry_out(request, form, view=view)
        print_facts(form, outcome_facts(request.options, outcome, request.log))
        _end_by(outcome)


@app.command()
def resume(
    log: Log,
    source: Described = "",
    trust_source: Annotated[
        bool,
        typer.Option(
            "--trust-source",
            metavar=FLAG,
            help="Open what the recording names, whatever it is.",
        ),
    ] = False,
    ticks: Annotated[
        int | None,
        typer.Option(
            help="How many ticks the run has in the end.",
            show_default="300 more than it has",
        ),
    ] = None,
    out: Path | None = option("out"),
    form: Format = "text",
) -> None:
    """Continue a run after its last whole tick, in a new recording.

    It opens worlds of neurosnap and standard input by itself. Any other SOURCE must be
    named again, since a recording may be a stranger's.
    """
    from neurosnap.apps.config.load import named_source
    from neurosnap.runtime.run_with_restarts import resumed

    with errors():
        request = resumed(log, ticks, named_source(source) if source else trust_source)
        options, after = request.options, request.after
        request = replace(request, log=new_log(options.source, out))
        outcome = _carry_out(request, form)
        facts = outcome_facts(options, outcome, request.written)
        print_facts(form, {**facts, "resumed": str(log), "resumed_at": after})
        _end_by(outcome)


def _carry_out(request: "RunRequest", form: str, *, view: bool = False) -> "Outcome":
    """Run a swarm and say how it went, in the browser too if that was asked for."""
    from neurosnap.runtime.run_with_restarts import run as run_swarm

    if request.log is not None:
        request.log.parent.mkdir(exist_ok=True)

    def report(outcome: "Outcome") -> None:
        say(form, *outcome_lines(request.options, outcome, request.written))

    glance = glance_at(request)
    with ServiceManager() as service, glance.shown():

        async def work(stop: asyncio.Event) -> "Outcome":
            return await run_swarm(request, stop, watcher(glance, service.progress))

        if view and (new := request.log) is not None:
            return run_async(lambda stop: viewed(new, stop, work, report))
        outcome = run_async(work)
    report(outcome)
    return outcome


def _end_by(outcome: "Outcome") -> None:
    """End with `LOST` if something was lost."""
    whole = outcome.completeness is None or outcome.complete
    if outcome.lost or not whole:
        raise typer.Exit(LOST)
