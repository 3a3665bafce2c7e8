"""Supervises the parts of a swarm: receives their reports, ends them in order.

Whatever happens, nothing is left running: leaving the supervisor kills what has not
ended in order. Whether the parts are processes or something else, their starter knows.
"""

import asyncio
from collections.abc import Callable, Collection, Sequence
from typing import Self, TypeVarTuple

import msgspec

from neurosnap.errors import PartDiedError, SwarmError
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.health.alarm import Standing
from neurosnap.protocol.anomaly_report import NamedAnomaly
from neurosnap.runtime.child_processes import ChildProcesses
from neurosnap.runtime.parts.job import (
    Advanced,
    Done,
    Failed,
    Found,
    Grown,
    Health,
    Job,
    PartConnection,
    Ready,
    Report,
)
from neurosnap.runtime.request import SILENT, Watcher
from neurosnap.runtime.starter import Handle, Starter

Ts = TypeVarTuple("Ts")


class RunningPart:
    """One part that was started, as its supervisor knows it."""

    def __init__(self, who: str, handle: Handle) -> None:
        self.who = who
        self.handle = handle
        self.ready = asyncio.Event()
        self.ended = asyncio.Event()
        self.result: bytes | None = None


class Supervisor:
    """Starts parts, and watches whether they live.

    A part that ends before it was asked to, or otherwise than in order, makes `failed`
    fire; `error` then names it and says why, in the part's own words where it left any.
    Use as an async context manager.

    Args:
        starter: How the parts are started; if None, as child processes.
        watcher: Called with what parts report of the run.
    """

    def __init__(
        self, starter: Starter | None = None, watcher: Watcher = SILENT
    ) -> None:
        self.failed = asyncio.Event()
        self.error: Exception | None = None
        self.health: Standing | None = None
        """The last health of a home's sensors; None if none was reported."""
        self.has_begun = False
        """The coordinator has said that every part is there."""
        self._watcher = watcher
        self._refused = False  # by the watcher, which is not called again
        self._starter = ChildProcesses() if starter is None else starter
        self._parts: dict[str, RunningPart] = {}
        self._early: dict[str, list[Report]] = {}  # of parts not in `_parts` yet
        self._reasons: dict[str, Failed] = {}
        self._expected: set[str] = set()
        self._killed: set[str] = set()  # by this supervisor

    async def __aenter__(self) -> Self:
        """Get the starter ready."""
        await self._starter.open(self)
        return self

    async def __aexit__(self, *_: object) -> None:
        """Kill what is left, and what is being started."""
        await self._starter.close()

    async def make_room(self, parts: Collection[str], stop: asyncio.Event) -> None:
        """See to it that these parts fit; see `Starter.make_room`."""
        await self._starter.make_room(parts, stop)

    async def start(self, job: Job, connection: PartConnection) -> RunningPart:
        """Start one part."""
        await self._starter.start([(job, connection)])
        return self._parts[connection.who]

    async def start_many(self, jobs: Sequence[tuple[Job, PartConnection]]) -> None:
        """Start a part per job, whose reports are short."""
        if jobs:
            await self._starter.start(jobs)

    def began(self, who: str, handle: Handle) -> None:
        """Note that a part was started."""
        self._parts[who] = RunningPart(who, handle)
        self._pass_on(self._watcher.on_presence, who, True)
        for report in self._early.pop(who, ()):
            self.receive(report)

    def receive(self, report: Report) -> None:
        """Receive a report of a part."""
        part = self._parts.get(report.who)
        if part is None:
            # It is quicker than what starts it, on a busy machine.
            self._early.setdefault(report.who, []).append(report)
            return
        match report:
            case Ready():
                part.ready.set()
            case Advanced(tick=tick, waves=waves):
                self.has_begun = True
                if waves is not None:
                    self._pass_on(self._watcher.on_waves, waves)
                self._pass_on(self._watcher.on_tick, tick)
            case Found(anomaly=anomaly):
                told = msgspec.json.decode(anomaly, type=NamedAnomaly)
                self._pass_on(self._watcher.on_anomaly, told)
            case Grown(changes=changes):
                for change in changes:
                    self._pass_on(self._watcher.on_change, change)
            case Health(standing=standing):
                self.health = msgspec.json.decode(standing, type=Standing)
                self._pass_on(self._watcher.on_health, self.health)
            case Done(result=result):
                self._expected.add(report.who)
                part.result = bytes(result)
            case Failed():
                self._reasons[report.who] = report

    def _pass_on(self, call: Callable[[*Ts], None], *what: *Ts) -> None:
        """Call a function of the watcher; what it raises ends the run."""
        if self._refused:
            return
        try:
            call(*what)
        except Exception as error:  # noqa: BLE001 - comes out of the run, whole
            self._refused = True
            self.blame(error)

    def ended(self, who: str, how: str, *, in_order: bool) -> None:
        """Note that a part has ended."""
        self._parts[who].ended.set()
        self._pass_on(self._watcher.on_presence, who, False)
        reason = self._reasons.get(who)
        if who in self._killed or (
            in_order and who in self._expected and reason is None
        ):
            return
        if reason is None:
            rule = "must not end before it is asked to"
            self.blame(PartDiedError(f"{who}: {rule}, ended with {how}"))
        else:
            kind = PartDiedError if reason.died else SwarmError
            what = reason.what.removeprefix(f"{who}: ")
            self.blame(kind(f"{who}: {what}"))

    def blame(self, error: Exception) -> None:
        """Record the run's error: the first one, or the first death of a part.

        Who cannot go on may suffer from another's death, which shows a moment later.
        """
        died = isinstance(error, PartDiedError)
        if self.error is None or (died and not isinstance(self.error, PartDiedError)):
            self.error = error
            self.failed.set()

    async def wait(self, *events: asyncio.Event) -> None:
        """Return once one of `events` is set.

        Raises:
            Exception: A part failed, now or before, or something else was blamed.
        """
        await wait_any(self.failed, *events)
        if self.error is not None:
            raise self.error

    def has_ended(self, who: str) -> bool:
        """Return whether a part was started and has ended."""
        return who in self._parts and self._parts[who].ended.is_set()

    async def kill(self, parts: Collection[str]) -> None:
        """End `parts` at once."""
        those = [self._parts[who] for who in parts if who in self._parts]
        for part in those:
            if not part.ended.is_set():
                self._killed.add(part.who)
                part.handle.kill()
        for part in those:
            await part.ended.wait()

    async def end(self, parts: Collection[str], grace: float) -> list[str]:
        """Ask `parts` to end and wait for it; return who had to be killed."""
        self._expected.update(parts)
        those = [self._parts[who] for who in parts if who in self._parts]
        for part in those:
            if not part.ended.is_set():
                part.handle.ask()
        try:
            async with asyncio.timeout(grace):
                for part in those:
                    await part.ended.wait()
        except TimeoutError:
            late = [part for part in those if not part.ended.is_set()]
            await self.kill([part.who for part in late])
            return [part.who for part in late]
        return []
