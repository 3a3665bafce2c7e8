"""The coordinator process: describes the run to other parts, and reports its result.

Parts that join get the description. So a part on another machine needs only the address
of the hub and the id of the swarm, and no two parts can disagree about the run.
"""

import asyncio
import time
from collections.abc import Collection

import msgspec

from neurosnap import wire
from neurosnap.errors import InvalidValueError, SwarmError
from neurosnap.fabric.protocol import Fabric
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.protocol.anomaly_report import named_anomaly, with_support
from neurosnap.protocol.coordinator import Coordinator, Totals
from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.tick_times import TickTimes
from neurosnap.recording.replay.find_resume_point import restore
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.job import PartContext, Reporter, WavesSoFar, take_part
from neurosnap.runtime.recorded_source import recordable
from neurosnap.sources.open import is_live
from neurosnap.system.compiled import cache_folder, interpreted

_SHOWN = 8  # names in an error
_LEFTOVER = 15.0  # seconds those of an earlier swarm may take to go
_LOOK = 0.1  # seconds between two looks at who is there
_TRIES = 3
"""Deadlines that the world gets to answer, as many as a cell does: a wave is sent again
twice."""


class RunDescription(msgspec.Struct, frozen=True, kw_only=True):
    """Description of a run."""

    options: RunOptions
    past: ResumePoint | None = None
    """Where it goes on from, where it is taken up again."""
    vacant: tuple[str, ...] = ()
    """The parts that are started elsewhere, by name."""

    def first(self, who: str) -> int:
        """Return the number of the first message of a part."""
        return first_number(self.past, who)

    def check_vacant(self, parts: Collection[str]) -> None:
        """Raise InvalidValueError for a part that the run lacks, or starts itself."""
        for who in parts:
            if who not in self.vacant:
                rest = len(self.vacant) - _SHOWN
                more = f" and {rest} more" if rest > 0 else ""
                shown = ", ".join(self.vacant[:_SHOWN]) or "none"
                rule = f"must be one the run leaves to others: {shown}{more}"
                raise InvalidValueError("part", rule, who)

    def to_bytes(self) -> bytes:
        """Return it as JSON. Where the past is recorded is of no use elsewhere."""
        past, options = self.past, recordable(self.options)
        if past is not None:
            past = msgspec.structs.replace(past, log="")
        said = msgspec.structs.replace(self, options=options, past=past)
        return msgspec.json.encode(said)


def read_description(content: bytes) -> RunDescription:
    """Decode a coordinator's description.

    Raises:
        SwarmError: It is no description of a run.
    """
    try:
        return msgspec.json.decode(content, type=RunDescription)
    except msgspec.DecodeError as error:
        raise SwarmError(f"coordinator: must tell what the run is, {error}") from error


class Result(msgspec.Struct):
    """The result of the coordinator."""

    totals: Totals
    seconds: float
    """What the run took, once every part was up."""
    implications: list[tuple[str, str]]
    """The learned order by name, covering pairs only, without what is known anyway."""


def coordinator_for(options: RunOptions, past: ResumePoint | None) -> Coordinator:
    """Return the core of a run: new, or as it was where it is taken up again."""
    return Coordinator(options) if past is None else restore(past, options.ticks)


def answer_within(options: RunOptions) -> float | None:
    """Return how many seconds the world may take to answer; None if any time.

    What is outside says something when something happens there, and not before. In an
    inline run nothing else goes on while the world works.
    """
    if options.cells == "inline" or is_live(options.source):
        return None
    return _TRIES * options.deadline


def _named(options: RunOptions) -> set[tuple[str, str]]:
    """Return the implications that are known without learning, by name."""
    names = [name + star for name in options.body.own for star in ("", "*")]
    return {(names[a], names[b]) for a, b in options.known_order}


class _Reports:
    """Reports the progress of a run, and what it finds; called on any thread."""

    def __init__(self, core: Coordinator, support: int, reporter: Reporter) -> None:
        self._core = core
        self._support = support
        self._reporter = reporter
        self.waves = WavesSoFar()
        self._times = TickTimes()

    def said(self, message: wire.Message) -> None:
        """Note or report what the coordinator has just heard or said."""
        behind = self._times.take(message, time.time())
        match message:
            case wire.State() | wire.Reached():
                self.waves.add(message)
            case wire.Decision():
                self.waves.tell(behind)
                self._reporter.changed(self._core.changes(message))
            case wire.Anomaly():
                told = with_support(message, self._support)
                if told is not None:
                    body = self._core.memory.body
                    self._reporter.found(named_anomaly(told, body))
            case _:
                pass

    def progress(self, tick: int) -> None:
        """Report how far the run is."""
        self._reporter.progress(tick, self.waves)


class CoordinatorJob(msgspec.Struct, frozen=True):
    """The job of the coordinator."""

    description: RunDescription
    """What the run is."""
    patience: float | None
    """Seconds the parts may take to come up; if None, as many as on a small machine."""
    parts: tuple[str, ...]
    """Who must be there."""

    async def run(self, part: PartContext) -> None:
        """Conduct the run to its end.

        Raises:
            SwarmError: The swarm has a coordinator already, or parts of an earlier one
                that do not leave; and as from `run_coordinator`.
        """
        with interpreted(self.description.options.interpreted):
            await self._conduct(part)

    async def _conduct(self, part: PartContext) -> None:
        description, options = self.description, self.description.options
        # From `run_coordinator` on the core is used under the lock of its loop alone,
        # by the delivery threads and by the event loop.
        core = coordinator_for(options, description.past)
        reports = _Reports(core, options.support, part.reporter)
        patience = self.patience
        if patience is None:
            # Without a folder for compiled code, each part compiles while it comes up.
            patience = 60.0 if cache_folder() else 600.0
            patience += 0.05 * len(self.parts)
        swarm = part.connection.swarm
        async with part.connection.fabric(swift=True) as fabric:
            await _wait_alone(fabric, swarm, description.vacant, part.stop)
            await fabric.describe_run(description.to_bytes())
            part.reporter.ready()
            seconds = await take_part(
                fabric,
                run_coordinator(
                    core,
                    fabric,
                    part.stop,
                    parts=self.parts,
                    deadlines=Deadlines(
                        options.deadline, answer_within(options), patience
                    ),
                    on_progress=reports.progress,
                    on_said=reports.said,
                ),
            )
            learned = core.graph.implications(core.snapshot.sensorium)
            given = _named(options)
            named = [pair for pair in learned if pair not in given]
            if reports.waves.number:  # it has begun
                part.reporter.progress(core.tick, reports.waves, last=True)
            part.reporter.done(Result(core.totals, seconds, named))


async def _wait_alone(
    fabric: Fabric, swarm: str, vacant: Collection[str], stop: asyncio.Event
) -> None:
    """Wait until no part is left of an earlier swarm of the same name, or `stop`.

    Services come once there is a coordinator, so who is there before it is on the way
    out: a recorder that would record two runs, a cell that would be missed.

    It shows itself only after that, so two that are started at the same moment may
    both find no part: an id is its user's to give once.
    """
    there: set[str] = set()
    try:
        async with asyncio.timeout(_LEFTOVER):
            while there := await fabric.present() & {"coordinator", *vacant}:
                if "coordinator" in there:
                    rule = "must have one coordinator, has one already"
                    raise SwarmError(f"swarm {swarm}: {rule}")
                await wait_any(stop, seconds=_LOOK)
                if stop.is_set():
                    return
    except TimeoutError:
        rule = f"must have no part left of an earlier one after {_LEFTOVER:g} s"
        raise SwarmError(
            f"swarm {swarm}: {rule}, has {', '.join(sorted(there))}"
        ) from None
