"""The options of a run, declared once for every verb that makes one."""

import math
from typing import Annotated

import msgspec
import typer

from neurosnap.agent.policy import AgentKind
from neurosnap.cli.shared import at_most, convert
from neurosnap.errors import InvalidValueError
from neurosnap.source import Argument
from neurosnap.swarm.options import CellKind, RunOptions, SnapshotKind, WiringKind

Source = Annotated[
    str, typer.Argument(help="A world's id (neurosnap/Path-v0) or a CSV file.")
]
Ticks = Annotated[
    int | None,
    typer.Option(help="Observations to take. [default: 300, or a whole CSV]"),
]
Seed = Annotated[int, typer.Option(help="Draws all that is random.")]
Agent = Annotated[AgentKind, typer.Option(help="Who decides.")]
Target = Annotated[
    str | None,
    typer.Option(
        help="What a planner wants to sense (below_5,below_4*), or the place an"
        " excited agent is drawn to. [default: for excited, drawn by the seed]"
    ),
]
Explore = Annotated[float, typer.Option(help="Share of random actions, in [0, 1].")]
Given = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="An argument of the world."),
]
Snapshot = Annotated[SnapshotKind, typer.Option(help="How weights are learned.")]
Threshold = Annotated[
    float | None, typer.Option(help="Learning threshold, in (0, 0.25].")
]
Decay = Annotated[
    float | None, typer.Option(help="Decay of a discounted snapshot, in [0, 1).")
]
Wiring = Annotated[WiringKind, typer.Option(help="Which edges carry pulses.")]
Workers = Annotated[int, typer.Option(help="Processes that have many cells.")]
Deadline = Annotated[float, typer.Option(help="Seconds a wave may take.")]


FOREVER = 2**31 - 1
"""Ticks of a run that ends when it is told to: the most a message can say."""


def run_options(
    *,
    source: str,
    ticks: int | None,
    seed: int,
    agent: AgentKind,
    target: str | None,
    explore: float,
    given: list[str] | None,
    snapshot: SnapshotKind,
    threshold: float | None,
    decay: float | None,
    wiring: WiringKind,
    cells: CellKind,
    workers: int,
    deadline: float,
) -> RunOptions:
    """Return the options, checked: a wrong one is refused before anything starts.

    Raises:
        InvalidValueError: One breaks its rule, or there is no such source.
    """
    from neurosnap.outside.open import settle
    from neurosnap.source import open_source
    from neurosnap.swarm.embody import body_of, drawn_to

    arguments = settle(source, _arguments(given or []))
    wanted: tuple[str, ...] = ()
    if agent == "excited":
        arguments |= drawn_to(source, seed, arguments, target)
    elif target is not None:
        wanted = tuple(name.strip() for name in target.split(","))
    opened = open_source(source, seed, arguments)
    opened.close()
    options = convert(
        RunOptions,
        source=source,
        arguments=arguments,
        body=body_of(opened, agent),
        agent=agent,
        target=wanted,
        explore=explore,
        ticks=at_most(ticks, FOREVER if opened.live else opened.length),
        seed=seed,
        snapshot=snapshot,
        threshold=threshold,
        decay=decay,
        wiring=wiring,
        cells=cells,
        workers=workers,
        deadline=deadline,
    )
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
