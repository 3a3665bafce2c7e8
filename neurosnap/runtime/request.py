"""What a run is asked to do, and what it has come to."""

from dataclasses import dataclass
from pathlib import Path

import msgspec

from neurosnap.errors import InvalidValueError
from neurosnap.health.news import Standing
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.totals import Totals
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.read.recording import part_path
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.world_process import WayIn
from neurosnap.runtime.placement import HERE, Placement
from neurosnap.runtime.restart_policy import Supervision
from neurosnap.runtime.starting.starter import Starter


@dataclass(frozen=True)
class Site:
    """Where the parts of a swarm are, and how they reach each other."""

    network: Network = PRIVATE
    """Where its hub listens, and who may connect."""
    placement: Placement = HERE
    """What starts the parts, and where."""
    swarm: str = ""
    """Its id; empty: a random one."""
    elsewhere: frozenset[str] = frozenset()
    """The names of the parts that are started elsewhere; they must be started anew for
    every incarnation. If the recorder is one, the coordinator waits for it, too."""
    patience: float | None = None
    """Seconds all parts may take to come up; None: a minute, and more for many."""
    incarnation: int = 0
    """How many earlier swarms of this id it continues."""

    def starter(self) -> Starter:
        """Return what starts the parts that are started here."""
        return self.placement.starter(self.network, again=self.incarnation > 0)


@dataclass(frozen=True)
class RunRequest:
    """A run: what, where, and what happens when a part dies."""

    options: RunOptions
    """What to run."""
    log: Path | None = None
    """Where to record; None: not at all."""
    past: ResumePoint | None = None
    """Where it goes on from, for a run that is resumed."""
    site: Site = Site()
    """Where the parts are."""
    supervision: Supervision | None = None
    """How often the run goes on from its recording when a part dies; None: never."""
    way_in: WayIn | None = None
    """How outside readings that are kept get to the world; see
    `neurosnap.runtime.journaled_run`."""

    @property
    def after(self) -> int:
        """The tick that it goes on from; 0 for a new run."""
        return 0 if self.past is None else self.past.tick

    @property
    def written(self) -> Path | None:
        """The file that it writes first; None if it is not recorded."""
        part = 0 if self.past is None else self.past.part
        return None if self.log is None else part_path(self.log, part)


class Outcome(msgspec.Struct, kw_only=True):
    """What a run has come to."""

    totals: Totals
    implications: list[tuple[str, str]]
    """The order learned, by name, covering pairs only."""
    completeness: Completeness | None
    """The recording's balance; None where nothing was recorded."""
    seconds: float
    """From the first decision to the last state."""
    startup: float
    """From the call until every part was up."""
    stopped: bool
    """It was asked to stop before it was done."""
    restarts: int = 0
    """How often it went on after a part had died."""
    kept: tuple[str, ...] = ()
    """Files that it could not go on from, beside the recording or of it, which may hold
    ticks that cannot be read."""
    lost: int = 0
    """What came from outside and was no reading, or had no tick and should have."""
    journal: str = ""
    """Where readings are kept that are not in the recording; empty: there are none."""
    waiting: int = 0
    """How many of these had no tick."""
    health: Standing | None = None
    """Final health of the sensors of the home; None if they were not monitored."""

    @property
    def complete(self) -> bool:
        """Everything that was recorded of it is in the recording."""
        balance = self.completeness
        return balance is not None and balance.whole and not self.kept


def check_swarm(swarm: str) -> None:
    """Refuse an id that could not stand in a key.

    Raises:
        InvalidValueError: It holds something else than letters and digits.
    """
    if not swarm.isalnum():
        raise InvalidValueError("swarm", "must be letters and digits", swarm)
