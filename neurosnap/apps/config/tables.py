"""TOML tables that describe a run, one struct per table.

Every default is the one that the run has without a file: it is taken from there, not
written down again. Whatever has none may be left out, and is `UNSET` then.
"""

from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import UNSET, UnsetType

from neurosnap.agent.policy import AgentKind
from neurosnap.apps.config.sources import SourceTable, Text
from neurosnap.protocol.run_options import (
    CellKind,
    Count,
    Decay,
    RunOptions,
    Seconds,
    Seed,
    Share,
    SnapshotKind,
    Threshold,
    WiringKind,
)
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.restart_policy import Supervision

_DEFAULTS: dict[str, Any] = {
    field.name: field.default for field in msgspec.structs.fields(RunOptions)
}

Natural: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]
NotNegative: TypeAlias = Annotated[float, msgspec.Meta(ge=0)]


class RunTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How long it runs, and what is random in it."""

    ticks: Count | UnsetType = UNSET
    """Observations to take, at most; left out: 300, or all that a file has, or all that
    come from outside."""
    seed: Seed = _DEFAULTS["seed"]
    """Draws the world's start, its fields and the random actions."""


class AgentTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Who decides."""

    kind: AgentKind = _DEFAULTS["agent"]
    """A walker acts at random, an excited agent is drawn to a place, a planner plans
    its way to a target."""
    target: Natural | Text | tuple[Text, ...] | UnsetType = UNSET
    """What a planner wants to sense, one name or several; or the number of the place an
    excited agent is drawn to; left out there: drawn by the seed."""
    explore: Share = _DEFAULTS["explore"]
    """The share of random actions, where the agent has anything better to do."""


class SnapshotTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """How the weights are learned."""

    kind: SnapshotKind = _DEFAULTS["snapshot"]
    """An empirical snapshot counts, a discounted one forgets."""
    threshold: Threshold | UnsetType = UNSET
    """The learning threshold of every pair; left out: the snapshot's own default."""
    decay: Decay | UnsetType = UNSET
    """The decay of a discounted snapshot; left out: its own default."""


class CellsTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the cells are, and how they are wired."""

    kind: CellKind = _DEFAULTS["cells"]
    """One OS process a cell, or one for many, or all in this one."""
    workers: Count = _DEFAULTS["workers"]
    """How many processes share the cells, where one has many."""
    wiring: WiringKind = _DEFAULTS["wiring"]
    """Which edges carry the pulses."""
    deadline: Seconds = _DEFAULTS["deadline"]
    """Seconds a wave may take before it is given up and sent again."""


class RecordingTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """Where the run is recorded."""

    record: bool = True
    """Whether it is recorded at all."""
    path: Text | UnsetType = UNSET
    """The recording; it must not exist yet, so that the file serves for one run."""
    folder: Text | UnsetType = UNSET
    """Where every run gets a recording with a new name, unless there is a path; left
    out: `logs`, where the run is started."""
    keyframe_every: Count = _DEFAULTS["keyframe_every"]
    """Ticks between two whole snapshots in the recording."""
    split: Natural = _DEFAULTS["split"]
    """Bytes after which the recording goes on in another file; 0: never."""
    keep: Natural = _DEFAULTS["keep"]
    """How many of these files are kept, the newest; 0: all."""
    sync: NotNegative | UnsetType = UNSET
    """Seconds after which the recording is on the disk, and survives a power cut; 0:
    once it has its end; left out: 1 for what comes from outside, 0 for what can be done
    again."""


class AnomaliesTable(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True
):
    """What is told of observations against what was learned."""

    # A run that somebody starts is watched; one that a program makes is asked to be.
    watch: bool = True
    """Whether they are told of."""
    hold: Natural = _DEFAULTS["hold"]
    """For how many ticks to go on judging by the order that the first of them broke."""


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
    """What is told of observations against what was learned."""
    recording: RecordingTable = RecordingTable()
    """Where the run is recorded."""
    supervision: Supervision = Supervision()
    """What happens when a part dies."""
    network: Network = PRIVATE
    """How the parts reach each other."""
