"""``neurosnap run``: a source through a swarm."""

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from neurosnap.agent.policy import EXPLORE
from neurosnap.cli.broker import brokered
from neurosnap.cli.config import described
from neurosnap.cli.options import (
    Agent,
    Anomalies,
    Deadline,
    Decay,
    Described,
    Explore,
    Given,
    Hold,
    Seed,
    Snapshot,
    Sync,
    Target,
    Threshold,
    Ticks,
    Wiring,
    Workers,
)
from neurosnap.cli.page import check_page, viewed
from neurosnap.cli.shared import (
    LOST,
    Insecure,
    Json,
    Tls,
    app,
    check_swarm,
    errors,
    in_bytes,
    print_json,
    ranges,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.swarm.network import Network
from neurosnap.swarm.notify import ServiceManager
from neurosnap.swarm.options import CellKind, RunOptions
from neurosnap.swarm.supervision import RestartKind


@app.command()
def run(
    context: typer.Context,
    source: Described,
    ticks: Ticks = None,
    seed: Seed = 0,
    agent: Agent = "walker",
    target: Target = None,
    explore: Explore = EXPLORE,
    given: Given = None,
    snapshot: Snapshot = "empirical",
    threshold: Threshold = None,
    decay: Decay = None,
    wiring: Wiring = "hasse",
    cells: Annotated[
        CellKind,
        typer.Option(help="One OS process a cell, one for many, or all in this one."),
    ] = "process",
    workers: Workers = 2,
    out: Annotated[
        Path | None, typer.Option(help="Where to record. \\[default: logs/…]")
    ] = None,
    record: Annotated[bool, typer.Option(help="Record at all.")] = True,
    split: Annotated[
        int,
        typer.Option(
            metavar="SIZE",
            parser=in_bytes,
            help="Go on in another file at the first key-frame after so much: bytes,"
            " or 256MiB. 0: never.",
        ),
    ] = 0,
    keep: Annotated[
        int, typer.Option(help="With --split: keep the newest files. 0: all.")
    ] = 0,
    sync: Sync = None,
    anomalies: Anomalies = True,
    hold: Hold = 0,
    deadline: Deadline = 10.0,
    restart: Annotated[
        RestartKind,
        typer.Option(
            help="Go on when a part dies or hangs; always: also when one says why it cannot go"
            " on. Takes a recording."
        ),
    ] = "on-failure",
    max_restarts: Annotated[
        int,
        typer.Option(help="How often within --restart-window, before it is given up."),
    ] = 10,
    restart_window: Annotated[float, typer.Option(help="Seconds.")] = 600.0,
    backoff: Annotated[
        float, typer.Option(help="Seconds before going on; doubles without progress.")
    ] = 0.1,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT", help="Where the hub listens. \\[default: on a socket]"
        ),
    ] = "",
    connect: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="A hub that is there already.")
    ] = "",
    swarm: Annotated[
        str, typer.Option(metavar="ID", help="Its id. \\[default: a random one]")
    ] = "",
    elsewhere: Annotated[
        str,
        typer.Option(
            metavar="RANGES", help="Cells, or workers, that `neurosnap join` starts."
        ),
    ] = "",
    tls: Tls = "",
    insecure: Insecure = False,
    audit: Annotated[
        bool, typer.Option("--audit", help="Log every refused message; slow.")
    ] = False,
    broker: Annotated[
        str,
        typer.Option(
            metavar="embedded|HOST[:PORT]",
            help="The MQTT broker to use, whatever the file says; or a small one here.",
        ),
    ] = "",
    view: Annotated[
        bool, typer.Option("--view", help="Look at it in the browser meanwhile.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run a source through a swarm of cells and record everything."""
    from neurosnap import show
    from neurosnap.swarm.endure import run_on
    from neurosnap.swarm.room import check_cells
    from neurosnap.swarm.run import Outcome
    from neurosnap.swarm.run import run as run_swarm

    with errors():
        if view and not record:
            rule = "must go with a recording, which is what is looked at"
            raise InvalidValueError("view", rule, "--no-record")
        if view:
            check_page()
    with errors(), brokered(broker, source) as before, ServiceManager() as service:
        # The rest of the arguments is read from the context, which knows which of
        # them were given and so go before a file.
        prepared = described(context, before)
        options, network, log = prepared.options, prepared.network, prepared.log
        away = _away(elsewhere, swarm, network, options)
        if options.cells == "process":
            check_cells(len(options.sensors) - len(away))
        if log is not None:
            log.parent.mkdir(exist_ok=True)
        with show.progress(screen, "ticks", options.ticks) as show_tick:

            def on_progress(tick: int) -> None:
                show_tick(tick)
                service.progress(tick)

            def tell(outcome: Outcome) -> None:
                show.outcome(say(as_json), options, outcome, log)

            async def work(stop: asyncio.Event) -> Outcome:
                if log is None or options.cells == "inline":
                    return await run_swarm(
                        options,
                        log,
                        stop,
                        on_progress,
                        network=network,
                        swarm=swarm,
                        elsewhere=away,
                    )
                return await run_on(
                    options,
                    log,
                    stop,
                    prepared.supervision,
                    on_progress=on_progress,
                    on_restart=lambda event: show.restart(screen, event),
                    network=network,
                    swarm=swarm,
                    elsewhere=away,
                )

            if not view:
                outcome = run_async(work)
                tell(outcome)
            elif log is None:
                rule = "must go with a recording, which is what is looked at"
                raise InvalidValueError("view", rule, "--no-record")
            else:
                outcome = run_async(lambda stop: viewed(log, stop, work, tell))
        if as_json:
            print_json(show.outcome_facts(options, outcome, log))
        if outcome.completeness is not None and not outcome.complete:
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
    numbers, hosts = ranges("elsewhere", elsewhere), options.host_names()
    if numbers[-1] >= len(hosts):
        kind = "workers" if options.sharing else "cells"
        rule = f"must be {kind} of the swarm, 0 to {len(hosts) - 1}"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    return frozenset(hosts[number] for number in numbers)
