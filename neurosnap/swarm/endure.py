"""A run that goes on when a part of it dies.

The parts of a swarm share one state: what the snapshot holds, what the cells are wired
to, where the world is. So they are supervised *one for all*: when one dies, all are
ended, and a new swarm goes on from the last whole tick of the recording. What that tick
came to is derived again, bit for bit; the world, being a function of its seed and the
actions, is brought to where it was; the wave that was hit is started again. The new
recording begins as a copy of the old one up to that tick, so it holds every
observation, state and decision once.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path

import msgspec

from neurosnap.errors import PartDiedError, RecordingError
from neurosnap.record.past import Past
from neurosnap.record.resume import look_back
from neurosnap.swarm.network import PRIVATE, Network
from neurosnap.swarm.options import RunOptions
from neurosnap.swarm.run import Outcome, run
from neurosnap.swarm.supervision import Supervision

_LONGEST = 30.0  # seconds


class Restart(msgspec.Struct, frozen=True):
    """One time that a run went on."""

    why: str
    """Who died, and how."""
    tick: int
    """The last whole tick, which it went on from."""
    lost: int
    """Ticks that had been whole and were not on disk yet: they were done again."""


async def run_on(
    options: RunOptions,
    log: Path,
    stop: asyncio.Event,
    supervision: Supervision,
    *,
    on_progress: Callable[[int], None] = lambda _: None,
    on_restart: Callable[[Restart], None] = lambda _: None,
    past: Past | None = None,
    network: Network = PRIVATE,
) -> Outcome:
    """Run a swarm of processes to its end, whoever dies on the way.

    Args:
        options: What to run.
        log: Where to record. A run that has to go on keeps what it goes on from beside
            it, ``<log>.broken``, until it has ended.
        stop: Ends the run in order.
        supervision: How often it goes on.
        on_progress: Told the tick as it grows.
        on_restart: Told of every restart.
        past: Where to go on from, for a run that is resumed.
        network: As in `run`.

    Raises:
        PartDiedError: A part died more often than allowed. What was recorded by then
            is readable.
        NeurosnapError: As from `run`.
    """
    broken = log.with_name(f"{log.name}.broken")
    restarts, delay, reached = 0, supervision.backoff, 0

    def follow(tick: int) -> None:
        nonlocal reached
        reached = max(reached, tick)
        on_progress(tick)

    while True:
        try:
            outcome = await run(options, log, stop, follow, past, network)
        except PartDiedError as error:
            given_up = restarts >= supervision.max_restarts
            if supervision.restart == "never" or given_up or stop.is_set():
                raise
            gained, past = await asyncio.to_thread(_last_past, log, broken, past)
            restarts += 1
            delay = supervision.backoff if gained else min(2 * delay, _LONGEST)
            tick = 0 if past is None else past.tick
            on_restart(Restart(str(error), tick, max(0, reached - tick)))
            reached = tick
            await _pause(stop, delay)
        else:
            broken.unlink(missing_ok=True)
            return msgspec.structs.replace(outcome, restarts=restarts)


def _last_past(
    log: Path, broken: Path, before: Past | None
) -> tuple[bool, Past | None]:
    """Return whether a run got further than it had, and where it can go on.

    What it goes on from is out of the way of the new recording then.
    """
    try:
        _, found = look_back(log)
    except RecordingError:  # it did not live to see a whole tick of its own
        log.unlink(missing_ok=True)
        return False, before
    if before is not None and found.tick <= before.tick:
        log.unlink()
        return False, before
    log.replace(broken)
    return True, msgspec.structs.replace(found, log=str(broken))


async def _pause(stop: asyncio.Event, seconds: float) -> None:
    """Wait, unless the run is to end meanwhile."""
    try:
        async with asyncio.timeout(seconds):
            await stop.wait()
    except TimeoutError:
        pass
