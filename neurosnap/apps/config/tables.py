"""TOML tables that describe a run, one struct per table.

Every default is the one that the run has without a file: it is taken from there, not
written down again. What has none may be left out, and is None then.
"""

from typing import Annotated, Any, TypeAlias

import msgspec

from neurosnap.agent.growth.birth import Birth
from neurosnap.apps.config.sources import SourceTable, Text
from neurosnap.health.budget import NEVER, parse_budget
from neurosnap.protocol.option import option
from neurosnap.protocol.run_options import (
    AUTO_CELLS,
    Agent,
    Alarms,
    Anomalies,
    Cells,
    Deadline,
    Decay,
    Explore,
    Frames,
    Grow,
    Hold,
    Imagine,
    Keep,
    KeyframeEvery,
    Learning,
    RunOptions,
    Seed,
    SnapshotOption,
    Split,
    Support,
    Sync,
    Threshold,
    Ticks,
    Wiring,
    Workers,
)
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.placement import HERE, Placement
from neurosnap.runtime.restart_policy import Supervision

_DEFAULTS: dict[str, Any] = {
    field.name: field.default for field in msgspec.structs.fields(RunOptions)
}

Natural: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]


class RunTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long it runs, and what is random in it."""

    ticks: Ticks | None = None
    seed: Seed = _DEFAULTS["seed"]


class AgentTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who decides."""

    kind: Agent = _DEFAULTS["agent"]
    target: Annotated[
        Natural | Text | tuple[Text, ...] | None,
        option(
            "For a planner: the sensors to switch on, with a star to switch off"
            " (below_5,below_4*). For an excited agent: the number of a place.",
            default="for an excited agent, a random place",
        ),
    ] = None
    explore: Explore = _DEFAULTS["explore"]
    grow: Grow = 0
    births: tuple[Birth, ...] = ()
    """Sensors that are grown at given ticks, besides those that the agent may grow."""
    imagine: Imagine = _DEFAULTS["imagine"]


class SnapshotTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How the weights are learned."""

    kind: SnapshotOption = _DEFAULTS["snapshot"]
    threshold: Threshold | None = None
    decay: Decay | None = None
    learning: Learning = _DEFAULTS["learning"]


class CellsTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the cells are, and how they are wired."""

    kind: Cells = AUTO_CELLS
    workers: Workers | None = None
    wiring: Wiring = _DEFAULTS["wiring"]
    deadline: Deadline = _DEFAULTS["deadline"]


class AnomaliesTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """What is reported of observations against what was learned."""

    # A run that somebody starts reports them; one that a program makes is asked to.
    watch: Anomalies = True
    hold: Hold = _DEFAULTS["hold"]
    support: Support = _DEFAULTS["support"]


class HealthTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """What is told of sensors that seem broken."""

    alarms: Alarms | None = None

    def __post_init__(self) -> None:
        if self.alarms not in (None, NEVER):
            parse_budget(self.alarms)


class RecordingTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """Where the run is recorded."""

    path: Annotated[
        Text | None,
        option(
            "Where to record; must not exist yet.",
            flag="out",
            unit="FILE.mcap",
            default="logs/SOURCE-DATE.mcap",
        ),
    ] = None
    folder: Annotated[
        Text | None,
        option(
            "Record in this folder, each run under a new name, where no path is given.",
            unit="DIR",
            default="logs",
        ),
    ] = None
    record: Annotated[
        bool,
        option(
            "Record everything. Without a recording nothing can be replayed, and the run"
            " cannot go on after a failure."
        ),
    ] = True
    keyframe_every: KeyframeEvery = _DEFAULTS["keyframe_every"]
    frames: Frames = _DEFAULTS["frames"]
    split: Split = _DEFAULTS["split"]
    keep: Keep = _DEFAULTS["keep"]
    sync: Sync | None = None


class Config(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A run of neurosnap. Paths are relative to this file."""

    source: SourceTable
    """Where the observations come from."""
    run: RunTable = RunTable()
    """How long it runs, and what is random in it."""
    agent: AgentTable = AgentTable()
    """Who decides."""
    snapshot: SnapshotTable = SnapshotTable()
    """How the weights are learned."""
    cells: CellsTable = CellsTable()
    """Where the cells are, and how they are wired."""
    anomalies: AnomaliesTable = AnomaliesTable()
    """What is reported of observations against what was learned."""
    health: HealthTable = HealthTable()
    """What is told of sensors that seem broken."""
    recording: RecordingTable = RecordingTable()
    """Where the run is recorded."""
    supervision: Supervision = Supervision()
    """What happens when a part dies."""
    network: Network = PRIVATE
    """How the parts reach each other."""
    placement: Placement = HERE
    """Where the parts are."""
