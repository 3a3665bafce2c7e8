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

from neurosnap.errors import NothingBegunError, PartDiedError, SwarmError
from neurosnap.fabric.events import wait_at_most
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.runtime.launch import new_swarm_id
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.world_process import WayIn
from neurosnap.runtime.restart_files import RestartFiles
from neurosnap.runtime.restart_policy import Restarts, Supervision
from neurosnap.runtime.run import Outcome, run
from neurosnap.sources.open_live import is_live

_LONGEST = 30.0  # seconds


class Restart(msgspec.Struct, frozen=True):
    """One time that a run went on."""

    why: str
    """Who died, and how."""
    tick: int
    """The last whole tick, which it went on from."""
    lost: int
    """Ticks that had been whole and are not in what it goes on from."""
    outside: bool = False
    """What they observed came from outside, so that they cannot be done again."""
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
) -> Outcome:
    """Run a swarm of processes to its end, whoever dies on the way.

    Args:
        options: What to run.
        log: Where to record. However the call ends, `log` is what got furthest, and
            beside it is only what was damaged; see
            `neurosnap.runtime.restart_files`.
        stop: Ends the run in order.
        supervision: How often it goes on.
        on_progress: Told the tick as it grows.
        on_restart: Told of every restart.
        past: Where to go on from, for a run that is resumed.
        network: As in `run`.
        swarm: As in `run`; each time the run goes on, it does so as the next
            incarnation of this id.
        elsewhere: As in `run`; who starts these parts does so in every incarnation.
        way_in: As in `run`.

    Raises:
        InvalidValueError: Something of an earlier run is beside `log`.
        OSError: A file of the run cannot be moved or deleted.
        PartDiedError: A part died more often than allowed. What was recorded by then
            is readable.
        NeurosnapError: As from `run`.
    """
    lives = RestartFiles(log)
    lives.check_free()
    swarm = swarm or new_swarm_id()
    allowed = Restarts(supervision)
    restarts, delay, reached = 0, supervision.backoff, 0
    vanished: list[str] = []
    cannot_repeat = way_in is None and is_live(options.source)
    redone = asyncio.Event()  # this life got further than what it goes on from

    def follow(tick: int) -> None:
        nonlocal reached
        reached = max(reached, tick)
        if tick > (0 if past is None else past.tick):
            redone.set()
        on_progress(tick)

    try:
        while True:
            told = stop.is_set()  # before this life began
            try:
                async with _late(stop, redone, lives, past) as heeded:
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
                    )
            except NothingBegunError as error:
                if not restarts:
                    raise
                raise SwarmError(str(error)) from error
            except SwarmError as error:
                # Told to end while a part died, it ends as the next life does: the
                # recording of this one may lack what the others said last.
                if told or not _mends(supervision, error):
                    raise
                if not allowed.allow():
                    raise
                found = await asyncio.to_thread(lives.furthest, options)
                kept = len(lives.kept)
                if reached > (0 if past is None else past.tick) and not lives.recorded:
                    vanished.append(str(log))
                # Not on a thread, which would go on beside `keep_furthest` once this
                # is cancelled.
                gained, past = lives.go_on(found, past)
                delay = supervision.backoff if gained else min(2 * delay, _LONGEST)
                restarts += 1
                tick = 0 if past is None else past.tick
                on_restart(
                    Restart(
                        why=str(error),
                        tick=tick,
                        lost=max(0, reached - tick),
                        outside=cannot_repeat,
                        kept=tuple(map(str, lives.kept[kept:])),
                    )
                )
                reached = tick
                redone.clear()
                await wait_at_most(stop, delay)
            else:
                lives.settle()
                return _in_all(
                    outcome, restarts, [*lives.unread, *lives.kept], vanished
                )
    finally:
        lives.keep_furthest()


@asynccontextmanager
async def _late(
    stop: asyncio.Event,
    redone: asyncio.Event,
    lives: RestartFiles,
    past: ResumePoint | None,
) -> AsyncIterator[asyncio.Event]:
    """Yield an event that follows `stop` once a tick that was cut off is done again.

    The life that died may have recorded what was observed at the tick after its last
    whole one. A life that ended before that tick would leave less than there was.
    """
    heeded = asyncio.Event()
    tick = 1 if past is None else past.tick + 1

    async def follow() -> None:
        await stop.wait()
        if not redone.is_set() and await asyncio.to_thread(lives.have_left, tick):
            await redone.wait()
        heeded.set()

    following = asyncio.create_task(follow(), name="endure/stop")
    try:
        yield heeded
    finally:
        following.cancel()


def _in_all(
    outcome: Outcome, restarts: int, kept: Sequence[Path], vanished: Sequence[str]
) -> Outcome:
    """Return what became of a run, by what became of its last life."""
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


def _mends(supervision: Supervision, error: SwarmError) -> bool:
    """Tell whether a run that failed so is to go on."""
    if supervision.restart == "on-failure":
        return isinstance(error, PartDiedError)
    return supervision.restart == "always"
