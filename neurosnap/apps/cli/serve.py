"""``neurosnap serve``: start single parts of a swarm by hand, on any machine.

All are given the hub and the name of the swarm; the run itself they get from its
coordinator (`neurosnap serve coordinator`, or `run --elsewhere`).
"""

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import msgspec
import typer

from neurosnap.apps.cli import app
from neurosnap.apps.cli.errors_and_signals import (
    LOST,
    Connect,
    Format,
    convert,
    errors,
    new_log,
    run_async,
)
from neurosnap.apps.cli.run_at_a_glance import glance_at
from neurosnap.apps.cli.run_flags import (
    FLAG,
    NETWORK,
    RECORDING,
    Described,
    Given,
    option,
    request_of,
    with_parameters,
    with_run_options,
)
from neurosnap.apps.cli.terminal_output import (
    outcome_facts,
    outcome_lines,
    print_facts,
    say,
    warn,
    watcher,
)
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.network import Network
from neurosnap.runtime.request import check_swarm

if TYPE_CHECKING:
    from neurosnap.recording.format.completeness import Completeness
    from neurosnap.runtime.remote_parts import ChooseParts
    from neurosnap.runtime.service import Served

serve = typer.Typer(
    help="Start a part of a swarm by hand, on this machine: its hub, world, recorder,"
    " cells or coordinator.",
    no_args_is_help=True,
)
app.add_typer(serve, name="serve")

_HERE = "tcp/127.0.0.1:7447"
_SESSIONS = 10_000
"""Parts and programs that may be connected at once."""
Swarm = Annotated[
    str,
    typer.Argument(
        metavar="SWARM", help="Name of the swarm, as the coordinator's --swarm has it."
    ),
]
Patience = Annotated[
    float,
    typer.Option(
        metavar="SECONDS",
        rich_help_panel=NETWORK,
        help="How long to wait until the other parts have connected.",
    ),
]
Stay = Annotated[
    bool,
    typer.Option(
        "--stay",
        metavar=FLAG,
        rich_help_panel=NETWORK,
        help="When the swarm has ended, wait for the next of this name, until Ctrl-C."
        " Otherwise only for one that continues it, if a part had died.",
    ),
]
_with_place = with_parameters(
    connect=(Connect, ...),
    stay=(Stay, False),
    patience=(Patience, 60.0),
    tls=(str, option("tls")),
    insecure=(bool, option("insecure")),
)
"""Gives a verb what says where the swarm is, and how long to be of it."""


@serve.command()
@with_parameters(
    tls=(str, option("tls")),
    insecure=(bool, option("insecure")),
)
def hub(
    context: typer.Context,
    listen: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where the hub listens; tcp/127.0.0.1:7447 if not given. For other"
            " machines, such as tls/0.0.0.0:7447 with --tls. Give it several times, and"
            " a flood of connections to one endpoint leaves the others free.",
        ),
    ] = None,
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where another hub listens, to be one network with it: parts connect to"
            " either. May be repeated. Hubs make a tree: one link between any two.",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Start a hub, through which the parts of swarms reach each other, until Ctrl-C.

    `neurosnap run` starts one itself, unless it is given --connect.
    """
    with errors():
        given = context.params
        endpoints = listen or [_HERE]
        networks = [
            convert(
                Network,
                listen=endpoint,
                tls=given["tls"],
                insecure=given["insecure"],
            )
            for endpoint in endpoints
        ]
        for network in networks:
            network.check()
        secured = {
            "links": link or [],
            "credentials": networks[0].credentials("hub"),
            "insecure": given["insecure"],
        }
        run_async(lambda stop: _hub(stop, endpoints, secured))
        print_facts(form, {"listened": endpoints})


async def _hub(
    stop: asyncio.Event, endpoints: list[str], secured: dict[str, Any]
) -> None:
    """Be a hub until `stop` is set."""
    from neurosnap.fabric.zenoh.hub import follow_links, open_hub

    session = await asyncio.to_thread(open_hub, endpoints, _SESSIONS, **secured)
    try:
        warn(f"listening on {', '.join(endpoints)}")
        credentials = secured["credentials"]
        await follow_links(session, secured["links"], stop, warn, credentials)
    finally:
        await asyncio.to_thread(session.close)


@serve.command()
@_with_place
def world(
    context: typer.Context, swarm: Swarm, source: Described, form: Format = "text"
) -> None:
    """Provide the observations of a swarm, from a world or a file.

    SOURCE must be the coordinator's. The seed comes from there, and the arguments of a
    world of neurosnap; name others in a TOML file.
    """
    from neurosnap.apps.config.load import named_source
    from neurosnap.runtime import remote_parts

    with errors():
        choose = remote_parts.world(named_source(source))
        served = _serve(context, "world", swarm, choose)
        print_facts(form, {"swarm": swarm, "source": source, "served": _names(served)})


@serve.command()
@_with_place
def recorder(
    context: typer.Context,
    swarm: Swarm,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE.mcap",
            rich_help_panel=RECORDING,
            help="Where to record; must not exist yet. A swarm that follows is recorded"
            " beside it, as FILE-1.mcap.",
            show_default="logs/SWARM-DATE.mcap",
        ),
    ] = None,
    form: Format = "text",
) -> None:
    """Record a swarm on this machine."""
    from neurosnap.runtime import remote_parts

    logs: list[Path] = []

    def next_log() -> Path:
        here = out
        if out is not None and logs:  # a.mcap, a-1.mcap, and so on
            here = out.with_stem(f"{out.stem}-{len(logs)}")
        path = new_log(swarm, here)
        logs.append(path)
        return path

    with errors():
        if out is not None:
            new_log(swarm, out)  # refused now, and not once the swarm is there
        served = _serve(context, "recorder", swarm, remote_parts.recorder(next_log))
        say(form, *(f"recording: {log}" for log in logs))
        whole = all(balance.whole for balance in _balances(served))
        facts = {"logs": [str(log) for log in logs], "complete": whole}
        print_facts(form, {"swarm": swarm, **facts, "served": _names(served)})
        if not whole:
            raise typer.Exit(LOST)


@serve.command()
@_with_place
def cells(
    context: typer.Context,
    swarm: Swarm,
    ranges: Annotated[
        str,
        typer.Argument(
            metavar="RANGES",
            help="The numbers of the cells to run here, or of the workers where the run"
            " has --cells worker: 0-499, or 3,7,9-12.",
        ),
    ],
    form: Format = "text",
) -> None:
    """Run some of a swarm's cells, or its workers, on this machine."""
    from neurosnap.runtime import remote_parts

    with errors():
        numbers = remote_parts.parse_ranges("cells", ranges)
        served = _serve(context, f"cells {ranges}", swarm, remote_parts.cells(numbers))
        facts = {"cells": numbers, "served": _names(served)}
        print_facts(form, {"swarm": swarm, **facts})


@serve.command()
@with_run_options(
    *("ticks", "seed", "agent", "target", "snapshot", "threshold"),
    *("cells", "workers", "tls"),
)
def coordinator(
    context: typer.Context,
    source: Described,
    connect: Connect,
    swarm: Annotated[
        str,
        typer.Option(
            metavar="ID",
            rich_help_panel=NETWORK,
            help="Name of the swarm, the same for all its parts: letters and digits.",
        ),
    ],
    given: Given = None,
    patience: Patience = 60.0,
    form: Format = "text",
) -> None:
    """Coordinate a run whose other parts are started by hand, here or elsewhere.

    Start `neurosnap serve hub` first; then this, and `serve world`, `recorder` and
    `cells`, in any order, on any machine. SOURCE and options are those of `run`.
    """
    from neurosnap.runtime.request import RunRequest
    from neurosnap.runtime.run_with_restarts import run as run_swarm

    with errors():
        check_swarm(swarm)  # which must be given here
        request = request_of(context, here=False)
        options = request.options
        if options.cells == "inline":
            rule = "must be 'process' or 'worker', for others to start them"
            raise InvalidValueError("cells", rule, options.cells)
        recorder = [] if request.log is None else ["recorder"]
        parts = frozenset(["world", *options.host_names(), *recorder])
        site = replace(request.site, elsewhere=parts, patience=patience)
        request = RunRequest(options, site=site)
        glance = glance_at(request)
        with glance.shown():
            watching = watcher(glance)
            outcome = run_async(lambda stop: run_swarm(request, stop, watching))
        say(form, *outcome_lines(options, outcome, None))
        facts = outcome_facts(options, outcome, None)
        # The recording, and whether it is whole, is the recorder's to say.
        its = ("log", "complete", "kept", "journal", "waiting")
        kept = {k: v for k, v in facts.items() if k not in its}
        print_facts(form, {"swarm": swarm, **kept})


def _serve(
    context: typer.Context, what: str, swarm: str, choose: "ChooseParts"
) -> "list[Served]":
    """Serve until it is over; return the swarms served."""
    from neurosnap.runtime.compilation import compile_first
    from neurosnap.runtime.service import serve

    given = context.params
    keys = ("connect", "tls", "insecure")
    network = convert(Network, **{key: given[key] for key in keys})
    served: list[Served] = []

    def report(one: "Served") -> None:
        served.append(one)
        if one.trouble:
            warn(f"swarm {one.swarm}: {one.trouble}")

    async def work(stop: asyncio.Event) -> None:
        warn(f"{what} for swarm {swarm}")
        if what.startswith("cells"):  # before a coordinator waits for workers
            await compile_first(None, stop)
        await serve(
            choose,
            network,
            swarm,
            stop,
            stays=given["stay"],
            patience=given["patience"],
            on_served=report,
        )

    check_swarm(swarm)
    run_async(work)
    return served


def _balances(served: "list[Served]") -> "list[Completeness]":
    from neurosnap.recording.format.completeness import Completeness

    return [
        msgspec.json.decode(one.results["recorder"], type=Completeness)
        for one in served
        if "recorder" in one.results
    ]


def _names(served: "list[Served]") -> list[str]:
    return [one.swarm for one in served]
