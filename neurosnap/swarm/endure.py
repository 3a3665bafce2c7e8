"""A run that goes on when a part of it dies.

The parts of a swarm share one state: what the snapshot holds, what the cells are wired
to, where the world is. So they are supervised *one for all*: when one dies, all are
ended, and a new swarm goes on from the last whole tick of the recording. What that tick
came to is derived again from a key-frame, bit for bit; the world, being a function of
its seed and the actions, is brought to where it was; the wave that was hit is started
again. The new recording begins as a copy of the old one up to that tick, so it holds
every observation, state and decision once; of several files only the last is copied.
"""

import asyncio
from collections.abc import Callable
from pathlib import Path

import msgspec

from neurosnap.errors import (
    InvalidValueError,
    NothingBegunError,
    PartDiedError,
    RecordingError,
    SwarmError,
)
from neurosnap.fabric.waiting import wait_at_most
from neurosnap.record.past import Past
from neurosnap.record.reader import Recording
from neurosnap.record.resume import look_back, whole_ticks
from neurosnap.record.whole import part_path, part_paths
from neurosnap.swarm.launch import new_swarm_id
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
    swarm: str = "",
    elsewhere: frozenset[str] = frozenset(),
) -> Outcome:
    """Run a swarm of processes to its end, whoever dies on the way.

    Args:
        options: What to run.
        log: Where to record. A run that has to go on keeps what it goes on from beside
            it, ``<log>.broken``. However the call ends, `log` is what got furthest and
            nothing is beside it.
        stop: Ends the run in order.
        supervision: How often it goes on.
        on_progress: Told the tick as it grows.
        on_restart: Told of every restart.
        past: Where to go on from, for a run that is resumed.
        network: As in `run`.
        swarm: As in `run`; each time the run goes on, it does so as the next
            incarnation of this id.
        elsewhere: As in `run`; who starts these parts does so in every incarnation.

    Raises:
        InvalidValueError: Something of an earlier run is beside `log`.
        PartDiedError: A part died more often than allowed. What was recorded by then
            is readable.
        NeurosnapError: As from `run`.
    """
    broken = log.with_name(f"{log.name}.broken")
    if broken.exists():  # its launcher was killed, and it may be all there is
        rule = "must be taken away first: a run left it that was cut short"
        raise InvalidValueError("log", rule, str(broken))
    swarm = swarm or new_swarm_id()
    restarts, delay, reached = 0, supervision.backoff, 0

    def follow(tick: int) -> None:
        nonlocal reached
        reached = max(reached, tick)
        on_progress(tick)

    try:
        while True:
            try:
                outcome = await run(
                    options,
                    log,
                    stop,
                    follow,
                    past,
                    network,
                    swarm=swarm,
                    incarnation=restarts,
                    elsewhere=elsewhere,
                )
            except NothingBegunError as error:
                if not restarts:
                    raise
                raise SwarmError(str(error)) from error
            except SwarmError as error:
                given_up = restarts >= supervision.max_restarts
                if given_up or stop.is_set() or not _mends(supervision, error):
                    raise
                found = await asyncio.to_thread(_whole_part, log, past, options)
                gained, past = make_room(log, broken, found, past)
                delay = supervision.backoff if gained else min(2 * delay, _LONGEST)
                restarts += 1
                tick = 0 if past is None else past.tick
                on_restart(Restart(str(error), tick, max(0, reached - tick)))
                reached = tick
                await wait_at_most(stop, delay)
            else:
                broken.unlink(missing_ok=True)  # the new recording holds all of it
                return msgspec.structs.replace(outcome, restarts=restarts)
    finally:
        keep_furthest(log, broken)


def _mends(supervision: Supervision, error: SwarmError) -> bool:
    """Tell whether a run that failed so is to go on."""
    if supervision.restart == "on-failure":
        return isinstance(error, PartDiedError)
    return supervision.restart == "always"


def _whole_part(log: Path, before: Past | None, options: RunOptions) -> Past | None:
    """Return where a recorded run can go on; None: it has no whole tick.

    That is before its last tick: with that done again, too, it ends as it should.

    Raises:
        RecordingError: It has several files and cannot go on all the same; there is
            nothing else to go on from, and too much in them to be thrown away.
    """
    try:
        return look_back(log, options.ticks - 1)[1]
    except RecordingError:
        if before is None and len(part_paths(log)) > 1:
            raise
        return None


def make_room(
    log: Path, broken: Path, found: Past | None, before: Past | None
) -> tuple[bool, Past | None]:
    """Return whether a run got further than it had, and where it goes on.

    What it goes on from is out of the way of the new recording then.
    """
    if found is None or (before is not None and found.tick <= before.tick):
        _remove(log, 0 if before is None else before.part)
        return False, before
    Path(found.log).replace(broken)
    _remove(log, found.part)
    return True, msgspec.structs.replace(found, log=str(broken))


def _remove(log: Path, first: int) -> None:
    """Delete the files of a recording from number `first` on."""
    for number, path in part_paths(log).items():
        if number >= first:
            path.unlink(missing_ok=True)


def keep_furthest(log: Path, broken: Path) -> None:
    """Let `log` be the one of two recordings that has more whole ticks, the only one.

    Of a run in several files, `broken` is one of them, and goes back to its place.
    Blocks for as long as it takes to derive the last ticks of both again. Where there
    is no `broken`, nothing is done.
    """
    if not broken.exists():
        return
    after, before = whole_ticks(log), whole_ticks(broken)
    if after and after >= before:
        broken.unlink()
        return
    number = _number(broken)
    _remove(log, number)
    broken.replace(part_path(log, number))


def _number(log: Path) -> int:
    """Return which of the files of its run one is; 0 where it does not say."""
    try:
        return Recording.open(log).part or 0
    except RecordingError:
        return 0
