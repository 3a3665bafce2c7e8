"""The request for a run, its progress reports, and its outcome."""

from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Annotated, Protocol, cast

import msgspec

from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.errors import InvalidValueError, MissingExtraError
from neurosnap.health.alarm import Standing
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.protocol.coordinator import Totals
from neurosnap.protocol.option_declaration import option
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import CellKind, RunOptions
from neurosnap.protocol.tick_times import Behind
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import part_path
from neurosnap.runtime.child_processes import ChildProcesses
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.job import WavesSoFar
from neurosnap.runtime.parts.world_process import WayIn
from neurosnap.runtime.starter import Starter
from neurosnap.sources.live.statistics import Statistics
from neurosnap.system.distribution import must_have


class Supervision(msgspec.Struct, frozen=True, kw_only=True):
    """The rules for a part that dies: restarts and their limits."""

    restart_on_error: Annotated[
        bool,
        option(
            "Whether to start the parts again and go on from the recording also when one"
            " gave an error, and not only when one was killed, vanished or hangs. It may"
            " give the same again."
        ),
    ] = False
    max_restarts: Annotated[
        int,
        option(
            "How many restarts there may be within `restart_window` before the run is"
            " given up. 0: a part that dies ends the run.",
            ge=0,
        ),
    ] = 10
    restart_window: Annotated[
        float,
        option(
            "How long a restart counts towards `max_restarts`.", unit="SECONDS", gt=0
        ),
    ] = 600.0
    backoff: Annotated[
        float,
        option(
            "How long to wait before a restart. Twice as long each time when no tick was"
            " made in between.",
            unit="SECONDS",
            ge=0,
        ),
    ] = 0.1


STARTERS = "neurosnap.starters"
"""The group of entry points that other starters of parts are registered in."""


class StarterKind(Protocol):
    """A starter as it is registered, by the name that `Placement.place` gives."""

    def check(self, cells: CellKind) -> None:
        """Refuse a kind of cells that it cannot start."""

    def __call__(self, address: str, network: Network, *, again: bool) -> Starter:
        """Return a starter.

        Args:
            address: Of the cluster, as the starter reads it; empty for its default.
            network: Where the hub is, which all nodes have to reach.
            again: The run goes on after a death, so a node may be about to come back.
        """


class Placement(msgspec.Struct, frozen=True, kw_only=True):
    """The machine or the cluster on which the parts run."""

    place: Annotated[
        str,
        option(
            "Where the parts run. Here: as processes of this machine. Any other name is"
            " that of an installed starter (see docs/hosts.md)."
        ),
    ] = "here"
    address: Annotated[
        str,
        option(
            "The cluster on which another starter than `here` places the parts.",
            unit="ADDRESS",
            default="the starter's own",
        ),
    ] = ""

    @property
    def is_here(self) -> bool:
        """Every part is a process of this machine."""
        return self.place == "here"

    def check(self, cells: CellKind) -> None:
        """Refuse parts that cannot be placed, before any part is started.

        Raises:
            InvalidValueError: There is no such starter, or it cannot start such cells;
                or an address comes without a starter.
            MissingExtraError: A package that the starter needs is not installed.
        """
        if not self.is_here:
            self._kind().check(cells)
        elif self.address:
            rule = "must come with the name of a starter as `place`"
            raise InvalidValueError("address", rule, self.address)

    def starter(self, network: Network, *, again: bool) -> Starter:
        """Return what starts the parts; see `StarterKind`."""
        if self.is_here:
            return ChildProcesses()
        return self._kind()(self.address, network, again=again)

    def _kind(self) -> StarterKind:
        for entry in metadata.entry_points(group=STARTERS, name=self.place):
            try:
                return cast("StarterKind", entry.load())
            except ImportError as error:
                rule = must_have(error.name or self.place, self.place)
                raise MissingExtraError(f"place: {rule}") from error
        known = ["here", *sorted(metadata.entry_points(group=STARTERS).names)]
        raise InvalidValueError(
            "place", f"must be one of {', '.join(known)}", self.place
        )


HERE = Placement()
"""Every part is a process of this machine."""


@dataclass(frozen=True)
class Site:
    """Where the parts of a swarm are, and how they reach each other."""

    network: Network = PRIVATE
    """Where its hub listens, and who may connect."""
    placement: Placement = HERE
    """What starts the parts, and where."""
    swarm: str = ""
    """Its id; empty for a random one."""
    elsewhere: frozenset[str] = frozenset()
    """The names of the parts that are started elsewhere; they must be started anew for
    every incarnation. If the recorder is one, the coordinator waits for it, too."""
    patience: float | None = None
    """Seconds all parts may take to come up; if None a minute, and more for many."""
    incarnation: int = 0
    """How many earlier swarms of this id it continues."""

    def starter(self) -> Starter:
        """Return what starts the parts that are started here."""
        return self.placement.starter(self.network, again=self.incarnation > 0)


@dataclass(frozen=True)
class RunRequest:
    """The request for one run: its options, its places, its rules for failures."""

    options: RunOptions
    """What to run."""
    log: Path | None = None
    """Where to record; None if nothing is recorded."""
    past: ResumePoint | None = None
    """Where it goes on from, for a run that is resumed."""
    site: Site = Site()
    """Where the parts are."""
    supervision: Supervision | None = None
    """How often the run goes on from its recording when a part dies; if None, never."""
    way_in: WayIn | None = None
    """How outside readings that are kept get to the world; see
    `neurosnap.runtime.run_with_intake`."""

    @property
    def after(self) -> int:
        """The tick that it goes on from; 0 for a new run."""
        return 0 if self.past is None else self.past.tick

    @property
    def written(self) -> Path | None:
        """The file that it writes first; None if it is not recorded."""
        part = 0 if self.past is None else self.past.part
        return None if self.log is None else part_path(self.log, part)


class Restart(msgspec.Struct, frozen=True):
    """One time that a run went on after a part had died."""

    why: str
    """Which part died, and how."""
    tick: int
    """The last whole tick, which it went on from."""
    lost: int
    """Completed ticks that the recording lacks."""
    outside: bool = False
    """The lost ticks were read from a live source, so they cannot be repeated."""
    kept: tuple[tuple[Path, int], ...] = ()
    """Files that are kept beside the recording, and the tick of each that it had gone
    on from; 0 if it did not."""


def _ignore(*_: object) -> None:
    """Do nothing."""


@dataclass(frozen=True)
class Watcher:
    """Functions that are called while a run is under way, all on the event loop.

    An exception that one of them raises ends the run, and is raised by it.
    """

    on_tick: Callable[[int], None] = _ignore
    """Called with the tick once all parts are up: with every tick of an inline run,
    otherwise at most twenty times a second. Four times a second while no tick comes and
    no deadline has passed."""
    on_change: Callable[[Changed], None] = _ignore
    """Called with each sensor that is grown or retired, except by the decision of the
    last tick, which nothing follows."""
    on_health: Callable[[Standing], None] = _ignore
    """Called with the health of a home's sensors, when that is new."""
    on_restart: Callable[[Restart], None] = _ignore
    """Called when the run goes on after a part has died."""
    on_waves: Callable[[WavesSoFar], None] = _ignore
    """Called with the waves so far, right before `on_tick`."""
    on_presence: Callable[[str, bool], None] = _ignore
    """Called with the name of each part that is started, and of each that is gone."""
    on_anomaly: Callable[[NamedAnomaly], None] = _ignore
    """Called with each anomaly that has the support which the run asks for."""


SILENT = Watcher()
"""Nothing is reported."""


class Outcome(msgspec.Struct, kw_only=True):
    """The outcome of a run."""

    totals: Totals
    implications: list[tuple[str, str]]
    """The order learned, by name, covering pairs only."""
    completeness: Completeness | None
    """The recording's balance; None if nothing was recorded."""
    seconds: float
    """From the first decision to the last state."""
    stopped: bool
    """It was asked to stop before it was done."""
    after: int = 0
    """The tick that it went on from, the last time; `seconds` are those since then."""
    restarts: int = 0
    """How often it went on after a part had died."""
    kept: tuple[str, ...] = ()
    """Files beside the recording or of it, which may hold ticks that cannot be read, or
    that were observed otherwise."""
    intake: Statistics | None = None
    """What came in of a live source, over all restarts; None for another source."""
    lost: int = 0
    """How many readings of it had no tick although they should have; a stretch in which
    it could not listen counts as one."""
    journal: str = ""
    """Where readings are that the recording lacks; empty if it has all."""
    waiting: int = 0
    """How many of the readings are in none of the ticks."""
    health: Standing | None = None
    """Final health of the sensors of the home; None if they were not monitored."""
    behind: Behind | None = None
    """The tick that was furthest behind its readings; None if none was."""

    @property
    def complete(self) -> bool:
        """Everything that was recorded of it is in the recording."""
        balance = self.completeness
        return balance is not None and balance.whole and not self.kept

    @property
    def received(self) -> dict[str, int]:
        """Readings that came in, by what they became; nothing else came in."""
        if self.intake is None:
            return {}
        counts = msgspec.structs.asdict(self.intake.received)
        del counts["outages"], counts["missing"]
        counts["shown"] -= self.waiting
        return {**counts, "kept": self.waiting, "after": self.intake.after}


def check_swarm(swarm: str) -> None:
    """Raise InvalidValueError for an id of other than letters and digits."""
    if not swarm.isalnum():
        raise InvalidValueError("swarm", "must be letters and digits", swarm)
