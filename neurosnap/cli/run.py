"""``neurosnap run``: a source through a swarm."""

import math
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.agent.policy import EXPLORE, AgentKind
from neurosnap.cli.shared import (
    LOST,
    Insecure,
    Json,
    Tls,
    app,
    at_most,
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
from neurosnap.source import Argument
from neurosnap.swarm.network import Network
from neurosnap.swarm.options import CellKind, RunOptions, SnapshotKind, WiringKind
from neurosnap.swarm.supervision import RestartKind, Supervision


@app.command()
def run(
    source: Annotated[
        str, typer.Argument(help="A world's id (neurosnap/Path-v0) or a CSV file.")
    ],
    ticks: Annotated[
        int | None,
        typer.Option(help="Observations to take. [default: 300, or a whole CSV]"),
    ] = None,
    seed: Annotated[int, typer.Option(help="Draws all that is random.")] = 0,
    agent: Annotated[AgentKind, typer.Option(help="Who decides.")] = "walker",
    target: Annotated[
        str | None,
        typer.Option(
            help="What a planner wants to sense (below_5,below_4*), or the place an"
            " excited agent is drawn to. [default: for excited, drawn by the seed]"
        ),
    ] = None,
    explore: Annotated[
        float, typer.Option(help="Share of random actions, in [0, 1].")
    ] = EXPLORE,
    given: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="An argument of the world."),
    ] = None,
    snapshot: Annotated[
        SnapshotKind, typer.Option(help="How weights are learned.")
    ] = "empirical",
    threshold: Annotated[
        float | None, typer.Option(help="Learning threshold, in (0, 0.25].")
    ] = None,
    decay: Annotated[
        float | None, typer.Option(help="Decay of a discounted snapshot, in [0, 1).")
    ] = None,
    wiring: Annotated[
        WiringKind, typer.Option(help="Which edges carry pulses.")
    ] = "hasse",
    cells: Annotated[
        CellKind,
        typer.Option(help="One OS process a cell, one for many, or all in this one."),
    ] = "process",
    workers: Annotated[int, typer.Option(help="Processes that have many cells.")] = 2,
    out: Annotated[
        Path | None, typer.Option(help="Where to record. [default: logs/…]")
    ] = None,
    record: Annotated[bool, typer.Option(help="Record at all.")] = True,
    deadline: Annotated[float, typer.Option(help="Seconds a wave may take.")] = 10.0,
    restart: Annotated[
        RestartKind, typer.Option(help="Go on when a part of the swarm dies.")
    ] = "on-failure",
    max_restarts: Annotated[
        int, typer.Option(help="How often, before the run is given up.")
    ] = 10,
    backoff: Annotated[
        float, typer.Option(help="Seconds before going on; doubles without progress.")
    ] = 0.1,
    listen: Annotated[
        str,
        typer.Option(
            metavar="ENDPOINT", help="Where the hub listens. [default: on a socket]"
        ),
    ] = "",
    connect: Annotated[
        str, typer.Option(metavar="ENDPOINT", help="A hub that is there already.")
    ] = "",
    swarm: Annotated[
        str, typer.Option(metavar="ID", help="Its id. [default: a random one]")
    ] = "",
    elsewhere: Annotated[
        str,
        typer.Option(metavar="RANGES", help="Cells that `neurosnap join` starts."),
    ] = "",
    tls: Tls = "",
    insecure: Insecure = False,
    audit: Annotated[
        bool, typer.Option("--audit", help="Log every refused message; slow.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Run a source through a swarm of cells and record everything."""
    from neurosnap import show
    from neurosnap.source import open_source
    from neurosnap.swarm.embody import body_of, drawn_to
    from neurosnap.swarm.endure import run_on
    from neurosnap.swarm.run import run as run_swarm

    with errors():
        arguments = _arguments(given or [])
        wanted: tuple[str, ...] = ()
        if agent == "excited":
            arguments |= drawn_to(source, seed, arguments, target)
        elif target is not None:
            wanted = tuple(name.strip() for name in target.split(","))
        opened = open_source(source, seed, arguments)
        opened.close()
        options = _options(
            source=source,
            arguments=arguments,
            body=body_of(opened, agent),
            agent=agent,
            target=wanted,
            explore=explore,
            ticks=at_most(ticks, opened.length),
            seed=seed,
            snapshot=snapshot,
            threshold=threshold,
            decay=decay,
            wiring=wiring,
            cells=cells,
            workers=workers,
            deadline=deadline,
        )
        supervision = convert(
            Supervision,
            restart=restart,
            max_restarts=max_restarts,
            backoff=backoff,
        )
        network = convert(
            Network,
            listen=listen,
            connect=connect,
            tls=tls,
            insecure=insecure,
            audit=audit,
        )
        network.check()
        away = _away(elsewhere, swarm, network, options)
        log = new_log(source, out) if record else None
        with show.progress(screen, "ticks", options.ticks) as on_progress:
            outcome = run_async(
                lambda stop: (
                    run_swarm(
                        options,
                        log,
                        stop,
                        on_progress,
                        network=network,
                        swarm=swarm,
                        elsewhere=away,
                    )
                    # Cells elsewhere cannot be told to begin anew.
                    if log is None or options.cells == "inline" or away
                    else run_on(
                        options,
                        log,
                        stop,
                        supervision,
                        on_progress=on_progress,
                        on_restart=lambda event: show.restart(screen, event),
                        network=network,
                    )
                )
            )
        show.outcome(say(as_json), options, outcome, log)
        if as_json:
            print_json(show.outcome_facts(options, outcome, log))
        if outcome.completeness is not None and not outcome.completeness.whole:
            raise typer.Exit(LOST)


def _away(
    elsewhere: str, swarm: str, network: Network, options: RunOptions
) -> frozenset[str]:
    """Return the parts that somebody else starts."""
    if swarm and not swarm.isalnum():
        raise InvalidValueError("swarm", "must be letters and digits", swarm)
    if not elsewhere:
        return frozenset()
    if options.cells != "process":
        rule = "must go with cells that are processes"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    if not swarm or not (network.listen or network.connect):
        rule = "must come with --swarm ID, and --listen or --connect"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    numbers = ranges("elsewhere", elsewhere)
    if numbers[-1] >= len(options.sensors):
        rule = f"must be cells of the swarm, 0 to {len(options.sensors) - 1}"
        raise InvalidValueError("elsewhere", rule, elsewhere)
    return frozenset(f"cell/{number}" for number in numbers)


def _options(**given: object) -> RunOptions:
    """Return the options, checked: a wrong one is refused before anything starts."""
    options = convert(RunOptions, **given)
    if math.isinf(options.deadline):  # JSON has no word for it
        raise InvalidValueError("deadline", "must be finite", options.deadline)
    options.new_snapshot()
    options.new_policy()
    options.host_names()
    return options


def _arguments(given: list[str]) -> dict[str, Argument]:
    """Return the world's arguments: JSON's numbers, true, false; anything else text."""
    arguments: dict[str, Argument] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not equals or not name.isidentifier():
            raise InvalidValueError("set", "must be NAME=VALUE", text)
        try:
            arguments[name] = msgspec.json.decode(value, type=Argument)
        except msgspec.DecodeError:
            arguments[name] = value
    return arguments
