"""Command-line options of a run that several verbs share.

In the help they stand in groups, which are named here.
"""

from typing import Annotated

import typer

from neurosnap.agent.policy import AgentKind
from neurosnap.poc.learning.kinds import DiscountedSnapshot, EmpiricalSnapshot
from neurosnap.protocol.run_options import SnapshotKind, WiringKind

SOURCE = "Source"
AGENT = "Agent"
LEARNING = "Learning"
CELLS = "Cells"
RECORDING = "Recording"
NETWORK = "Network"
SUPERVISION = "Supervision"
FLAG = ""
"""What stands beside a flag that takes no value."""

Source = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE", help="The id of a world (neurosnap/Path-v0), or a CSV file."
    ),
]
Described = Annotated[
    str,
    typer.Argument(
        metavar="SOURCE",
        help="The id of a world (neurosnap/Path-v0); or a CSV file: a line of sensor"
        " names, then a line of 0s and 1s for each tick (a first column `time` is left"
        " out); or a TOML file that describes the whole run. Options on the command line"
        " override that file.",
    ),
]
Ticks = Annotated[
    int | None,
    typer.Option(
        rich_help_panel=SOURCE,
        help="How many observations to take, at most.",
        show_default="300; of a CSV file, all; from outside, until Ctrl-C",
    ),
]
Seed = Annotated[
    int,
    typer.Option(
        rich_help_panel=SOURCE,
        help="Seed of all random numbers. The same seed gives the same run of a world.",
    ),
]
Given = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="NAME=VALUE",
        rich_help_panel=SOURCE,
        help="Set an argument of the world, such as places=10. May be repeated.",
    ),
]
Agent = Annotated[
    AgentKind,
    typer.Option(
        rich_help_panel=AGENT,
        help="Who chooses the actions. A walker acts at random, an excited agent moves"
        " towards a place, a planner plans its way to what --target names.",
    ),
]
Target = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=AGENT,
        help="For a planner: the sensors to switch on, with a star to switch off"
        " (below_5,below_4*). For an excited agent: the number of a place.",
        show_default="for an excited agent, a random place",
    ),
]
Explore = Annotated[
    float,
    typer.Option(
        rich_help_panel=AGENT,
        help="Share of actions that are random all the same, from 0 to 1. A walker's all"
        " are.",
    ),
]
Snapshot = Annotated[
    SnapshotKind,
    typer.Option(
        rich_help_panel=LEARNING,
        help="How to learn. Empirical: count, and forget nothing. Discounted: forget"
        " slowly, so that habits may change.",
    ),
]
Threshold = Annotated[
    float | None,
    typer.Option(
        rich_help_panel=LEARNING,
        help="How rare the exceptions to an implication must be, as a share of all"
        " ticks: above 0, up to 0.25. Greater: more implications, and more wrong ones.",
        show_default=f"{EmpiricalSnapshot.THRESHOLD:g};"
        f" discounted, {DiscountedSnapshot.THRESHOLD:g}",
    ),
]
Decay = Annotated[
    float | None,
    typer.Option(
        rich_help_panel=LEARNING,
        help="With --snapshot discounted: how much of the past is kept at each tick,"
        " from 0 to below 1.",
        show_default=f"{DiscountedSnapshot.DECAY:g}",
    ),
]
Anomalies = Annotated[
    bool,
    typer.Option(
        metavar=FLAG,
        rich_help_panel=LEARNING,
        help="Record each observation that contradicts what was learned before it;"
        " `neurosnap watch` shows them.",
    ),
]
Hold = Annotated[
    int,
    typer.Option(
        metavar="TICKS",
        rich_help_panel=LEARNING,
        help="After an anomaly, judge this many more ticks by what was learned before"
        " it, so that a lasting fault is reported as long as it lasts. 0: it is reported"
        " when it begins, and may be learned as normal then.",
    ),
]
Wiring = Annotated[
    WiringKind,
    typer.Option(
        rich_help_panel=CELLS,
        help="Which implications are connections between cells. Hasse: only those that"
        " do not follow from others (fewer messages). Derived: all (fewer hops).",
    ),
]
Workers = Annotated[
    int,
    typer.Option(
        rich_help_panel=CELLS, help="With --cells worker: how many processes there are."
    ),
]
Deadline = Annotated[
    float,
    typer.Option(
        metavar="SECONDS",
        rich_help_panel=CELLS,
        help="How long the cells may take to answer before they are asked again.",
    ),
]
Sync = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        rich_help_panel=RECORDING,
        help="How often to force the recording to the disk, against a power cut. 0: only"
        " at the end.",
        show_default="1 for readings from outside, else 0",
    ),
]
