"""``neurosnap hub``, ``ps`` and ``stop``: a separate hub, and local swarms."""

import asyncio
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import NETWORK, option
from neurosnap.apps.cli.shared import (
    Json,
    app,
    convert,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.runtime.network import Network

_HERE = "tcp/127.0.0.1:7447"


@app.command()
def hub(
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
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    audit: bool = option("audit"),
    sessions: Annotated[
        int,
        typer.Option(
            rich_help_panel=NETWORK,
            help="How many parts and programs may be connected at once.",
        ),
    ] = 10_000,
    as_json: Json = False,
) -> None:
    """Start a hub, through which the parts of swarms reach each other, until Ctrl-C.

    `neurosnap run` starts one itself, unless it is given --connect.
    """
    from neurosnap.fabric.zenoh.denied_log import telling_refusals
    from neurosnap.fabric.zenoh.hub import open_hub

    with errors():
        endpoints = listen or [_HERE]
        networks = [
            convert(Network, listen=endpoint, tls=tls, insecure=insecure)
            for endpoint in endpoints
        ]
        for network in networks:
            network.check()
        credentials = networks[0].credentials("hub")

        async def serve(stop: asyncio.Event) -> None:
            session = await asyncio.to_thread(
                open_hub,
                endpoints,
                sessions,
                credentials=credentials,
                insecure=insecure,
            )
            try:
                where = ", ".join(endpoints)
                screen.print(f"listening on {where}", markup=False)
                await stop.wait()
            finally:
                await asyncio.to_thread(session.close)

        with telling_refusals(audit=audit):
            run_async(serve)
        if as_json:
            print_json({"listened": endpoints})


@app.command()
def ps(
    swarm: Annotated[
        str | None,
        typer.Argument(
            metavar="[SWARM]",
            help="The id of a swarm, to list its parts.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the swarms that run on this machine, or the parts of one."""
    from neurosnap.apps.cli import output
    from neurosnap.runtime import registry

    with errors():
        if swarm is None:
            notes = registry.swarms()
            output.swarms(say(as_json), notes)
            if as_json:
                print_json({"swarms": msgspec.to_builtins(notes)})
        else:
            note = registry.find(swarm)
            parts = registry.parts(note)
            output.parts(say(as_json), note, parts)
            if as_json:
                facts = msgspec.to_builtins(note)
                print_json({**facts, "parts": msgspec.to_builtins(parts)})


@app.command()
def stop(
    swarm: Annotated[
        str,
        typer.Argument(
            metavar="SWARM", help="The id of the swarm; `neurosnap ps` lists them."
        ),
    ],
    patience: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="How long to wait until it has ended."),
    ] = 30.0,
    as_json: Json = False,
) -> None:
    """End a swarm of this machine in order, with its recording finished."""
    from neurosnap.runtime import registry

    with errors():
        note = registry.find(swarm)
        registry.stop(note, patience)
        say(as_json).print(f"stopped {swarm}", markup=False)
        if as_json:
            print_json({"stopped": swarm, "log": note.log})
