"""``neurosnap world``, ``record`` and ``join``: parts started on other machines.

They are told where the hub is and what the swarm is called; what the run is they are
told by its coordinator (`neurosnap coordinate`, or `run --elsewhere`).
"""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import msgspec
import typer

from neurosnap.apps.cli.options import CELLS, NETWORK, RECORDING, Source, option
from neurosnap.apps.cli.shared import (
    LOST,
    Connect,
    Json,
    app,
    check_swarm,
    convert,
    errors,
    new_log,
    open_ranges,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.runtime.network import Network
from neurosnap.runtime.restart_policy import RestartKind

if TYPE_CHECKING:
    from neurosnap.runtime.hosts.remote_parts import ChooseParts
    from neurosnap.runtime.hosts.service import Served

Swarm = Annotated[
    str,
    typer.Argument(
        metavar="SWARM", help="Name of the swarm, as the coordinator's --swarm has it."
    ),
]
_RESTART = (
    "When the swarm has ended: leave (never); wait for the one that goes on in its place,"
    " if a part had died (on-failure); wait for the next of this name, until Ctrl-C"
    " (always)."
)
Patience = Annotated[
    float,
    typer.Option(
        metavar="SECONDS",
        rich_help_panel=NETWORK,
        help="How long to wait for the coordinator.",
    ),
]


@app.command()
def world(
    swarm: Swarm,
    source: Source,
    connect: Connect,
    restart: RestartKind = option("restart", _RESTART),
    patience: Patience = 60.0,
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    as_json: Json = False,
) -> None:
    """Provide the observations of a swarm: a part of `neurosnap coordinate`.

    SOURCE must be the coordinator's; the arguments and the seed come from there.
    """
    from neurosnap.runtime.hosts import remote_parts

    with errors():
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        choose = remote_parts.world(source)
        served = _serve("world", swarm, choose, network, restart, patience)
        if as_json:
            print_json({"swarm": swarm, "source": source, "served": _names(served)})


@app.command()
def record(
    swarm: Swarm,
    connect: Connect,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap",
            rich_help_panel=RECORDING,
            help="Where to record; must not exist yet. A swarm that follows is recorded"
            " beside it, as FILE-1.mcap.",
            show_default="logs/SWARM-DATE.mcap",
        ),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(
            metavar="LOG",
            rich_help_panel=RECORDING,
            help="The recording that the coordinator's --resume names, to go on with.",
        ),
    ] = None,
    sync: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            min=0.0,
            rich_help_panel=RECORDING,
            help="How often to force the recording to the disk, against a power cut. 0:"
            " only at the end.",
            show_default="as the coordinator says",
        ),
    ] = None,
    restart: RestartKind = option("restart", _RESTART),
    patience: Patience = 60.0,
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    as_json: Json = False,
) -> None:
    """Record a swarm on this machine: a part of `neurosnap coordinate`."""
    from neurosnap.recording.format.completeness import Completeness
    from neurosnap.runtime.hosts import remote_parts

    logs: list[Path] = []

    def next_log() -> Path:
        path = new_log(swarm, _numbered(out, len(logs)))
        logs.append(path)
        return path

    with errors():
        if out is not None:
            new_log(swarm, out)  # refused now, and not once the swarm is there
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        choose = remote_parts.recorder(next_log, resume, sync)
        served = _serve("recorder", swarm, choose, network, restart, patience)
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
        str,
        typer.Option(
            metavar="RANGES",
            rich_help_panel=CELLS,
            help="The numbers of the cells to run here: 0-499, or 3,7,9-12, or 20- for"
            " all from 20 on.",
        ),
    ] = "",
    workers: Annotated[
        str,
        typer.Option(
            metavar="RANGES",
            rich_help_panel=CELLS,
            help="The numbers of the workers to run here, where the run has --cells"
            " worker.",
        ),
    ] = "",
    restart: RestartKind = option("restart", _RESTART),
    patience: Patience = 60.0,
    tls: str = option("tls"),
    insecure: bool = option("insecure"),
    as_json: Json = False,
) -> None:
    """Run some of a swarm's cells, or workers, on this machine."""
    from neurosnap.runtime.hosts import remote_parts

    with errors():
        if bool(cells) == bool(workers):
            rule = "must say which --cells, or which --workers"
            raise InvalidValueError("join", rule, cells or "neither")
        kind, text = ("cells", cells) if cells else ("workers", workers)
        numbers = open_ranges(kind, text)
        choose = remote_parts.cells(numbers) if cells else remote_parts.workers(numbers)
        network = convert(Network, connect=connect, tls=tls, insecure=insecure)
        open_end = numbers.rest is not None
        named = f"{kind} {text}" if open_end else f"{len(numbers.some)} {kind}"
        served = _serve(named, swarm, choose, network, restart, patience)
        if as_json:
            facts = {kind: numbers.some, **({"from": numbers.rest} if open_end else {})}
            print_json({"swarm": swarm, **facts, "served": _names(served)})


def _serve(
    what: str,
    swarm: str,
    choose: "ChooseParts",
    network: Network,
    restart: RestartKind,
    patience: float,
) -> "list[Served]":
    """Serve until it is over; return the swarms served."""
    from neurosnap.runtime.hosts.service import serve

    served: list[Served] = []

    def note(one: "Served") -> None:
        served.append(one)
        if one.trouble:
            text = f"swarm {one.swarm}: {one.trouble}"
            screen.print(text, markup=False, soft_wrap=True)

    async def work(stop: asyncio.Event) -> None:
        screen.print(f"{what} for swarm {swarm}", markup=False)
        await serve(
            choose,
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
    from neurosnap.recording.read.recording import part_paths

    return next(iter(part_paths(log).values()), log)


def _names(served: "list[Served]") -> list[str]:
    return [one.swarm for one in served]
