"""Launches a swarm, part by part, and ends it in order.

The order of starting is hub, recorder, coordinator, world, cells; that of ending is
coordinator, world and cells, recorder, hub, so that the recorder receives the last
message of every part.
"""

import asyncio
import secrets
import tempfile
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from neurosnap.agent.growth.changed import Changed
from neurosnap.errors import NothingBegunError, SwarmError
from neurosnap.fabric.events import wait_any
from neurosnap.fabric.zenoh.discovery import incarnation
from neurosnap.health.news import Standing
from neurosnap.protocol.partition import hosts
from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.connections import Connections
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.cell_process import CellJob
from neurosnap.runtime.parts.hub_process import HubJob
from neurosnap.runtime.parts.job import Job, PartConnection
from neurosnap.runtime.parts.recorder_process import RecorderJob
from neurosnap.runtime.parts.status_publisher import STATUS_PUBLISHER
from neurosnap.runtime.parts.worker_process import WorkerJob
from neurosnap.runtime.registry import noted
from neurosnap.runtime.starting.child_processes import ChildProcesses
from neurosnap.runtime.starting.starter import Starter
from neurosnap.runtime.supervisor import RunningPart, Supervisor

_SERVICES = 5  # hub, recorder, coordinator, world, status publisher
_GRACE = 10.0  # seconds a part may take to end
_LAST_WRITE = 2.0  # seconds a recorder may take to end without the hub
# Additional seconds while a part still starts: it may compile, and cannot react then.
_COMING_UP = 60.0


@dataclass(frozen=True)
class Plan:
    """Which parts a swarm has."""

    cells: int
    """How many cells."""
    coordinator: Callable[[tuple[str, ...]], Job]
    """Makes the coordinator's job, given the parts that it has to wait for. On a shared
    hub the coordinator is ready once it knows that no other swarm has its id."""
    workers: int = 0
    """How many processes share the cells; 0: every cell is one."""
    learning: RunOptions | None = None
    """The run whose learning they share, too; None: they do not."""
    world: Job | None = None
    """The world's job, where there is one."""
    status: Job | None = None
    """The job that says how the run goes, where there is one."""
    log: Path | None = None
    """Where to record; None: not at all."""
    metadata: Mapping[str, str] = field(default_factory=dict)
    """Metadata of the recording; the swarm's id is added to it."""
    past: ResumePoint | None = None
    """Where to go on from, for a run that is resumed."""
    patience: float = 30.0
    """Seconds the coordinator may take to end once asked."""
    network: Network = PRIVATE
    """Where its hub listens, and who may connect."""
    swarm: str = ""
    """Its id; empty: a random one."""
    incarnation: int = 0
    """How many earlier swarms of this id it continues."""
    elsewhere: frozenset[str] = frozenset()
    """The names of the parts that are started elsewhere. If the recorder is one, the
    coordinator waits for it, too."""
    starter: Callable[[], Starter] = ChildProcesses
    """Makes what starts all other parts."""


@dataclass(frozen=True)
class Ending:
    """What a swarm leaves behind."""

    result: bytes
    """The coordinator's result, as JSON."""
    completeness: Completeness | None
    """The recording's balance; None where nothing was recorded."""
    seconds: float
    """From the start of the first part until the coordinator was done."""
    stopped: bool
    """It was asked to stop before it was done."""
    lost: int = 0
    """Outside readings that the world lost."""
    health: Standing | None = None
    """How the sensors of the home were; None: nobody judged them."""


def new_swarm_id() -> str:
    """Return a random id, so that two swarms never meet."""
    return secrets.token_hex(4)


async def run_processes(
    plan: Plan,
    stop: asyncio.Event,
    on_progress: Callable[[int], None] = lambda _: None,
    on_change: Callable[[Changed], None] = lambda _: None,
    on_health: Callable[[Standing], None] = lambda _: None,
) -> Ending:
    """Run a swarm to its end, or until `stop` is set. No process outlives the call.

    Args:
        plan: Who takes part.
        stop: Ends the run in order.
        on_progress: Called with the tick once the swarm is up, at most twenty times per
            second; four times per second while no tick comes and no deadline has
            passed. An exception that it raises ends the run and is raised here.
        on_change: Called with each sensor that is grown or retired; likewise.
        on_health: Called with how the sensors are, when that is new; likewise.

    Raises:
        NothingBegunError: `stop` was set before the external hub could be reached.
        FabricError: The external hub cannot be reached.
        SwarmError: A part failed; the text names it and says why. Whatever was
            recorded until then is readable.
    """
    with tempfile.TemporaryDirectory(prefix="neurosnap-") as folder:
        # A socket in a folder of one's own: nobody else can connect, and no port is
        # taken.
        endpoint = f"unixsock-stream/{folder}/hub"
        plan.network.check(*_parts_here(plan))
        starter = plan.starter()
        async with Supervisor(starter) as supervisor:
            located = starter.located or bool(plan.elsewhere)
            connections = Connections(plan.network, endpoint, located=located)
            launch = _Launch(plan, supervisor, connections, folder)
            heard = _Heard(supervisor, on_progress, on_change, on_health)
            reporting = asyncio.create_task(heard.pass_on(), name="launch/progress")
            source = plan.metadata.get("source", "")
            try:
                shown = plan.network.endpoint("hub", endpoint)
                with noted(launch.swarm, source, shown, plan.log):
                    ending = await launch.run(stop)
                heard.tell()
                return replace(ending, health=heard.health)
            finally:
                reporting.cancel()


class _Launch:
    """One run of a plan."""

    def __init__(
        self,
        plan: Plan,
        supervisor: Supervisor,
        connections: Connections,
        folder: str,
    ) -> None:
        self._plan = plan
        self._supervisor = supervisor
        self._connections = connections
        self._folder = folder
        self._recorder: RunningPart | None = None
        self.swarm = plan.swarm or new_swarm_id()
        self._hosts = hosts(plan.cells, plan.workers)

    def _connection(self, who: str) -> PartConnection:
        first = first_number(self._plan.past, who)
        swarm = incarnation(self.swarm, self._plan.incarnation)
        return self._connections.to(who, swarm, first)

    async def run(self, stop: asyncio.Event) -> Ending:
        """Start everything, wait for the end, end everything."""
        began = time.perf_counter()
        if self._plan.network.connect and not await self._connections.await_hub(stop):
            raise NothingBegunError("swarm: must reach its hub, got a stop request")
        try:
            await self._supervisor.make_room(_parts_here(self._plan), stop)
            await self._start_hub(stop)
            coordinator, world, recorder = await self._start_parts(stop)
            ends = (
                [coordinator.ended]
                if world is None
                else [coordinator.ended, world.ended]
            )
            await wait_any(self._supervisor.failed, stop, *ends)
            stopped, ended = stop.is_set(), coordinator.done_at or time.perf_counter()
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
        lost = 0
        if world is not None and world.result is not None:
            lost = msgspec.json.decode(world.result, type=int)
        return Ending(_result(coordinator), completeness, ended - began, stopped, lost)

    async def _start_hub(self, stop: asyncio.Event) -> None:
        if self._plan.network.connect:
            return
        sessions = len(self._hosts) + _SERVICES
        hub = await self._supervisor.start(
            HubJob(sessions, self._folder, self._plan.network.audit),
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
        start, plan = self._supervisor.start, self._plan
        heard = self._hosts if plan.world is None else ["world", *self._hosts]
        awaited = ["recorder", *heard] if "recorder" in plan.elsewhere else heard
        recorder = world = None
        if plan.log is not None:
            recorder = await start(
                RecorderJob(
                    str(plan.log),
                    {**plan.metadata, "swarm": self.swarm},
                    plan.past,
                    ("coordinator", *heard),
                ),
                self._connection("recorder"),
            )
            self._recorder = recorder
            awaited = ["recorder", *heard]
        coordinator = await start(
            plan.coordinator(tuple(awaited)), self._connection("coordinator")
        )
        if plan.network.connect:
            # A swarm on a shared hub may have this id: it must not get our messages.
            await self._supervisor.wait(stop, coordinator.ready, coordinator.ended)
            if not coordinator.ready.is_set():
                return coordinator, None, recorder
        if plan.status is not None:
            # Before the first tick: what it misses, it never publishes.
            status = await start(plan.status, self._connection(STATUS_PUBLISHER))
            await self._supervisor.wait(stop, status.ready, status.ended)
        if plan.world is not None and "world" not in plan.elsewhere:
            world = await start(plan.world, self._connection("world"))
        await self._supervisor.start_many(
            [
                (self._host_job(number), self._connection(who))
                for number, who in enumerate(self._hosts)
                if who not in plan.elsewhere
            ]
        )
        return coordinator, world, recorder

    def _host_job(self, number: int) -> Job:
        """Return the job of a cell, or of a worker where they share the cells."""
        plan = self._plan
        if not plan.workers:
            return CellJob(number)
        return WorkerJob(number, plan.cells, plan.workers, plan.learning)

    async def _end(self) -> list[str]:
        """End everything in order; return who had to be killed.

        Once a part has failed, no wave settles: only the recorder is waited for, which
        writes what it has received. Without the hub it receives no more messages,
        and gets only `_LAST_WRITE` seconds.
        """
        end = self._supervisor.end
        if self._supervisor.error is not None:
            await self._supervisor.kill(["coordinator", "world", *self._hosts])
            if self._supervisor.has_ended("hub"):
                await end(["recorder"], _LAST_WRITE)
        more = 0.0 if self._supervisor.has_begun else _COMING_UP
        if more and self._supervisor.error is None and self._recorder is not None:
            # A coordinator that leaves before the recorder listens would be missing.
            ready, ended = self._recorder.ready, self._recorder.ended
            with suppress(TimeoutError):
                async with asyncio.timeout(more):
                    await wait_any(self._supervisor.failed, ready, ended)
        late = await end(["coordinator"], self._plan.patience + more)
        grace = _GRACE + 0.02 * len(self._hosts) + more
        late += await end(["world", *self._hosts], grace)
        late += await end(["recorder", STATUS_PUBLISHER], 2 * _GRACE)
        late += await end(["hub"], _GRACE)
        return late


def _parts_here(plan: Plan) -> set[str]:
    """Return the parts that are started here, by name."""
    there = {
        "hub": not plan.network.connect,
        "recorder": plan.log is not None,
        "coordinator": True,
        STATUS_PUBLISHER: plan.status is not None,
        "world": plan.world is not None,
    }
    services = {who for who, is_there in there.items() if is_there}
    return services.union(hosts(plan.cells, plan.workers)) - plan.elsewhere


def _result(part: RunningPart) -> bytes:
    """Return the result that a part reported."""
    if part.result is None:
        raise SwarmError(f"{part.who}: must report a result, got none")
    return part.result


class _Heard:
    """Passes on what the parts say of the run."""

    def __init__(
        self,
        supervisor: Supervisor,
        on_progress: Callable[[int], None],
        on_change: Callable[[Changed], None],
        on_health: Callable[[Standing], None],
    ) -> None:
        self._supervisor = supervisor
        self._on_progress = on_progress
        self._on_change = on_change
        self._on_health = on_health
        self.health: Standing | None = None
        """What was told last."""

    async def pass_on(self) -> None:
        """Pass on what they say of their progress, and nothing else."""
        supervisor = self._supervisor
        try:
            while True:
                await supervisor.progressed.wait()
                supervisor.progressed.clear()
                self.tell()
                self._on_progress(supervisor.tick)
        except Exception as error:  # noqa: BLE001 - ends the run, and comes out of it
            supervisor.blame(error)

    def tell(self) -> None:
        """Tell what is new."""
        supervisor = self._supervisor
        changes, supervisor.changes = supervisor.changes, []
        for change in changes:
            self._on_change(change)
        standings, supervisor.standings = supervisor.standings, []
        for standing in standings:
            self.health = msgspec.json.decode(standing, type=Standing)
            self._on_health(self.health)
