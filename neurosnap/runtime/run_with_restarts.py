"""Runs a swarm, and restarts it when a part dies.

The parts of a swarm share one state: what the snapshot holds, what the cells are wired
to, where the world is. So they are supervised *one for all*: when one dies, all are
ended, and a new swarm goes on from the last whole tick of the recording. What that tick
came to is derived again from a key-frame, bit for bit; the world, being a function of
its seed and the actions, is brought to where it was; the wave that was hit is started
again. The new recording begins as a copy of the old one up to that tick, so it holds
every observation, state and decision once; of several files only the last is copied.

No tick that was recorded is deleted on the way: see
`neurosnap.runtime.restart_files`. A run that had to keep a file beside its
recording says so, and is not complete.
"""

import asyncio
import time
from collections import deque
from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager, closing
from dataclasses import replace
from pathlib import Path

import msgspec

from neurosnap.agent.growth_in_decisions import Changed
from neurosnap.errors import (
    InvalidValueError,
    NothingBegunError,
    PartDiedError,
    SwarmError,
)
from neurosnap.fabric.wait_for_events import wait_any
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.tick_times import Behind, further
from neurosnap.protocol.world import World
from neurosnap.recording.read.recording import first_path, part_paths
from neurosnap.recording.replay.find_resume_point import find_resume_point
from neurosnap.runtime.compilation import compile_first
from neurosnap.runtime.launch import new_swarm_id, run_incarnation
from neurosnap.runtime.parts.job import WavesSoFar
from neurosnap.runtime.recorded_source import Trust, reopened
from neurosnap.runtime.registry import held, note_behind
from neurosnap.runtime.request import (
    SILENT,
    Outcome,
    Restart,
    RunRequest,
    Supervision,
    Watcher,
)
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.run_with_intake import run_journaled
from neurosnap.sources.live.journal import journal_of
from neurosnap.sources.open import is_file, is_live, open_source

MORE = 300
"""Ticks that a resumed run adds unless asked otherwise."""
_LONGEST = 30.0  # seconds
_NOTED = 1.0  # seconds between two notes of how far behind a run is
_OTHERS = 10.0  # seconds that the intake of a killed launcher may take to end


async def run(
    request: RunRequest, stop: asyncio.Event, watcher: Watcher = SILENT
) -> Outcome:
    """Run a swarm to its end, or until `stop` is set. No process outlives the call.

    What comes from outside is kept in a journal until it is recorded. When a part dies
    the run goes on from its recording, as often as its supervision allows; an inline
    run, or one without a recording, ends.

    Args:
        request: What is run, and where.
        stop: Ends the run in order.
        watcher: What is reported meanwhile.

    Raises:
        InvalidValueError: There are more sensors than a key-frame can hold; or files of
            an earlier run are beside the recording; or another run has this one, or the
            journal that this goes on from.
        PartDiedError: A part died, more often than allowed.
        NeurosnapError: A part failed; the text names it. Whatever was recorded until
            then is readable.
    """
    most: Behind | None = None
    noted, told, upper = 0.0, "", watcher.on_waves

    def follow(waves: WavesSoFar) -> None:
        """Keep the most that any life was behind, and note what it is each second."""
        nonlocal most, noted, told
        most = further(most, waves.most)
        line = "" if waves.behind is None else waves.behind.line()
        if line != told and time.monotonic() - noted >= _NOTED:
            noted, told = time.monotonic(), line
            note_behind(line)
        upper(waves)

    watcher = replace(watcher, on_waves=follow)

    async def work(kept: RunRequest) -> Outcome:
        alone = kept.log is None or kept.options.cells == "inline"
        if kept.supervision is None or alone:
            return await run_incarnation(kept, stop, watcher)
        return await Lives(kept, watcher).run(stop)

    with ExitStack() as holds:
        if request.log is not None:
            holds.enter_context(held(request.log, "out"))
            goes_on = request.past is not None and request.past.part is not None
            # Of a run that ended since the path was looked at; of files in parts those
            # before stay, and a part that is there already is refused.
            if request.log.exists() and not goes_on:
                raise InvalidValueError("out", "must not exist yet", str(request.log))
        if request.past is not None and is_live(request.options.source):
            past = first_path(Path(request.past.log), request.past.part)
            holds.enter_context(held(journal_of(past), "journal"))
        if not request.options.interpreted:
            await compile_first(request.options, stop)
        outcome = await run_journaled(request, work)
        return msgspec.structs.replace(outcome, behind=most) if most else outcome


def resumed(log: Path, ticks: int | None = None, trusts: Trust = False) -> RunRequest:
    """Return the request that goes on with a recorded run after its last whole tick.

    It does not say where to record.

    Args:
        log: The recording; it stays as it is.
        ticks: How many ticks there are to be in all; if None, 300 more than there are,
            or as many as the source has.
        trusts: As in `reopened`.

    Raises:
        InvalidValueError: It has as many ticks; or as from `World` and `reopened`.
        NeurosnapError: There is nothing to go on from.
    """
    with held(journal_of(log), "journal", _OTHERS):
        options, past = find_resume_point(log)
    options, length = reopened(options, trusts)
    if is_file(options.source):  # one that reads otherwise must begin no recording
        source = open_source(options.source, options.seed, options.arguments)
        with closing(source):
            World(source, options.body, past)
    most = past.tick + MORE if ticks is None else ticks
    if length is not None:
        most = min(most, length)
    if most <= past.tick:
        rule = f"must be more than the {past.tick} there are, and the source have them"
        raise InvalidValueError("ticks", rule, most)
    return RunRequest(msgspec.structs.replace(options, ticks=most), past=past)


class Lives:
    """The incarnations of one run, one after the other.

    Args:
        request: Recorded and supervised. However the run ends, its `log` is the
            recording with the latest tick, and only damaged files stay beside it; see
            `neurosnap.runtime.restart_files`.
        watcher: Changes in ticks that are done again are not reported again. A swarm
            that goes on first reports the health before.

    Raises:
        InvalidValueError: Something of an earlier run is beside the recording.
    """

    def __init__(self, request: RunRequest, watcher: Watcher) -> None:
        if request.log is None or request.supervision is None:
            raise ValueError("request: must be recorded and supervised")
        site = request.site
        self._log = request.log
        self._next = replace(
            request, site=replace(site, swarm=site.swarm or new_swarm_id())
        )
        self.files = RestartFiles(request.log)
        self.files.check_free()
        self._allowed = Restarts(request.supervision)
        self._watcher = watcher
        self._follower = replace(
            watcher, on_tick=self._follow, on_change=self._report_change
        )
        self._restarts = self._reached = self._changed = 0
        self._vanished: list[str] = []
        self._cannot_repeat = request.way_in is None and is_live(request.options.source)
        self._redone = asyncio.Event()
        """Set once this incarnation is past its resume point."""

    def _follow(self, tick: int) -> None:
        self._reached = max(self._reached, tick)
        if tick > self._next.after:
            self._redone.set()
        self._watcher.on_tick(tick)

    def _report_change(self, change: Changed) -> None:
        if change.tick > self._changed:
            self._changed = change.tick
            self._watcher.on_change(change)

    async def run(self, stop: asyncio.Event) -> Outcome:
        """Run one incarnation after the other, until one ends in order.

        Raises:
            OSError: A file of the run cannot be moved or deleted.
            PartDiedError: A part died more often than allowed.
            NeurosnapError: As from `run_incarnation`.
        """
        try:
            return await self._run_all(stop)
        finally:
            self.files.keep_furthest()

    async def _run_all(self, stop: asyncio.Event) -> Outcome:
        while True:
            was_stopped = stop.is_set()  # before this incarnation began
            try:
                outcome = await self._run_once(stop)
            except NothingBegunError as error:
                if not self._restarts:
                    raise
                raise SwarmError(str(error)) from error
            except SwarmError as error:
                # If `stop` is set while a part dies, another incarnation runs and ends
                # in order: this recording may lack last messages of other parts.
                if was_stopped or not self._allowed.allow(error, time.monotonic()):
                    raise
                gained = await self._go_on(error)
                await wait_any(stop, seconds=self._allowed.delay(gained=gained))
            else:
                return self._in_all(outcome)

    async def _run_once(self, stop: asyncio.Event) -> Outcome:
        request = self._next
        async with _stop_once_redone(
            stop, self._redone, self.files, request.past
        ) as heeded:
            ends = heeded if self._restarts and not self._cannot_repeat else stop
            return await run_incarnation(request, ends, self._follower)

    async def _go_on(self, error: SwarmError) -> bool:
        """Make the next incarnation ready; tell whether the run got further."""
        options, files = self._next.options, self.files
        found = await asyncio.to_thread(files.furthest, options)
        kept = len(files.kept)
        if self._reached > self._next.after and not part_paths(self._log):
            self._vanished.append(str(self._log))
        # Not on a thread, which would go on beside `keep_furthest` once this
        # is cancelled.
        gained, past = files.go_on(found, self._next.past)
        self._restarts += 1
        site = replace(self._next.site, incarnation=self._restarts)
        self._next = replace(self._next, past=past, site=site)
        event = Restart(
            why=str(error),
            tick=self._next.after,
            lost=max(0, self._reached - self._next.after),
            outside=self._cannot_repeat,
            kept=tuple(files.kept.items())[kept:],
        )
        self._reached = self._next.after
        self._redone.clear()
        self._watcher.on_restart(event)
        return gained

    def _in_all(self, outcome: Outcome) -> Outcome:
        """Return the outcome of the whole run, given that of its last incarnation."""
        self.files.finish()
        balance = outcome.completeness
        if balance is not None:
            every = tuple(dict.fromkeys((*balance.vanished, *self._vanished)))
            balance = msgspec.structs.replace(balance, vanished=every)
        return msgspec.structs.replace(
            outcome,
            restarts=self._restarts,
            completeness=balance,
            kept=tuple(map(str, [*self.files.unread, *self.files.kept])),
        )


@asynccontextmanager
async def _stop_once_redone(
    stop: asyncio.Event,
    redone: asyncio.Event,
    files: RestartFiles,
    past: ResumePoint | None,
) -> AsyncIterator[asyncio.Event]:
    """Yield an event that is set after `stop`, once the interrupted tick is redone.

    The failed incarnation may have recorded the observation of the tick after its last
    whole one. If the next incarnation ended before that tick, the new recording would
    lack an observation that the old one holds.
    """
    heeded = asyncio.Event()
    tick = 1 if past is None else past.tick + 1

    async def follow() -> None:
        await stop.wait()
        if not redone.is_set() and await asyncio.to_thread(files.have_left, tick):
            await redone.wait()
        heeded.set()

    following = asyncio.create_task(follow(), name="restart/stop")
    try:
        yield heeded
    finally:
        following.cancel()


class Restarts:
    """Decides whether a run goes on after an error, and after which delay.

    Args:
        supervision: The policy.
    """

    def __init__(self, supervision: Supervision) -> None:
        self._policy = supervision
        self._recent: deque[float] = deque()
        self._delay = supervision.backoff

    def allow(self, error: SwarmError, now: float) -> bool:
        """Return whether there is a restart after an error now, and count it if so."""
        if not (self._policy.restart_on_error or isinstance(error, PartDiedError)):
            return False
        while self._recent and now - self._recent[0] >= self._policy.restart_window:
            self._recent.popleft()
        if len(self._recent) >= self._policy.max_restarts:
            return False
        self._recent.append(now)
        return True

    def delay(self, *, gained: bool) -> float:
        """Return the seconds to wait before a restart.

        Args:
            gained: Whether the run made a tick since the restart before.
        """
        longer = min(2 * self._delay, _LONGEST)
        self._delay = self._policy.backoff if gained else longer
        return self._delay
