"""Runs a source through a swarm, in processes or inline."""

import asyncio
import sys
from collections.abc import Callable
from functools import partial
from importlib import metadata
from pathlib import Path

import msgspec

from neurosnap.agent.growth.changed import Changed
from neurosnap.health.news import Standing
from neurosnap.protocol.resume_point import ResumePoint
from neurosnap.protocol.run_options import RunOptions
from neurosnap.protocol.totals import Totals
from neurosnap.recording.format.completeness import Completeness
from neurosnap.runtime.inline import run_inline
from neurosnap.runtime.launch import Plan, run_processes
from neurosnap.runtime.network import PRIVATE, Network
from neurosnap.runtime.parts.coordinator_process import CoordinatorJob, Result
from neurosnap.runtime.parts.run_description import RunDescription
from neurosnap.runtime.parts.status_publisher import StatusJob, has_status
from neurosnap.runtime.parts.world_process import WayIn, WorldJob
from neurosnap.runtime.placement import HERE, Placement
from neurosnap.system.distribution import version

_PACKAGES = ("eclipse-zenoh", "mcap", "msgspec", "numpy", "numba")


class Outcome(msgspec.Struct, kw_only=True):
    """What became of a run."""

    totals: Totals
    implications: list[tuple[str, str]]
    """The order learned, by name, covering pairs only."""
    completeness: Completeness | None
    """The recording's balance; None where nothing was recorded."""
    seconds: float
    """From the first decision to the last state."""
    startup: float
    """From the call until every part was up."""
    stopped: bool
    """It was asked to stop before it was done."""
    restarts: int = 0
    """How often it went on after a part had died."""
    kept: tuple[str, ...] = ()
    """Files that it could not go on from, beside the recording or of it, which may hold
    ticks that cannot be read."""
    lost: int = 0
    """What came from outside and was no reading, or had no tick and should have."""
    journal: str = ""
    """Where readings are kept that are not in the recording; empty: there are none."""
    waiting: int = 0
    """How many of these had no tick."""
    health: Standing | None = None
    """How the sensors of the home were; None: nobody judged them."""

    @property
    def complete(self) -> bool:
        """Everything that was recorded of it is in the recording."""
        balance = self.completeness
        return balance is not None and balance.whole and not self.kept


async def run(
    options: RunOptions,
    log: Path | None,
    stop: asyncio.Event,
    on_progress: Callable[[int], None] = lambda _: None,
    past: ResumePoint | None = None,
    network: Network = PRIVATE,
    swarm: str = "",
    incarnation: int = 0,
    elsewhere: frozenset[str] = frozenset(),
    patience: float | None = None,
    way_in: WayIn | None = None,
    placement: Placement = HERE,
    on_change: Callable[[Changed], None] = lambda _: None,
    on_health: Callable[[Standing], None] = lambda _: None,
) -> Outcome:
    """Run a swarm to its end, or until `stop` is set.

    Args:
        options: What to run.
        log: Where to record; None: not at all.
        stop: Ends the run in order.
        on_progress: Told the tick as it grows.
        past: Where to go on from, for a run that is resumed.
        network: Where the hub of a swarm of processes listens, and to whom.
        swarm: Its id; empty: a random one.
        incarnation: How often a swarm of this id went before it.
        elsewhere: The parts that somebody else starts, as `serve` does.
        patience: Seconds all parts may take to come up; None: a minute, and more for
            many.
        way_in: How outside readings get to the world, where they are kept; see
            `neurosnap.runtime.journaled_run`.
        placement: What starts the parts, and where.
        on_change: Told of each sensor that is grown or retired, but by the decision of
            the last tick, which nobody follows.
        on_health: Told how the sensors of the home are, when that is new.

    Raises:
        InvalidValueError: There are more sensors than a key-frame can hold.
        NeurosnapError: A part failed; the text names it. Whatever was recorded until
            then is readable, and no process is left.
    """
    options.check_frame()
    metadata = describe(options)
    if options.cells == "inline":
        inline = await run_inline(
            options,
            log,
            metadata,
            past,
            stop,
            on_progress,
            way_in,
            on_change,
            on_health,
        )
        result, completeness = inline.result, inline.completeness
        total, stopped = inline.seconds, inline.stopped
        lost, health = inline.lost, inline.health
    else:
        vacant = tuple(sorted(elsewhere))
        description = RunDescription(options=options, past=past, vacant=vacant)
        plan = Plan(
            cells=len(options.sensors),
            workers=options.sharing,
            learning=options if options.learning_shares else None,
            coordinator=partial(CoordinatorJob, description, patience),
            world=WorldJob(options, past, way_in),
            status=StatusJob(options, past) if has_status(options) else None,
            log=log,
            metadata=metadata,
            past=past,
            patience=options.deadline + 10.0,
            network=network,
            swarm=swarm,
            incarnation=incarnation,
            elsewhere=elsewhere,
            starter=partial(placement.starter, network, again=incarnation > 0),
        )
        ending = await run_processes(plan, stop, on_progress, on_change, on_health)
        result = msgspec.json.decode(ending.result, type=Result)
        completeness = ending.completeness
        total, stopped = ending.seconds, ending.stopped
        lost, health = ending.lost, ending.health
    return Outcome(
        totals=result.totals,
        implications=result.implications,
        completeness=completeness,
        seconds=result.seconds,
        startup=total - result.seconds,
        stopped=stopped,
        lost=lost,
        health=health,
    )


def describe(options: RunOptions) -> dict[str, str]:
    """Return the facts of a run, as text: each option, all of them, the versions."""
    facts = {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in msgspec.structs.asdict(options).items()
    }
    versions = {"neurosnap": version()}
    versions |= {name: metadata.version(name) for name in _PACKAGES}
    versions["python"] = ".".join(map(str, sys.version_info[:3]))
    return {
        **facts,
        "sensors": msgspec.json.encode(options.sensors).decode(),
        "options": msgspec.json.encode(options).decode(),
        "versions": msgspec.json.encode(versions).decode(),
    }
