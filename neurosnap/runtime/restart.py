"""Restarts a run after the death of a part, from its recording.

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
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import msgspec

from neurosnap.agent.growth.changed import Changed
from neurosnap.errors import NothingBegunError, SwarmError
from neurosnap.fabric.events import wait_at_most
from neurosnap.health.news import Standing
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.launch import new_swarm_id
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.world_process import WayIn
from neurosnap.runtime.placement import HERE, Placement
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.restart_policy import Restarts, Supervision
from neurosnap.runtime.run import Outcome, run
from neurosnap.sources.open import is_live


class Restart(msgspec.Struct, frozen=True):
    """One time that a run went on."""

    why: str
    """Who died, and how."""
    tick: int
    """The last whole tick, which it went on from."""
    lost: int
    """Ticks that had been whole and are not in what it goes on from."""
    outside: bool = False
    """The lost ticks were read from a live source, so they cannot be repeated."""
    kept: tuple[str, ...] = ()
    """Files that it could not go on from, which are kept beside the recording."""


async def run_with_restarts(
    options: RunOptions,
    log: Path,
    stop: asyncio.Event,
    supervision: Supervision,
    *,
    on_progress: Callable[[int], None] = lambda _: None,
    on_restart: Callable[[Restart], None] = lambda _: None,
    past: ResumePoint | None = None,
    network: Network = PRIVATE,
    swarm: str = "",
    elsewhere: frozenset[str] = frozenset(),
    way_in: WayIn | None = None,
    placement: Placement = HERE,
    on_change: Callable[[Changed], None] = lambda _: None,
    on_health: Callable[[Standing], None] = lambda _: None,
) -> Outcome:
    """Run a swarm of processes to its end; restart it when a part dies.

    Args:
        options: What to run.
        log: Where to record. However the call ends, `log` is the recording with the
            latest tick, and only damaged files stay beside it; see
            `neurosnap.runtime.restart_files`.
        stop: Ends the run in order.
        supervision: How often it goes on.
        on_progress: Told the tick as it grows.
        on_restart: Told of every restart.
        past: Where to go on from, for a run that is resumed.
        network: As in `run`.
        swarm: As in `run`; each time the run goes on, it does so as the next
            incarnation of this id.
        elsewhere: As in `run`; these parts must be started anew for every incarnation.
        way_in: As in `run`.
        placement: As in `run`.
        on_change: As in `run`; of ticks that are done again it is not told again.
        on_health: As in `run`; a swarm that goes on says first how they were before.

    Raises:
        InvalidValueError: Something of an earlier run is beside `log`.
        OSError: A file of the run cannot be moved or deleted.
        PartDiedError: A part died more often than allowed. What was recorded by then
            is readable.
        NeurosnapError: As from `run`.
    """
    files = RestartFiles(log)
    files.check_free()
    swarm = swarm or new_swarm_id()
    allowed = Restarts(supervision)
    restarts = reached = changed = 0
    vanished: list[str] = []
    cannot_repeat = way_in is None and is_live(options.source)
    redone = asyncio.Event()  # set once this incarnation is past its resume point

    def follow(tick: int) -> None:
        nonlocal reached
        reached = max(reached, tick)
        if tick > (0 if past is None else past.tick):
            redone.set()
        on_progress(tick)

    def tell(change: Changed) -> None:
        nonlocal changed
        if change.tick > changed:
            changed = change.tick
            on_change(change)

    try:
        while True:
            was_stopped = stop.is_set()  # before this incarnation began
            try:
                async with _stop_once_redone(stop, redone, files, past) as heeded:
                    outcome = await run(
                        options,
                        log,
                        heeded if restarts and not cannot_repeat else stop,
                        follow,
                        past,
                        network,
                        swarm=swarm,
                        incarnation=restarts,
                        elsewhere=elsewhere,
                        way_in=way_in,
                        placement=placement,
                        on_change=tell,
                        on_health=on_health,
                    )
            except NothingBegunError as error:
                if not restarts:
                    raise
                raise SwarmError(str(error)) from error
            except SwarmError as error:
                # If `stop` is set while a part dies, another incarnation runs and ends
                # in order: this recording may lack last messages of other parts.
                if was_stopped or not allowed.allow(error):
                    raise
                found = await asyncio.to_thread(files.furthest, options)
                kept = len(files.kept)
                if reached > (0 if past is None else past.tick) and not files.recorded:
                    vanished.append(str(log))
                # Not on a thread, which would go on beside `keep_furthest` once this
                # is cancelled.
                gained, past = files.go_on(found, past)
                restarts += 1
                tick = 0 if past is None else past.tick
                on_restart(
                    Restart(
                        why=str(error),
                        tick=tick,
                        lost=max(0, reached - tick),
                        outside=cannot_repeat,
                        kept=tuple(map(str, files.kept[kept:])),
                    )
                )
                reached = tick
                redone.clear()
                await wait_at_most(stop, allowed.delay(gained=gained))
            else:
                files.settle()
                return _in_all(
                    outcome, restarts, [*files.unread, *files.kept], vanished
                )
    finally:
        files.keep_furthest()


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


def _in_all(
    outcome: Outcome, restarts: int, kept: Sequence[Path], vanished: Sequence[str]
) -> Outcome:
    """Return the outcome of a whole run, given that of its last incarnation."""
    balance = outcome.completeness
    if balance is not None:
        every = tuple(dict.fromkeys((*balance.vanished, *vanished)))
        balance = msgspec.structs.replace(balance, vanished=every)
    return msgspec.structs.replace(
        outcome,
        restarts=restarts,
        completeness=balance,
        kept=tuple(map(str, kept)),
    )
