"""Launches a swarm, part by part, and ends it in order.

The order of starting is hub, recorder, coordinator, world, cells; that of ending is
coordinator, world and cells, recorder, hub, so that the recorder receives the last
message of every part.
"""

import asyncio
import secrets
import tempfile
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import msgspec

from neurosnap.errors import NothingBegunError, SwarmError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.fabric.zenoh.discovery import incarnation
from neurosnap.health.alarm import Standing
from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.inline_tasks import InlineTasks
from neurosnap.runtime.network import Connections
from neurosnap.runtime.parts.coordinator_process import (
    CoordinatorJob,
    Result,
    RunDescription,
)
from neurosnap.runtime.parts.hub_and_cell import CellJob, HubJob
from neurosnap.runtime.parts.job import Job, PartConnection
from neurosnap.runtime.parts.recorder_process import RecorderJob
from neurosnap.runtime.parts.status_publisher import (
    STATUS_PUBLISHER,
    StatusJob,
    has_status,
)
from neurosnap.runtime.parts.worker_process import WorkerJob
from neurosnap.runtime.parts.world_process import WorldJob
from neurosnap.runtime.registry import noted
from neurosnap.runtime.request import SILENT, Outcome, RunRequest, Site, Watcher
from neurosnap.runtime.starter import Starter
from neurosnap.runtime.supervisor import RunningPart, Supervisor
from neurosnap.sources.live.statistics import Statistics
from neurosnap.sources.open import lost_by

SERVICES = 5
"""Hub, recorder, coordinator, world, status publisher."""
_GRACE = 10.0  # seconds a part may take to end
_LAST_WRITE = 2.0  # seconds a recorder may take to end without the hub
# Additional seconds while a part still starts: it may compile, and cannot react then.
_COMING_UP = 60.0


@dataclass(frozen=True)
class Jobs:
    """The jobs of a swarm's parts, and what the launcher must know of its run."""

    coordinator: Callable[[tuple[str, ...]], Job]
    """Makes the coordinator's job, given the parts that it has to wait for. On a shared
    hub the coordinator is ready once it knows that no other swarm has its id."""
    hosts: Mapping[str, Job]
    """The jobs of the cells, or of the workers that host them, by name."""
    world: Job | None = None
    """The world's job; None if it has none."""
    status: Job | None = None
    """The job of the status publisher; None if it has none."""
    recorder: Callable[[str, tuple[str, ...]], Job] | None = None
    """Makes the recorder's job, given the swarm's id and the parts whose last words it
    waits for; None if nothing is recorded."""
    past: ResumePoint | None = None
    """Where to go on from, for a run that is resumed."""
    patience: float = 30.0
    """Seconds the coordinator may take to end once asked."""
    source: str = ""
    """What runs through it, for those who look for it on this machine."""
    log: Path | None = None
    """Where it is recorded, likewise; None if it is not."""


def host_jobs(
    cells: int, workers: int, learning: RunOptions | None = None
) -> dict[str, Job]:
    """Return the jobs of all cells, or of the workers that host them.

    Args:
        cells: How many cells.
        workers: How many processes share them; 0 if every cell is one.
        learning: The run whose learning they share, too; None if they share none.
    """
    if not workers:
        return {f"cell/{n}": CellJob(n) for n in range(cells)}
    jobs = (WorkerJob(n, cells, workers, learning) for n in range(workers))
    return {f"worker/{job.worker}": job for job in jobs}


@dataclass(frozen=True)
class Ending:
    """How a swarm ended, and its results."""

    result: bytes
    """The coordinator's result, as JSON."""
    completeness: Completeness | None
    """The recording's balance; None if nothing was recorded."""
    stopped: bool
    """It was asked to stop before it was done."""
    statistics: Statistics | None = None
    """What the world counted of a live source; None if it took nothing in."""
    health: Standing | None = None
    """Final health of the sensors of the home; None if they were not monitored."""


def new_swarm_id() -> str:
    """Return a random id, so that two swarms never meet."""
    return secrets.token_hex(4)


async def launch(
    jobs: Jobs,
    site: Site,
    stop: asyncio.Event,
    watcher: Watcher = SILENT,
    starter: Starter | None = None,
) -> Ending:
    """Run a swarm to its end, or until `stop` is set. No part outlives the call.

    Args:
        jobs: What its parts do.
        site: Where they are.
        stop: Ends the run in order.
        watcher: What is reported meanwhile.
        starter: What starts them; if None, that of the site.

    Raises:
        NothingBegunError: `stop` was set before the external hub could be reached.
        FabricError: The external hub cannot be reached.
        SwarmError: A part failed; the text names it and says why. Whatever was
            recorded until then is readable.
    """
    with (
        tempfile.TemporaryDirectory(prefix="neurosnap-") as folder,
        ExitStack() as stack,
    ):
        # A socket in a private folder: no other user can connect, and no port is taken.
        own = f"unixsock-stream/{folder}/hub"
        starter = site.starter() if starter is None else starter
        has_hub = starter.has_hub and not site.network.connect
        here = _parts_here(jobs, site, has_hub=has_hub)
        site.network.check(*here)
        async with Supervisor(starter, watcher) as supervisor:
            connections = Connections(site.network, own)
            running = _Launch(jobs, site, supervisor, connections, folder)
            if starter.has_hub:
                shown = site.network.endpoint("hub", own)
                stack.enter_context(noted(running.swarm, jobs.source, shown, jobs.log))
            ending = await running.run(here, stop)
            return replace(ending, health=supervisor.health)


class _Launch:
    """One launch of a swarm."""

    def __init__(
        self,
        jobs: Jobs,
        site: Site,
        supervisor: Supervisor,
        connections: Connections,
        folder: str,
    ) -> None:
        self._jobs = jobs
        self._site = site
        self._supervisor = supervisor
        self._connections = connections
        self._folder = folder
        self._recorder: RunningPart | None = None
        self.swarm = site.swarm or new_swarm_id()

    def _connection(self, who: str) -> PartConnection:
        first = first_number(self._jobs.past, who)
        swarm = incarnation(self.swarm, self._site.incarnation)
        return self._connections.to(who, swarm, first)

    async def run(self, here: Collection[str], stop: asyncio.Event) -> Ending:
        """Start the parts `here`, wait for the end or `stop`, end everything."""
        if self._site.network.connect and not await self._connections.await_hub(stop):
            raise NothingBegunError("swarm: must reach its hub, got a stop request")
        try:
            await self._supervisor.make_room(here, stop)
            if "hub" in here:
                await self._start_hub(stop)
            coordinator, world, recorder = await self._start_parts(stop)
            ends = (
                [coordinator.ended]
                if world is None
                else [coordinator.ended, world.ended]
            )
            await wait_any(self._supervisor.failed, stop, *ends)
            stopped = stop.is_set()
        finally:
            late = await self._end()
        if self._supervisor.error is not None:
            raise self._supervisor.error
        if late:
            rule = "every part must end when asked to"
            raise SwarmError(f"swarm: {rule}, killed: {', '.join(late)}")
        completeness = None
        if recorder is not None:
            completeness = msgspec.json.decode(_result(recorder), type=Completeness)
        counted = None
        if world is not None and world.result is not None:
            counted = msgspec.json.decode(world.result, type=Statistics | None)
        return Ending(_result(coordinator), completeness, stopped, counted)

    async def _start_hub(self, stop: asyncio.Event) -> None:
        sessions = len(self._jobs.hosts) + SERVICES
        hub = await self._supervisor.start(
            HubJob(sessions, self._folder),
            self._connection("hub"),
        )
        await self._supervisor.wait(stop, hub.ready)

    async def _start_parts(
        self, stop: asyncio.Event
    ) -> tuple[RunningPart, RunningPart | None, RunningPart | None]:
        """Start the coordinator, the world and the recorder, and then the cells.

        The cells are started to the last even if `stop` is set meanwhile: a recording
        is whole once every part has said its last word.
        """
        start, jobs, site = self._supervisor.start, self._jobs, self._site
        heard = [*jobs.hosts] if jobs.world is None else ["world", *jobs.hosts]
        recorded = jobs.recorder is not None or "recorder" in site.elsewhere
        awaited = ["recorder", *heard] if recorded else heard
        world = None
        if jobs.recorder is not None:
            job = jobs.recorder(self.swarm, ("coordinator", *heard))
            self._recorder = await start(job, self._connection("recorder"))
        coordinator = await start(
            jobs.coordinator(tuple(awaited)), self._connection("coordinator")
        )
        if site.network.connect:
            # A swarm on a shared hub may have this id: it must not get our messages.
            await self._supervisor.wait(stop, coordinator.ready, coordinator.ended)
            if not coordinator.ready.is_set():
                return coordinator, None, self._recorder
        if jobs.status is not None:
            # Before the first tick: what it misses, it never publishes.
            status = await start(jobs.status, self._connection(STATUS_PUBLISHER))
            await self._supervisor.wait(stop, status.ready, status.ended)
        if jobs.world is not None and "world" not in site.elsewhere:
            world = await start(jobs.world, self._connection("world"))
        await self._supervisor.start_many(
            [
                (job, self._connection(who))
                for who, job in jobs.hosts.items()
                if who not in site.elsewhere
            ]
        )
        return coordinator, world, self._recorder

    async def _end(self) -> list[str]:
        """End everything in order; return who had to be killed.

        Once a part has failed, no wave settles: only the recorder is waited for, which
        writes what it has received. Without the hub it receives no more messages,
        and gets only `_LAST_WRITE` seconds.
        """
        end = self._supervisor.end
        if self._supervisor.error is not None:
            await self._supervisor.kill(["coordinator", "world", *self._jobs.hosts])
            if self._supervisor.has_ended("hub"):
                await end(["recorder"], _LAST_WRITE)
        more = 0.0 if self._supervisor.has_begun else _COMING_UP
        if more and self._supervisor.error is None and self._recorder is not None:
            # A coordinator that leaves before the recorder listens would be missing.
            ready, ended = self._recorder.ready, self._recorder.ended
            await wait_any(self._supervisor.failed, ready, ended, seconds=more)
        late = await end(["coordinator"], self._jobs.patience + more)
        grace = _GRACE + 0.02 * len(self._jobs.hosts) + more
        late += await end(["world", *self._jobs.hosts], grace)
        late += await end(["recorder", STATUS_PUBLISHER], 2 * _GRACE)
        late += await end(["hub"], _GRACE)
        return late


def _parts_here(jobs: Jobs, site: Site, *, has_hub: bool = True) -> set[str]:
    """Return the parts that are started here, by name."""
    there = {
        "hub": has_hub,
        "recorder": jobs.recorder is not None,
        "coordinator": True,
        STATUS_PUBLISHER: jobs.status is not None,
        "world": jobs.world is not None,
    }
    services = {who for who, is_there in there.items() if is_there}
    return services.union(jobs.hosts) - site.elsewhere


def _result(part: RunningPart) -> bytes:
    """Return the result that a part reported."""
    if part.result is None:
        raise SwarmError(f"{part.who}: must report a result, got none")
    return part.result


async def run_incarnation(
    request: RunRequest, stop: asyncio.Event, watcher: Watcher = SILENT
) -> Outcome:
    """Run a swarm once, whatever the supervision of the request says.

    Raises:
        NeurosnapError: A part failed; the text names it. Whatever was recorded until
            then is readable, and no process is left.
    """
    options = request.options
    starter = InlineTasks() if options.cells == "inline" else request.site.starter()
    ending = await launch(jobs_of(request), request.site, stop, watcher, starter)
    result = msgspec.json.decode(ending.result, type=Result)
    return Outcome(
        totals=result.totals,
        implications=result.implications,
        completeness=ending.completeness,
        seconds=result.seconds,
        stopped=ending.stopped,
        after=request.after,
        intake=ending.statistics,
        lost=lost_by(options.source, ending.statistics),
        health=ending.health,
    )


def jobs_of(request: RunRequest) -> Jobs:
    """Return the jobs of all parts of a run."""
    options, past, site, log = request.options, request.past, request.site, request.log
    vacant = tuple(sorted(site.elsewhere))
    description = RunDescription(options=options, past=past, vacant=vacant)
    learning = options if options.learning_shares else None
    return Jobs(
        coordinator=partial(CoordinatorJob, description, site.patience),
        hosts=host_jobs(len(options.sensors), options.sharing, learning),
        world=WorldJob(options, past, request.way_in),
        status=StatusJob(options, past) if has_status(options) else None,
        recorder=None if log is None else partial(RecorderJob, options, str(log), past),
        past=past,
        patience=options.deadline + 10.0,
        source=options.source,
        log=log,
    )
