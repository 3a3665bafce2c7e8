#!/usr/bin/env python3
"""Disturbs swarms or runs them for long, and checks their results.

With --fault kill, parts of a running swarm are killed. Every role and every pair of
roles is killed with SIGKILL as often as any other, in a random order and at random
moments, until enough are killed. The run is made again undisturbed, in one process, for
as many ticks as the first came to. Both must come to the same states and decisions, and
the recording must hold each once. With --fault none a run is left alone, and what
memory it takes is printed.

Both are runs of a walk on a path, or of an agent that explores a frozen lake and grows
sensors, so that some are killed while a sensor is born.

With --run lines there is a run of its own process for each source (--by) and each rate,
which is fed numbered readings. A table says how many it lost, or received twice, by its
own count: what a killed intake had read and not written down is lost. It must end with
exit code 0, and its recording must hold each line once and in order; or all is wrong.

With --fault signal, runs get a signal to end, and must end in order.

Exit code: 0 if all is so, 1 if not; then what was recorded is kept.
"""

import argparse
import asyncio
import json
import shutil
import sys
import tempfile
import time
from contextlib import closing
from itertools import product
from math import inf
from pathlib import Path
from typing import Any

# Run as a folder, that is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import msgspec
import psutil
from rich.console import Console

from neurosnap import wire
from neurosnap.errors import NeurosnapError
from neurosnap.protocol.run_options import HostKind, RunOptions
from neurosnap.recording.read.recording import Recording, part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.request import Restart, RunRequest, Supervision, Watcher
from neurosnap.runtime.run_with_intake import INTAKE
from neurosnap.runtime.run_with_restarts import run
from neurosnap.sources.open import open_source
from tests.support.course import course
from tools.soak.killer import Killer
from tools.soak.memory import Gauge, Memory
from tools.soak.outside import ROS2, SINGLY, feed, lines_in
from tools.soak.signals import strike_runs

SERVICES = ("hub", "recorder", "coordinator", "world")
HOSTS: dict[HostKind, str] = {"process": "cell", "worker": "worker"}
"""Who has the cells, by their kind."""

_ENDLESS = 10**9  # ticks; the kills end the run
_EIGHT_HOURS = 288_000  # ticks, ten a second
_ROOM = 12  # sensors that may grow on the lake


class Soaked(msgspec.Struct, kw_only=True):
    """How a run went."""

    ticks: int
    killed: dict[str, int]
    """How often each role, and each pair, was."""
    restarts: int
    redone: int
    """Ticks that were whole but not on disk when a part died; they were done again."""
    repeated: int
    """Waves sent again inside one life of the swarm."""
    lost: int
    """Messages missing from the recording, by the senders' running numbers; or lines
    that are."""
    doubled: int
    """Observations, states or decisions that it holds twice; or lines."""
    equal: bool = True
    """States and decisions are those of the undisturbed run; or each line is there once
    and they are in order."""
    verified: bool
    """A replay derives the recording again."""
    born: int
    """Sensors that were grown."""
    files: int
    """Files of the recording."""
    recorded: int
    """Their bytes."""
    left: list[str]
    """Files and folders beside them."""
    seconds: float
    lines: int = 0
    """What it was fed, if it was a run of lines."""
    received: dict[str, int] = msgspec.field(default_factory=dict)
    """What became of that, as the run counted it."""
    unsaid: int = 0
    """How much that does not add up to it."""
    code: int = 0
    """The exit code of such a run."""
    memory: dict[str, Memory] = msgspec.field(default_factory=dict)
    """Of a run that was left alone; by process, that of this one under ``launcher``."""

    @property
    def fine(self) -> bool:
        """All is as it should be."""
        whole = self.equal and self.verified and not (self.lost or self.doubled)
        return whole and not (self.left or self.code or self.unsaid)


async def soak(
    options: RunOptions,
    kills: int,
    seed: int,
    folder: Path,
    pause: float = 0.4,
    seconds: float = inf,
) -> Soaked:
    """Make a run, and if parts of it are killed make it again without; compare.

    Args:
        options: What to run. With kills its cells are processes or have workers, and it
            is the kills that end it, however many ticks that takes.
        kills: How often parts are killed; 0: it is left alone.
        seed: Draws whom to kill, and when.
        folder: Where the recordings go.
        pause: Seconds a life of the swarm may last at most before a part is killed, or
            between two looks at the memory.
        seconds: So long after its first tick a run left alone is ended in order.
    """
    began = time.perf_counter()
    calm, log = folder / "calm.mcap", folder / "soaked.mcap"
    host = "worker" if options.cells == "worker" else "cell"
    killer, gauge = Killer((*SERVICES, host), kills, seed, pause), Gauge(pause)
    stop = asyncio.Event()

    async def disturb() -> None:
        if kills:
            await killer.hunt(psutil.Process())
        else:
            await gauge.watch(seconds)
        stop.set()

    def on_restart(restart: Restart) -> None:
        killer.restarted(restart.tick, restart.lost)

    follow = killer.follow if kills else gauge.follow
    disturbing = asyncio.create_task(disturb(), name="soak/disturb")
    try:
        request = RunRequest(
            msgspec.structs.replace(options, ticks=_ENDLESS) if kills else options,
            log,
            supervision=Supervision(max_restarts=_restarts(kills), backoff=0.0),
        )
        outcome = await run(request, stop, Watcher(follow, on_restart=on_restart))
    finally:
        disturbing.cancel()
    if not kills:
        found = _look(log, killer, time.perf_counter() - began)
        found.memory = gauge.memory()
        return found
    ticks = outcome.totals.ticks
    alone = {"cells": "inline", "split": 0}
    inline = msgspec.structs.replace(options, ticks=ticks, **alone)
    await run(RunRequest(inline, calm), asyncio.Event())
    found = _look(log, killer, time.perf_counter() - began)
    found.equal = course(log, ticks) == course(calm)
    found.left.remove(calm.name)
    return found


async def soak_outside(
    cells: HostKind,
    kills: int,
    seed: int,
    folder: Path,
    pause: float = 0.4,
    *,
    rate: float = 200.0,
    split: int = 0,
    by: str = "-",
    seconds: float = 0.0,
) -> Soaked:
    """Make a run that is fed numbered lines, and look for each of them.

    Args:
        cells: Where its cells are.
        kills: How often parts are killed.
        seed: Draws whom to kill, and when.
        folder: Where its recording goes.
        pause: As in `soak`.
        rate: Lines a second.
        split: Bytes of a file of its recording, at most.
        by: How the lines get there, as in `feed`.
        seconds: How long it is fed after the last kill.
    """
    began, log = time.perf_counter(), folder / "soaked.mcap"
    roles = [*SERVICES, HOSTS[cells], INTAKE]
    if by.startswith("zenoh:"):
        roles.remove("hub")  # it is the intake
    killer = Killer(roles, kills, seed, pause)
    killer.rest = seconds
    settings = {
        "recording.split": split,
        "supervision.backoff": 0,
        "supervision.max_restarts": _restarts(kills),
    }
    given = ["--ticks", str(_ENDLESS), "--cells", cells]
    for key, value in settings.items():
        given += ["--set", f"{key}={value}"]
    fed, code, found_in = await feed(killer, log, rate, given, by)
    found = _look(log, killer, time.perf_counter() - began)
    found.received, found.lines, found.code = found_in, fed, code
    found.unsaid = fed - sum(found_in.values())
    ours = ("soak.toml", "mosquitto.conf", f"{log.name}.journal")
    found.left = [name for name in found.left if by == "-" or name not in ours]
    if by == ROS2 and code in (0, 3):
        seen = Recording.open(log).all("observation", wire.Observation)
        deaf = sum(each.until - each.since for one in seen for each in one.outages)
        if 0 <= found.unsaid <= rate * deaf:  # nothing keeps it, and it is recorded
            found.unsaid = found.code = 0
    if by in ("mqtt:", SINGLY, ROS2):
        return found
    waiting = sum(found_in.get(fate, 0) for fate in ("kept", "after"))
    lines = lines_in(log, fed - waiting)
    found.lost += lines.lost
    found.doubled += lines.doubled
    found.equal = lines.exact
    return found


def _restarts(kills: int) -> int:
    return 10 * kills + 10


def _look(log: Path, killer: Killer, seconds: float) -> Soaked:
    """Return what a recording says of itself; nothing is compared with it yet."""
    recording = Recording.open(log)
    told = recording.messages(("observation", "state", "decision", "wavestart"))
    heard = [each.message for each in told]
    kinds = (wire.Observation, wire.State, wire.Decision)
    keys = [(type(m), m.tick) for m in heard if isinstance(m, kinds)]
    verdict = verify(log)
    files = {*part_paths(log).values()}
    return Soaked(
        ticks=max((m.tick for m in heard if isinstance(m, wire.State)), default=0),
        killed=dict(killer.killed),
        restarts=killer.restarts,
        redone=killer.redone,
        repeated=sum(isinstance(m, wire.WaveStart) and m.repeats > 0 for m in heard),
        lost=sum(recording.balance(recording.sequences()).missing.values()),
        doubled=len(keys) - len(set(keys)),
        verified=verdict.same and verdict.complete,
        born=sum(isinstance(m, wire.Decision) and m.born >= 0 for m in heard),
        files=verdict.files,
        recorded=sum(path.stat().st_size for path in files),
        left=sorted(path.name for path in {*log.parent.iterdir()} - files),
        seconds=seconds,
    )


def main(arguments: list[str] | None = None) -> int:
    """Soak, print how it went, and return the exit code."""
    parser = _parser()
    given = parser.parse_args(arguments)
    if given.fault == "kill" and given.cells == "inline":
        parser.error("--cells: must be process or worker to be killed, got inline")
    if given.fault == "signal":
        return 0 if strike_runs(given.times, given.seed, given.ticks or 200) else 1
    folder = Path(tempfile.mkdtemp(prefix="neurosnap-soak-", dir=given.folder))
    try:
        with Console(stderr=True).status("soaking"):
            if given.run == "lines":
                return _soak_each(given, folder)
            found = asyncio.run(_soaked(given, folder))
    except NeurosnapError as error:
        print(f"error: {error}", file=sys.stderr)
        print(f"kept: {folder}", file=sys.stderr)
        return 1
    for name, value in msgspec.structs.asdict(found).items():
        if name != "memory":
            print(f"{name:10} {value}")
    for name, memory in found.memory.items():
        print(
            f"{name:12} {memory.begin / 2**20:8.1f} MiB {memory.end / 2**20:8.1f} MiB"
            f" {memory.slope:+9.2f} bytes a tick"
        )
    if given.json:
        print(json.dumps(msgspec.to_builtins(found)))
    if found.fine:
        shutil.rmtree(folder)
        return 0
    print(f"kept: {folder}", file=sys.stderr)
    return 1


def _soak_each(given: argparse.Namespace, folder: Path) -> int:
    """Soak with each source at each rate, print a table, and return the exit code."""
    row = "{:13}{:>9}{:>7}{:>9}{:>10}{:>7}{:>7}{:>6}  {}"
    heads = ("source", "a second", "kills", "fed", "received", "lost", "twice", "exit")
    print(row.format(*heads, "sum"), flush=True)
    fine, kills = True, given.kills if given.fault == "kill" else 0
    for by, rate in product(given.by, given.rate):
        place = folder / f"{by.rstrip(':')}{rate:g}"
        place.mkdir()
        chosen = (given.cells, kills, given.seed, place, given.pause)
        seconds = 0.0 if given.seconds == inf else given.seconds
        more = {"rate": rate, "split": given.split, "by": by, "seconds": seconds}
        found = asyncio.run(soak_outside(*chosen, **more))
        fine &= found.fine
        fed, received, killed = found.lines, sum(found.received.values()), found.killed
        lost, twice = max(fed - received, 0), max(received - fed, 0)
        told = (sum(killed.values()), fed, received, lost, twice, found.code)
        exact = "exact" if fed == received else "not exact"
        print(row.format(by, f"{rate:g}", *told, exact), flush=True)
        if given.json:
            print(json.dumps(msgspec.to_builtins(found)))
    return 0 if fine else 1


async def _soaked(given: argparse.Namespace, folder: Path) -> Soaked:
    kills = given.kills if given.fault == "kill" else 0
    options = RunOptions(
        **_world(given),
        ticks=given.ticks or _EIGHT_HOURS,
        seed=given.seed,
        cells=given.cells,
        workers=min(2, given.sensors),
        split=given.split,
        keep=given.keep,
        keyframe_every=given.keyframe_every,
    )
    return await soak(options, kills, given.seed, folder, given.pause, given.seconds)


def _world(given: argparse.Namespace) -> dict[str, Any]:
    """Return the options of a walk on a path, or of an agent that explores a lake."""
    lake = given.run == "lake"
    world = "neurosnap/FrozenLake-v0" if lake else "neurosnap/Path-v0"
    arguments = {} if lake else {"places": given.sensors + 1}
    with closing(open_source(world, given.seed, arguments)) as source:
        body = body_of(source, "planner", _ROOM) if lake else body_of(source, "walker")
    made = {"source": world, "arguments": arguments, "body": body}
    grows = {"agent": "planner", "imagine": 200, "explore": 0.1, "threshold": 1 / 8000}
    return made | grows if lake else made


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="soak", description=__doc__.split("\n")[0])
    add = parser.add_argument
    add(
        "--fault",
        choices=("kill", "signal", "none"),
        default="kill",
        help="kill parts, send runs a signal to end, or let one run last",
    )
    add("--run", choices=("path", "lake", "lines"), default="path")
    add("--seed", type=int, default=0, help="draws the faults")
    add("--kills", type=int, default=30, help="kills of parts, or pairs of them")
    add("--times", type=int, default=9, help="signals of each kind to each receiver")
    add("--ticks", type=int, help="ticks of each run (200 with signals, 288000 alone)")
    add("--seconds", type=float, default=inf, help="end a run after these, left alone")
    add("--pause", type=float, default=0.4, help="seconds between kills or looks")
    add("--sensors", type=int, default=8, help="sensors, and so cells, of the swarm")
    add("--cells", choices=("process", "worker", "inline"), default="process")
    add("--split", type=int, default=0, help="bytes of a file, at most; 0: one file")
    add("--keep", type=int, default=0, help="files kept of the recording")
    add("--keyframe-every", type=int, default=1000, help="ticks between key-frames")
    rates = "lines a second, with --run lines"
    add("--rate", type=float, nargs="+", default=[50.0, 500.0, 2000.0], help=rates)
    ways = ["-", "zenoh:", SINGLY, "mqtt:", ROS2]
    add("--by", choices=ways, nargs="+", default=ways, help="who feeds lines")
    add("--folder", type=Path, help="where to record meanwhile")
    add("--json", action="store_true", help="add one object, last")
    return parser


if __name__ == "__main__":
    sys.exit(main())
