"""``neurosnap run``: runs a source through a swarm."""

import asyncio
from pathlib import Path
from typing import Annotated

import typer

from neurosnap.agent.policy import EXPLORE
from neurosnap.apps.cli.broker import brokered
from neurosnap.apps.cli.config import described
from neurosnap.apps.cli.options import (
    CELLS,
    FLAG,
    NETWORK,
    RECORDING,
    SOURCE,
    SUPERVISION,
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
from neurosnap.apps.cli.page import check_page, viewed
from neurosnap.apps.cli.shared import (
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
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.runtime.network import Network
from neurosnap.runtime.restart_policy import RestartKind
from neurosnap.runtime.systemd import ServiceManager

_EXAMPLE = "Example: neurosnap run neurosnap/Path-v0 --ticks 300 --out a.mcap"


@app.command(epilog=_EXAMPLE)
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
    cells: Annotated[
        CellKind,
        typer.Option(
            rich_help_panel=CELLS,
            help="Where the cells are. Process: each is a process of its own. Worker:"
            " --workers processes share them; the fastest for many sensors. Inline: all"
            " in this process, without a network; the easiest to debug.",
        ),
    ] = "process",
    workers: Workers = 2,
    wiring: Wiring = "hasse",
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap",
            rich_help_panel=RECORDING,
            help="Where to record; must not exist yet.",
            show_default="logs/SOURCE-DATE.mcap",
        ),
    ] = None,
    record: Annotated[
        bool,
        typer.Option(
            metavar=FLAG,
            rich_help_panel=RECORDING,
            help="Record everything. Without a recording nothing can be replayed, and"
            " the run cannot go on after a failure.",
        ),
    ] = True,
    split: Annotated[
        int,
        typer.Option(
            metavar="SIZE",
            parser=in_bytes,
            rich_help_panel=RECORDING,
            help="Begin another file once one is this large, such as 256MiB. 0: record"
            " in one file.",
        ),
    ] = 0,
    keep: Annotated[
        int,
        typer.Option(
            metavar="FILES",
            rich_help_panel=RECORDING,
            help="With --split: keep this many of the newest files and delete the"
            " others. 0: keep all.",
        ),
    ] = 0,
    sync: Sync = None,
    anomalies: Anomalies = True,
    hold: Hold = 0,
    deadline: Deadline = 10.0,
    restart: Annotated[
        RestartKind,
        typer.Option(
            rich_help_panel=SUPERVISION,
            help="When to start the parts again and go on from the recording. On-failure:"
            " when one was killed, vanished or hangs. Always: also when one gave an"
            " error.",
        ),
    ] = "on-failure",
    max_restarts: Annotated[
        int,
        typer.Option(
            rich_help_panel=SUPERVISION,
            help="How many restarts there may be within --restart-window before the run"
            " is given up.",
        ),
    ] = 10,
    restart_window: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            rich_help_panel=SUPERVISION,
            help="How long a restart counts towards --max-restarts.",
        ),
    ] = 600.0,
    backoff: Annotated[
        float,
        typer.Option(
            metavar="SECONDS",
            rich_help_panel=SUPERVISION,
            help="How long to wait before a restart. Twice as long each time when no tick"
            " was made in between.",
        ),
    ] = 0.1,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where the hub listens for parts and programs from elsewhere, such as"
            " tcp/127.0.0.1:7447.",
            show_default="a private socket on this machine",
        ),
    ] = "",
    connect: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Use the hub that listens there (`neurosnap hub`), and start none.",
        ),
    ] = "",
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
    tls: Tls = "",
    insecure: Insecure = False,
    audit: Annotated[
        bool,
        typer.Option(
            "--audit",
            metavar=FLAG,
            rich_help_panel=NETWORK,
            help="Log every message that the hub refuses. Slow.",
        ),
    ] = False,
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
    from neurosnap.runtime.journaled_run import run_journaled
    from neurosnap.runtime.parts.world_process import WayIn
    from neurosnap.runtime.preflight import check_cells
    from neurosnap.runtime.restart import run_with_restarts
    from neurosnap.runtime.run import Outcome
    from neurosnap.runtime.run import run as run_swarm

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
        with output.progress(screen, "ticks", options.ticks) as show_tick:

            def on_progress(tick: int) -> None:
                show_tick(tick)
                service.progress(tick)

            def tell(outcome: Outcome) -> None:
                output.outcome(say(as_json), options, outcome, log)

            async def work(stop: asyncio.Event) -> Outcome:
                return await run_journaled(
                    options, log, lambda way_in: swarm_of(stop, way_in)
                )

            async def swarm_of(stop: asyncio.Event, way_in: WayIn | None) -> Outcome:
                if log is None or options.cells == "inline":
                    return await run_swarm(
                        options,
                        log,
                        stop,
                        on_progress,
                        network=network,
                        swarm=swarm,
                        elsewhere=away,
                        way_in=way_in,
                    )
                return await run_with_restarts(
                    options,
                    log,
                    stop,
                    prepared.supervision,
                    on_progress=on_progress,
                    on_restart=lambda event: output.restart(screen, event),
                    network=network,
                    swarm=swarm,
                    elsewhere=away,
                    way_in=way_in,
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
    numbers, hosts = ranges("elsewhere", elsewhere), options.host_names()
    if numbers[-1] >= len(hosts):
        kind = "workers" if options.sharing else "cells"
        rule = f"must be {kind} of the swarm, 0 to {len(hosts) - 1}"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    return frozenset(hosts[number] for number in numbers)
