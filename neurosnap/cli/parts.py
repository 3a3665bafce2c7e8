"""Verbs for a hub of its own, and for the swarms that run on this machine."""

import asyncio
from typing import Annotated

import msgspec
import typer

from neurosnap.cli.shared import (
    Insecure,
    Json,
    Tls,
    app,
    convert,
    errors,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.swarm.network import Network


@app.command()
def hub(
    listen: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="Where it listens.")
    ] = "tcp/127.0.0.1:7447",
    tls: Tls = "",
    insecure: Insecure = False,
    audit: Annotated[
        bool, typer.Option("--audit", help="Log every refused message; slow.")
    ] = False,
    sessions: Annotated[int, typer.Option(help="How many parts may connect.")] = 10_000,
    as_json: Json = False,
) -> None:
    """Be a hub for swarms that are started with --connect, until Ctrl-C."""
    from neurosnap.fabric.hub import open_hub
    from neurosnap.fabric.refusals import telling_refusals

    with errors():
        network = convert(Network, listen=listen, tls=tls, insecure=insecure)
        network.check()

        async def serve(stop: asyncio.Event) -> None:
            session = await asyncio.to_thread(
                open_hub,
                [listen],
                sessions,
                credentials=network.credentials("hub"),
                insecure=insecure,
            )
            try:
                screen.print(f"listening on {listen}", markup=False)
                await stop.wait()
            finally:
                await asyncio.to_thread(session.close)

        with telling_refusals(audit=audit):
            run_async(serve)
        if as_json:
            print_json({"listened": listen})


@app.command()
def ps(
    swarm: Annotated[
        str | None,
        typer.Argument(metavar="[SWARM]", help="Show the parts of this one."),
    ] = None,
    as_json: Json = False,
) -> None:
    """List the swarms that run on this machine, or the parts of one."""
    from neurosnap import show
    from neurosnap.swarm import registry

    with errors():
        if swarm is None:
            notes = registry.swarms()
            show.swarms(say(as_json), notes)
            if as_json:
                print_json({"swarms": msgspec.to_builtins(notes)})
        else:
            note = registry.find(swarm)
            parts = registry.parts(note)
            show.parts(say(as_json), note, parts)
            if as_json:
                facts = msgspec.to_builtins(note)
                print_json({**facts, "parts": msgspec.to_builtins(parts)})


@app.command()
def stop(
    swarm: Annotated[str, typer.Argument(help="Its id, as `neurosnap ps` says it.")],
    patience: Annotated[
        float, typer.Option(help="Seconds to wait for its end.")
    ] = 30.0,
    as_json: Json = False,
) -> None:
    """End one swarm in order: its recording is finished, nothing is left running."""
    from neurosnap.swarm import registry

    with errors():
        note = registry.find(swarm)
        registry.stop(note, patience)
        say(as_json).print(f"stopped {swarm}", markup=False)
        if as_json:
            print_json({"stopped": swarm, "log": note.log})
