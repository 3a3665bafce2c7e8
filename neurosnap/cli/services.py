"""Verbs for parts of a swarm that are a service of their own: world, record, join.

They are told where the hub is and what the swarm is called; what the run is they are
told by its coordinator (`neurosnap coordinate`, or `run --elsewhere`).
"""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.cli.options import Source
from neurosnap.cli.shared import (
    LOST,
    Connect,
    Insecure,
    Json,
    Tls,
    app,
    check_swarm,
    convert,
    errors,
    new_log,
    print_json,
    ranges,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.swarm.network import Network
from neurosnap.swarm.supervision import RestartKind

if TYPE_CHECKING:
    from neurosnap.swarm.join import Share
    from neurosnap.swarm.service import Served

Swarm = Annotated[str, typer.Argument(metavar="SWARM", help="The swarm's id.")]
Restart = Annotated[
    RestartKind,
    typer.Option(
        help="What follows a swarm: on-failure, where a part had died, the one that"
        " goes on in its place; always, whatever comes under this id, until Ctrl-C."
    ),
]
Patience = Annotated[
    float, typer.Option(help="Seconds until its coordinator must be there.")
]


@app.command()
def world(
    swarm: Swarm,
    source: Source,
    connect: Connect,
    restart: Restart = "on-failure",
    patience: Patience = 60.0,
    tls: Tls = "",
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Be the world of a swarm; its arguments and its seed come from the coordinator."""
    from neurosnap.swarm import join

    with errors():
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        share = join.world(source)
        served = _serve("world", swarm, share, network, restart, patience)
        if as_json:
            print_json({"swarm": swarm, "source": source, "served": _names(served)})


@app.command()
def record(
    swarm: Swarm,
    connect: Connect,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Where to record; a second swarm goes beside it. \\[default: logs/…]"
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="LOG",
            help="For a run that is resumed: its recording, to be taken over.",
        ),
    ] = None,
    sync: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            help="Write the recording to the disk this often; 0: at the end."
            " \\[default: as the coordinator says]",
        ),
    ] = None,
    restart: Restart = "on-failure",
    patience: Patience = 60.0,
    tls: Tls = "",
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Be the recorder of a swarm."""
    from neurosnap.record.sequences import Completeness
    from neurosnap.swarm import join

    logs: list[Path] = []

    def next_log() -> Path:
        path = new_log(swarm, _numbered(out, len(logs)))
        logs.append(path)
        return path

    with errors():
        if out is not None:
            new_log(swarm, out)  # refused now, and not once the swarm is there
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        share = join.recorder(next_log, resume, sync)
        served = _serve("recorder", swarm, share, network, restart, patience)
        balances = [
            msgspec.json.decode(one.results["recorder"], type=Completeness)
            for one in served
            if "recorder" in one.results
        ]
        if resume is not None:
            logs = [_written(log) for log in logs]
        for log in logs:
            say(as_json).print(f"recording: {log}", markup=False, soft_wrap=True)
        whole = all(balance.whole for balance in balances)
        if as_json:
            facts = {"logs": [str(log) for log in logs], "complete": whole}
            print_json({"swarm": swarm, **facts, "served": _names(served)})
        if not whole:
            raise typer.Exit(LOST)


@app.command()
def join(
    swarm: Swarm,
    connect: Connect,
    cells: Annotated[
        str, typer.Option(metavar="RANGES", help="Which cells: 0-499 or 3,7,9-12.")
    ] = "",
    workers: Annotated[
        str, typer.Option(metavar="RANGES", help="Or which workers, with their cells.")
    ] = "",
    restart: Restart = "on-failure",
    patience: Patience = 60.0,
    tls: Tls = "",
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Be a share of a swarm's cells, or of its workers."""
    from neurosnap.swarm import join

    with errors():
        if bool(cells) == bool(workers):
            rule = "must say which --cells, or which --workers"
            raise InvalidValueError("join", rule, cells or "neither")
        kind, text = ("cells", cells) if cells else ("workers", workers)
        numbers = ranges(kind, text)
        share = join.cells(numbers) if cells else join.workers(numbers)
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        named = f"{len(numbers)} {kind}"
        served = _serve(named, swarm, share, network, restart, patience)
        if as_json:
            print_json({"swarm": swarm, kind: numbers, "served": _names(served)})


def _serve(
    what: str,
    swarm: str,
    share: "Share",
    network: Network,
    restart: RestartKind,
    patience: float,
) -> "list[Served]":
    """Serve until it is over; return the swarms served."""
    from neurosnap.swarm.service import serve

    served: list[Served] = []

    def note(one: "Served") -> None:
        served.append(one)
        if one.trouble:
            text = f"swarm {one.swarm}: {one.trouble}"
            screen.print(text, markup=False, soft_wrap=True)

    async def work(stop: asyncio.Event) -> None:
        screen.print(f"{what} for swarm {swarm}", markup=False)
        await serve(
            share,
            network,
            swarm,
            stop,
            restart=restart,
            patience=patience,
            on_served=note,
        )

    check_swarm(swarm)
    run_async(work)
    return served


def _numbered(out: Path | None, before: int) -> Path | None:
    """Return where to record one more swarm: ``a.mcap``, ``a-1.mcap``, and so on."""
    if out is None or not before:
        return out
    return out.with_name(f"{out.stem}-{before}{out.suffix}")


def _written(log: Path) -> Path:
    """Return the file that a resumed run was recorded in: one of several, maybe."""
    from neurosnap.record.whole import part_paths

    return next(iter(part_paths(log).values()), log)


def _names(served: "list[Served]") -> list[str]:
    return [one.swarm for one in served]
