"""The options of a run, declared once for every verb that makes one."""

from typing import Annotated

import typer

from neurosnap.agent.policy import AgentKind
from neurosnap.swarm.options import SnapshotKind, WiringKind

Source = Annotated[
    str, typer.Argument(help="A world's id (neurosnap/Path-v0) or a CSV file.")
]
Described = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="A world's id (neurosnap/Path-v0), a CSV file (names, then 0 or 1; a first"
        " column `time` is left out), or a TOML file that describes"
        " a run; flags go before what it says.",
    ),
]
Ticks = Annotated[
    int | None,
    typer.Option(help="Observations to take. \\[default: 300, or a whole CSV]"),
]
Seed = Annotated[int, typer.Option(help="Draws all that is random.")]
Agent = Annotated[AgentKind, typer.Option(help="Who decides.")]
Target = Annotated[
    str | None,
    typer.Option(
        help="What a planner wants to sense (below_5,below_4*), or the place an"
        " excited agent is drawn to. \\[default: for excited, drawn by the seed]"
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
Anomalies = Annotated[
    bool, typer.Option(help="Tell of observations against what was learned.")
]
Hold = Annotated[
    int,
    typer.Option(
        metavar="TICKS", help="For how long to judge by what the first one broke."
    ),
]
Sync = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        help="Write the recording to the disk this often; 0: at the end. \\[default: 1"
        " for readings from outside, else 0]",
    ),
]
Deadline = Annotated[float, typer.Option(help="Seconds a wave may take.")]
