"""``neurosnap run``: a source through a swarm."""

import math
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from neurosnap.agent.policy import EXPLORE, AgentKind
from neurosnap.cli.shared import (
    LOST,
    Json,
    app,
    at_most,
    errors,
    new_log,
    print_json,
    run_async,
    say,
    screen,
)
from neurosnap.errors import InvalidValueError
from neurosnap.source import Argument
from neurosnap.swarm.options import CellKind, RunOptions, SnapshotKind, WiringKind


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
        CellKind, typer.Option(help="One OS process a cell, or all in this one.")
    ] = "process",
    out: Annotated[
        Path | None, typer.Option(help="Where to record. [default: logs/…]")
    ] = None,
    record: Annotated[bool, typer.Option(help="Record at all.")] = True,
    deadline: Annotated[float, typer.Option(help="Seconds a wave may take.")] = 10.0,
    as_json: Json = False,
) -> None:
    """Run a source through a swarm of cells and record everything."""
    from neurosnap import show
    from neurosnap.source import open_source
    from neurosnap.swarm.embody import body_of, drawn_to
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
            deadline=deadline,
        )
        log = new_log(source, out) if record else None
        with show.progress(screen, "ticks", options.ticks) as on_progress:
            outcome = run_async(lambda stop: run_swarm(options, log, stop, on_progress))
        show.outcome(say(as_json), options, outcome, log)
        if as_json:
            print_json(show.outcome_facts(options, outcome, log))
        if outcome.completeness is not None and not outcome.completeness.whole:
            raise typer.Exit(LOST)


def _options(**given: object) -> RunOptions:
    """Return the options, checked: a wrong one is refused before anything starts."""
    try:
        options = msgspec.convert(given, RunOptions)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at ")
        name = place.strip("`$.") or "options"
        raise InvalidValueError(name, reason, given.get(name)) from error
    if math.isinf(options.deadline):  # JSON has no word for it
        raise InvalidValueError("deadline", "must be finite", options.deadline)
    options.new_snapshot()
    options.new_policy()
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
