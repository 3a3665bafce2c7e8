"""``neurosnap run``: runs a source through a swarm."""

import asyncio
from typing import Annotated

import typer

from neurosnap.apps.cli.broker import brokered
from neurosnap.apps.cli.config import described
from neurosnap.apps.cli.options import (
    FLAG,
    NETWORK,
    SOURCE,
    Described,
    Given,
    with_run_options,
)
from neurosnap.apps.cli.page import check_page, viewed
from neurosnap.apps.cli.shared import (
    LOST,
    Json,
    app,
    check_swarm,
    errors,
    open_ranges,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.network import Network
from neurosnap.runtime.systemd import ServiceManager

_EXAMPLE = "Example: neurosnap run neurosnap/Path-v0 --ticks 300 --out a.mcap"


@app.command(epilog=_EXAMPLE)
@with_run_options()
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
            " `neurosnap join`, such as 0-499 or 3,7.",
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
    as_json: Json = False,
) -> None:
    """Learn from a world, a file or live sensors, and record everything."""
    from neurosnap.apps.cli import output
    from neurosnap.runtime.preflight import check_cells
    from neurosnap.runtime.request import Outcome, RunRequest, Site
    from neurosnap.runtime.run import run as run_swarm

    with errors():
        if view:
            check_page()
    with errors(), brokered(broker, source) as before, ServiceManager() as service:
        # The rest of the arguments is read from the context, which knows which of
        # them were given and so go before a file.
        prepared = described(context, before)
        options, network, log = prepared.options, prepared.network, prepared.log
        if view and log is None:
            rule = "must go with a recording, which is what is looked at"
            raise InvalidValueError("view", rule, "--no-record")
        prepared.placement.check_installed()
        away = _away(elsewhere, swarm, network, options)
        if options.cells == "process":
            check_cells(len(options.sensors) - len(away))
        if prepared.chosen:
            screen.print(prepared.chosen, markup=False, soft_wrap=True)
        if log is not None:
            log.parent.mkdir(exist_ok=True)
        request = RunRequest(
            options,
            log,
            site=Site(network, prepared.placement, swarm, away),
            supervision=prepared.supervision,
        )
        with output.progress(screen, "ticks", options.ticks) as show_tick:

            def on_tick(tick: int) -> None:
                show_tick(tick)
                service.progress(tick)

            def tell(outcome: Outcome) -> None:
                output.outcome(say(as_json), options, outcome, log)

            watcher = output.watcher(screen, on_tick)

            async def work(stop: asyncio.Event) -> Outcome:
                return await run_swarm(request, stop, watcher)

            if view and log is not None:
                outcome = run_async(lambda stop: viewed(log, stop, work, tell))
            else:
                outcome = run_async(work)
                tell(outcome)
        if as_json:
            print_json(output.outcome_facts(options, outcome, log))
        whole = outcome.completeness is None or outcome.complete
        if outcome.lost or not whole:
            raise typer.Exit(LOST)


def _away(
    elsewhere: str, swarm: str, network: Network, options: RunOptions
) -> frozenset[str]:
    """Return the parts that somebody else starts."""
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
