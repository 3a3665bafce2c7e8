"""The coordinator process, and the result it returns."""

import asyncio
from collections.abc import Collection

import msgspec

from neurosnap.errors import SwarmError
from neurosnap.fabric.events import wait_at_most
from neurosnap.fabric.protocol import Fabric
from neurosnap.protocol.coordinator import Coordinator, Totals
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.replay.resume import restore
from neurosnap.runtime.parts.coordinator_loop import Deadlines, run_coordinator
from neurosnap.runtime.parts.job import PartContext, take_part
from neurosnap.runtime.parts.run_description import RunDescription
from neurosnap.sources.open import is_live

_LEFTOVER = 15.0  # seconds those of an earlier swarm may take to go
_LOOK = 0.1  # seconds between two looks at who is there
_TRIES = 3
"""Deadlines that the world gets to answer, as many as a cell does: a wave is sent again
twice."""


class Result(msgspec.Struct):
    """The result of the coordinator."""

    totals: Totals
    seconds: float
    """What the run took, once every part was up."""
    implications: list[tuple[str, str]]
    """The learned order by name, covering pairs only."""


def coordinator_for(options: RunOptions, past: ResumePoint | None) -> Coordinator:
    """Return the core of a run: new, or as it was where it is taken up again."""
    return Coordinator.of(options) if past is None else restore(past, options.ticks)


def answer_within(options: RunOptions) -> float | None:
    """Return how many seconds the world may take to answer; None if any time.

    What is outside says something when something happens there, and not before. In an
    inline run nothing else goes on while the world works.
    """
    if options.cells == "inline" or is_live(options.source):
        return None
    return _TRIES * options.deadline


class CoordinatorJob(msgspec.Struct, frozen=True):
    """The coordinator: learns, conducts and decides."""

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
        description, options = self.description, self.description.options
        core = coordinator_for(options, description.past)
        patience = self.patience
        if patience is None:
            patience = 60.0 + 0.05 * len(self.parts)
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
                    on_progress=part.reporter.progress,
                    on_decision=lambda said: part.reporter.changed(core.changes(said)),
                ),
            )
            named = core.graph.implications(core.snapshot.sensorium)
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
                await wait_at_most(stop, _LOOK)
                if stop.is_set():
                    return
    except TimeoutError:
        rule = f"must have no part left of an earlier one after {_LEFTOVER:g} s"
        raise SwarmError(
            f"swarm {swarm}: {rule}, has {', '.join(sorted(there))}"
        ) from None
