"""``neurosnap hub``, ``ps`` and ``stop``: a separate hub, and local swarms."""

import asyncio
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import FLAG, NETWORK, option
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
    link: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ENDPOINT",
            rich_help_panel=NETWORK,
            help="Where another hub listens, to be one network with it: parts connect to"
            " either. May be repeated. Hubs make a tree: one link between any two.",
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
    print_config: Annotated[
        bool,
        typer.Option(
            "--print-config",
            metavar=FLAG,
            rich_help_panel=NETWORK,
            help="Print the configuration with which a Zenoh router of your own is such"
            " a hub (zenohd -c FILE), and start none.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Start a hub, through which the parts of swarms reach each other, until Ctrl-C.

    `neurosnap run` starts one itself, unless it is given --connect.
    """
    from neurosnap.fabric.zenoh.denied_log import telling_refusals
    from neurosnap.fabric.zenoh.hub import hub_document, open_hub
    from neurosnap.fabric.zenoh.links import follow_links

    with errors():
        endpoints, links = listen or [_HERE], link or []
        if print_config and tls:
            tls = str(Path(tls).absolute())  # for a router started anywhere
        networks = [
            convert(Network, listen=endpoint, tls=tls, insecure=insecure)
            for endpoint in endpoints
        ]
        for network in networks:
            network.check()
        credentials = networks[0].credentials("hub")
        document = hub_document(
            endpoints, sessions, links=links, credentials=credentials, insecure=insecure
        )
        if print_config:
            typer.echo(msgspec.json.format(msgspec.json.encode(document)))
            return

        def tell(text: str) -> None:
            screen.print(text, markup=False, soft_wrap=True)

        async def serve(stop: asyncio.Event) -> None:
            session = await asyncio.to_thread(
                open_hub,
                endpoints,
                sessions,
                links=links,
                credentials=credentials,
                insecure=insecure,
            )
            try:
                tell(f"listening on {', '.join(endpoints)}")
                await follow_links(session, links, stop, tell, credentials)
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
