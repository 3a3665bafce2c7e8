"""Runs a swarm in one process, every part as a task, over the in-memory fabric.

The parts are the same as in processes; only what carries their messages differs.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from neurosnap import wire
from neurosnap.agent.growth.changed import Changed
from neurosnap.errors import NeurosnapError, SwarmError
from neurosnap.fabric.in_memory import MemoryFabric, MemoryHub
from neurosnap.health.news import Standing
from neurosnap.protocol.partition import shares
from neurosnap.protocol.resume_point import ResumePoint, first_number
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.format.completeness import Completeness
from neurosnap.recording.write.recorder import run_recorder
from neurosnap.recording.write.rotation import SplitWriter
from neurosnap.runtime.launch import new_swarm_id
from neurosnap.runtime.parts import coordinator_process
from neurosnap.runtime.parts.cell_process import run_cell
from neurosnap.runtime.parts.coordinator_loop import run_coordinator
from neurosnap.runtime.parts.participant import take_part
from neurosnap.runtime.parts.status_publisher import (
    STATUS_PUBLISHER,
    has_status,
    publish_status,
)
from neurosnap.runtime.parts.worker_process import run_worker
from neurosnap.runtime.parts.world_process import (
    WayIn,
    lost_of,
    open_kept,
    run_world,
    synced,
)
from neurosnap.sources.open import open_source

if TYPE_CHECKING:
    from neurosnap.sources.live.latest_readings import Bits
    from neurosnap.sources.protocol import Source

T = TypeVar("T")
Work = Callable[[MemoryFabric], Coroutine[Any, Any, T]]


@dataclass(frozen=True)
class InlineEnding:
    """What an inline swarm leaves behind."""

    result: coordinator_process.Result
    completeness: Completeness | None
    seconds: float
    """From the call to the end."""
    stopped: bool
    lost: int = 0
    """Outside readings that were lost."""
    health: Standing | None = None
    """How the sensors of the home were; None: nobody judged them."""


async def run_inline(
    options: RunOptions,
    log: Path | None,
    metadata: Mapping[str, str],
    past: ResumePoint | None,
    stop: asyncio.Event,
    on_progress: Callable[[int], None],
    way_in: WayIn | None = None,
    on_change: Callable[[Changed], None] = lambda _: None,
    on_health: Callable[[Standing], None] = lambda _: None,
) -> InlineEnding:
    """Run a swarm in this process; see `neurosnap.runtime.run.run`."""
    began = time.perf_counter()
    with ExitStack() as stack:
        writer = None
        if log is not None:
            facts = {**metadata, "swarm": new_swarm_id()}
            writer = stack.enter_context(SplitWriter(log, facts, past))
        swarm = _Inline(options, writer, past, way_in, on_health)
        stack.callback(swarm.source.close)
        try:
            async with asyncio.TaskGroup() as group:
                seconds, balance = await swarm.run(group, stop, on_progress, on_change)
        except BaseExceptionGroup as errors:
            raise _first_of(errors) from errors
    return InlineEnding(
        coordinator_process.Result.of(swarm.core, seconds),
        balance,
        time.perf_counter() - began,
        stop.is_set(),
        lost_of(swarm.source, options),
        swarm.health,
    )


def _first_of(errors: BaseExceptionGroup[BaseException]) -> BaseException:
    """Return one error for the group: the first of ours, or the first."""
    ours, _ = errors.split(NeurosnapError)
    error: BaseException = ours if ours is not None else errors
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


class _Inline:
    """One run with a task a part."""

    def __init__(
        self,
        options: RunOptions,
        writer: SplitWriter | None,
        past: ResumePoint | None,
        way_in: WayIn | None,
        on_health: Callable[[Standing], None],
    ) -> None:
        self.core = coordinator_process.coordinator_for(options, past)
        self.source: Source
        self._known: Bits | None = None
        if way_in is None:
            seed, arguments = options.seed, options.arguments
            renders = options.frames > 0
            self.source = open_source(options.source, seed, arguments, None, renders)
        else:
            kept = open_kept(options, way_in)
            self._known = kept.go_on(0 if past is None else past.tick)
            self.source = kept
        self.health: Standing | None = None
        self._on_health = on_health
        self._options = options
        self._writer = writer
        self._past = past
        self._hub = MemoryHub()
        self._leave = asyncio.Event()

    async def run(
        self,
        group: asyncio.TaskGroup,
        stop: asyncio.Event,
        on_progress: Callable[[int], None],
        on_change: Callable[[Changed], None],
    ) -> tuple[float, Completeness | None]:
        """Start all parts in `group`; return seconds and the recording's balance."""
        hosts = self._options.host_names()
        heard = ["world", *hosts]
        ending = asyncio.Event()
        recording = None
        if self._writer is not None:
            recording = group.create_task(
                self._record(self._writer, ("coordinator", *heard)), name="recorder"
            )
            heard.append("recorder")
        for number, who in enumerate(hosts):
            work = self._host(number)
            group.create_task(self._play(who, work), name=who)
        telling = None
        if has_status(self._options):
            ready = asyncio.Event()
            telling = group.create_task(self._tell(ready.set), name=STATUS_PUBLISHER)
            await ready.wait()
        world = group.create_task(self._play("world", self._world), name="world")
        world.add_done_callback(lambda _: ending.set())
        stopping = group.create_task(_pass_on(stop, ending), name="inline/stop")

        def on_decision(decision: wire.Decision) -> None:
            for change in self.core.changes(decision):
                on_change(change)

        async def coordinate(fabric: MemoryFabric) -> float:
            return await run_coordinator(
                self.core,
                fabric,
                ending,
                parts=heard,
                deadline=self._options.deadline,
                on_progress=on_progress,
                on_decision=on_decision,
            )

        seconds = await self._play("coordinator", coordinate)
        self._leave.set()
        stopping.cancel()
        if telling is not None:
            await telling
        return seconds, None if recording is None else await recording

    def _end(self, who: str) -> MemoryFabric:
        return self._hub.fabric(who, first=first_number(self._past, who))

    async def _play(self, who: str, work: Work[T]) -> T:
        """Take part as `who`; an error that does not say whose it is gets told."""
        async with self._end(who) as fabric:
            try:
                return await take_part(fabric, work(fabric))
            except NeurosnapError:
                raise
            except Exception as error:
                kind = type(error).__name__
                raise SwarmError(f"{who}: must not fail: {kind}: {error}") from error

    def _host(self, number: int) -> Work[None]:
        workers = self._options.sharing
        if not workers:
            return lambda fabric: run_cell(number, fabric, self._leave)
        hosted = shares(len(self._options.sensors), workers)
        learning = self._options.new_worker_learning(number)
        return lambda fabric: run_worker(number, hosted, fabric, self._leave, learning)

    async def _world(self, fabric: MemoryFabric) -> None:
        body = self._options.body
        async with synced(self.source, self._options.sync):
            await run_world(
                self.source,
                body,
                fabric,
                self._leave,
                past=self._past,
                known=self._known,
                frames=self._options.frames,
            )

    async def _tell(self, on_ready: Callable[[], None]) -> None:
        def hear(standing: Standing) -> None:
            self.health = standing
            self._on_health(standing)

        async with self._hub.fabric(STATUS_PUBLISHER) as fabric:
            await publish_status(
                self._options, fabric, self._leave, on_ready, hear, self._past
            )

    async def _record(
        self, writer: SplitWriter, parts: tuple[str, ...]
    ) -> Completeness:
        async with self._end("recorder") as fabric:
            return await run_recorder(writer, fabric, self._leave, parts=parts)


async def _pass_on(cause: asyncio.Event, effect: asyncio.Event) -> None:
    await cause.wait()
    effect.set()
