"""TOML tables that describe a run, one struct per table.

What `RunOptions` declares stands in the table that it names, with the default that the
run has without a file. What is settled only once the source is known may be left out,
and is None then. Declared here is what a run is made with and does not keep.
"""

from typing import Annotated, Any, Literal, TypeAlias

import msgspec

from neurosnap.apps.config.sources import SourceTable, Text
from neurosnap.health.alarm_budget import NEVER, parse_budget
from neurosnap.protocol.option_declaration import declared, option
from neurosnap.protocol.run_options import FEW_CELLS, RunOptions
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.request import HERE, Placement, Supervision
from neurosnap.system.local_time import check_zone

Natural: TypeAlias = Annotated[int, msgspec.Meta(ge=0)]
_REPORTED = {"watch": True}
"""A run that is described reports anomalies; one that a program makes is asked to."""


def _options(table: str) -> Any:  # noqa: ANN401 - a struct made at run time
    """Return a struct of the options that are declared for a table."""
    fields: list[tuple[str, Any, Any]] = []
    for one in declared(RunOptions):
        name, _, key = one.shown.at.partition(".")
        if name == table:
            unsettled = one.shown.default != "" and one.default is not None
            default = None if unsettled else _REPORTED.get(one.field, one.default)
            fields.append((key, one.hint | None if unsettled else one.hint, default))
    return msgspec.defstruct(
        f"_{table}", fields, frozen=True, kw_only=True, forbid_unknown_fields=True
    )


class RunTable(_options("run"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """The length of the run, and the seed of its random numbers."""


class AgentTable(_options("agent"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """How actions are chosen."""

    target: Annotated[
        Natural | Text | tuple[Text, ...] | None,
        option(
            "For a planner: the sensors to switch on, with a star to switch off"
            " (below_5,below_4*). For an excited agent: the number of a place.",
            flag="target",
            default="for an excited agent, a random place",
        ),
    ] = None
    grow: Annotated[
        int,
        option(
            "How many sensors may be grown. Each stands for several readings at once, or"
            " for one that lasts or is past, from what relates them; where an agent"
            " chooses its actions, for an action where several sensations hold, from"
            " what surprises it. Each has a cell from the start.",
            flag="grow",
            unit="SENSORS",
            ge=0,
        ),
    ] = 0


class SnapshotTable(_options("snapshot"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """How the weights are learned."""


class CellsTable(_options("cells"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """Where the cells are, and how they are wired."""

    kind: Annotated[
        Literal["auto", "process", "worker", "inline"],
        option(
            "Where the cells are. Process: each is a process of its own. Worker: a few"
            " processes share them. Inline: all in this process, without a network; the"
            f" fastest, and easy to debug. Auto: process up to {FEW_CELLS} sensors, else"
            " worker; worker, too, for an MQTT broker, or if `workers` is set.",
            flag="cells",
        ),
    ] = "auto"
    workers: (
        Annotated[
            int,
            option(
                "With cells in workers: how many processes share them.",
                flag="workers",
                default="2, or as many as there are cells",
                ge=1,
            ),
        ]
        | None
    ) = None
    elsewhere: Annotated[
        str,
        option(
            "The cells (or workers) that are started on other machines with `neurosnap"
            " serve cells`, such as 0-499 or 3,7.",
            unit="RANGES",
        ),
    ] = ""


class AnomaliesTable(_options("anomalies"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """Which anomalies are reported: observations that contradict what was learned."""


class HealthTable(_options("health"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
    """What is reported of sensors that seem broken."""

    def __post_init__(self) -> None:
        if self.alarms not in (None, NEVER):
            parse_budget(self.alarms)
        if self.zone is not None:
            check_zone(self.zone)


class RecordingTable(_options("recording"), frozen=True, kw_only=True):  # type: ignore[call-arg, misc]
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
            " cannot go on after a failure.",
            flag="record",
        ),
    ] = True


class Config(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The description of a run. Its paths are relative to the file that holds it."""

    source: SourceTable
    """Where the observations come from."""
    run: RunTable = RunTable()
    """The length of the run, and the seed of its random numbers."""
    agent: AgentTable = AgentTable()
    """How actions are chosen."""
    snapshot: SnapshotTable = SnapshotTable()
    """How the weights are learned."""
    cells: CellsTable = CellsTable()
    """Where the cells are, and how they are wired."""
    anomalies: AnomaliesTable = AnomaliesTable()
    """Which anomalies are reported: observations that contradict what was learned."""
    health: HealthTable = HealthTable()
    """What is reported of sensors that seem broken."""
    recording: RecordingTable = RecordingTable()
    """Where the run is recorded."""
    supervision: Supervision = Supervision()
    """What happens when a part dies."""
    network: Network = PRIVATE
    """How the parts reach each other."""
    placement: Placement = HERE
    """Where the parts are."""


def flattened(config: Config) -> dict[str, Any]:
    """Return the options of a description as fields of `RunOptions`.

    Those that are settled later, and were left out, are missing.
    """
    flat = {}
    for one in declared(RunOptions):
        if one.shown.at:
            table, _, key = one.shown.at.partition(".")
            value = getattr(getattr(config, table), key)
            if value is not None:
                flat[one.field] = value
    return flat
