"""``neurosnap run`` and ``resume``: run a source through a swarm, and go on."""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli import output
from neurosnap.apps.cli.broker import brokered
from neurosnap.apps.cli.options import (
    FLAG,
    NETWORK,
    SOURCE,
    Described,
    Given,
    described,
    with_run_options,
)
from neurosnap.apps.cli.page import check_page, viewed
from neurosnap.apps.cli.shared import (
    LEARN,
    LOST,
    Format,
    Log,
    app,
    check_swarm,
    errors,
    new_log,
    open_ranges,
    people,
    print_facts,
    run_async,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.systemd import ServiceManager

if TYPE_CHECKING:
    from neurosnap.apps.config.prepare import Prepared
    from neurosnap.runtime.request import Outcome, RunRequest

_EXAMPLE = "Example: neurosnap run neurosnap/Path-v0 --ticks 300 --out a.mcap"
_MORE = 300
"""Ticks that a run goes on for, unless told otherwise."""


@app.command(epilog=_EXAMPLE, rich_help_panel=LEARN)
@with_run_options(
    *("ticks", "seed", "agent", "target", "snapshot", "threshold"),
    *("cells", "workers", "out", "listen", "connect", "tls"),
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
    elsewhere: Annotated[
        str,
        typer.Option(
            metavar="RANGES",
            rich_help_panel=NETWORK,
            help="The cells (or workers) that are started on other machines with"
            " `neurosnap serve cells`, such as 0-499 or 3,7.",
        ),
    ] = "",
    broker: Annotated[
        str,
        typer.Option(
            metavar="embedded|HOST[:PORT]",
            rich_help_panel=SOURCE,
            help="Use this MQTT broker instead of the one in the TOML file. Embedded:"
            " start a small one, to try things out.",
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
    from neurosnap.runtime.request import RunRequest, Site

    with errors():
        if view:
            check_page()
        with brokered(broker, source) as before:
            prepared = described(context, before)
            if view and prepared.log is None:
                rule = "must go with a recording, which is what is looked at"
                raise InvalidValueError("view", rule, "no recording")
            away = _away(elsewhere, swarm, prepared)
            request = RunRequest(
                prepared.options,
                prepared.log,
                site=Site(prepared.network, prepared.placement, swarm, away),
                supervision=prepared.supervision,
            )
            _check_room(request)
            if prepared.chosen:
                screen.print(prepared.chosen, markup=False, soft_wrap=True)
            outcome = _carry_out(request, form, view=view)
        print_facts(form, output.outcome_facts(request.options, outcome, request.log))
        _end_by(outcome)


@app.command(rich_help_panel=LEARN)
def resume(
    log: Log,
    ticks: Annotated[
        int | None,
        typer.Option(
            help="How many ticks there are to be in all.",
            show_default=f"{_MORE} more than there are",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE.mcap",
            help="Where to record; must not exist yet.",
            show_default="logs/SOURCE-DATE.mcap",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Go on with a run after its last whole tick, into a new recording."""
    from neurosnap.recording.read.recording import part_path
    from neurosnap.recording.replay.resume import find_resume_point
    from neurosnap.runtime.request import RunRequest

    with errors():
        options, past = find_resume_point(log)
        options = msgspec.structs.replace(options, ticks=_more(options, past, ticks))
        new = new_log(options.source, out)
        request = RunRequest(options, new, past)
        written = part_path(new, past.part)
        outcome = _carry_out(request, form, written)
        facts = output.outcome_facts(options, outcome, written)
        resumed = {"resumed": str(log), "resumed_at": past.tick}
        print_facts(form, {**facts, **resumed})
        _end_by(outcome)


def _carry_out(
    request: "RunRequest", form: str, log: Path | None = None, *, view: bool = False
) -> "Outcome":
    """Run a swarm and say how it went, in the browser too if that was asked for."""
    from neurosnap.runtime.run import run as run_swarm

    if request.log is not None:
        request.log.parent.mkdir(exist_ok=True)

    def tell(outcome: "Outcome") -> None:
        output.outcome(people(form), request.options, outcome, log or request.log)

    ticks = request.options.ticks
    with ServiceManager() as service, output.progress(screen, "ticks", ticks) as shown:

        def on_tick(tick: int) -> None:
            shown(tick)
            service.progress(tick)

        async def work(stop: asyncio.Event) -> "Outcome":
            return await run_swarm(request, stop, output.watcher(screen, on_tick))

        if view and (new := request.log) is not None:
            return run_async(lambda stop: viewed(new, stop, work, tell))
        outcome = run_async(work)
        tell(outcome)
        return outcome


def _check_room(request: "RunRequest") -> None:
    """Refuse what this machine cannot run, before anything is started."""
    from neurosnap.runtime.preflight import check_cells

    request.site.placement.check_installed()
    if request.options.cells == "process":
        check_cells(len(request.options.sensors) - len(request.site.elsewhere))


def _more(options: RunOptions, past: ResumePoint, ticks: int | None) -> int:
    """Return how many ticks there are to be when a run goes on.

    Raises:
        InvalidValueError: There are as many already, or the source has no more.
    """
    from neurosnap.sources.open import open_source

    source = open_source(options.source, options.seed, options.arguments)
    source.close()
    most = past.tick + _MORE if ticks is None else ticks
    if source.length is not None:
        most = min(most, source.length)
    if most <= past.tick:
        rule = f"must be more than the {past.tick} there are, and the source have them"
        raise InvalidValueError("ticks", rule, most)
    return most


def _end_by(outcome: "Outcome") -> None:
    """End with `LOST` if something was lost."""
    whole = outcome.completeness is None or outcome.complete
    if outcome.lost or not whole:
        raise typer.Exit(LOST)


def _away(elsewhere: str, swarm: str, request: "Prepared") -> frozenset[str]:
    """Return the parts that are started on other machines."""
    options, network = request.options, request.network
    if swarm:
        check_swarm(swarm)
    if not elsewhere:
        return frozenset()
    if options.cells == "inline":
        rule = "must go with cells that are processes, or in workers"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    if not swarm or not (network.listen or network.connect):
        rule = "must come with --swarm ID, and --listen or --connect"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    numbers, hosts = open_ranges("elsewhere", elsewhere), options.host_names()
    kind = "workers" if options.sharing else "cells"
    try:
        return frozenset(hosts[number] for number in numbers.of(kind, len(hosts)))
    except InvalidValueError as error:
        raise InvalidValueError("elsewhere", error.rule, elsewhere) from error
