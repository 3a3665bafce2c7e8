#!/usr/bin/env python3
"""Kill parts of a running swarm at random, and see whether it minds.

A run is made twice: once as a swarm of processes of which one part after the other is
killed with SIGKILL at a random moment, until enough are killed, and once undisturbed,
in one process, for as many ticks as the first came to. Both must come to the same
states and decisions, and the recording must hold each once.

Exit code: 0 if they do, 1 if not.
"""

import argparse
import asyncio
import json
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

# Run as a file, the folder of this file is on the path and the project's is not.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import msgspec
import psutil
from rich.console import Console

from neurosnap import wire
from neurosnap.errors import NeurosnapError
from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.split_files import open_whole
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.fit_agent import body_of
from neurosnap.runtime.registry import parts_of
from neurosnap.runtime.restart import Restart, run_with_restarts
from neurosnap.runtime.restart_policy import Supervision
from neurosnap.runtime.run import Outcome, run
from neurosnap.sources.open import open_source
from tools.arguments import in_bytes

SERVICES = ("hub", "recorder", "coordinator", "world")
VICTIMS = (*SERVICES, "recorder+coordinator")
"""Beside these, a cell, or a worker where they have the cells."""

_ENDLESS = 10**9  # ticks; the kills end the run


class Soaked(msgspec.Struct, kw_only=True):
    """What came of it."""

    ticks: int
    kills: int
    """Parts killed, a pair counted as one."""
    killed: dict[str, int]
    restarts: int
    redone: int
    """Ticks that were whole but not on disk when a part died; they were done again."""
    repeated: int
    """Waves sent again inside one life of the swarm."""
    lost: int
    """Messages missing from the recording, by the senders' running numbers."""
    doubled: int
    """Observations, states or decisions that it holds twice."""
    equal: bool
    """States and decisions are those of the undisturbed run."""
    verified: bool
    """A replay derives the recording again."""
    files: int
    """Files of the recording."""
    seconds: float


async def soak(
    options: RunOptions, kills: int, seed: int, folder: Path, pause: float = 0.4
) -> Soaked:
    """Make both runs and compare.

    Args:
        options: What to run; its cells are processes, or have workers. It is the kills
            that end it, however many ticks that takes.
        kills: How many parts are killed.
        seed: Draws whom to kill, and when.
        folder: Where both recordings go.
        pause: Seconds a life of the swarm may last at most before somebody is killed.
    """
    began = time.perf_counter()
    calm, log = folder / "calm.mcap", folder / "soaked.mcap"
    restarts: list[Restart] = []
    host = "worker" if options.cells == "worker" else "cell"
    killer, stop = _Killer(kills, seed, host, pause), asyncio.Event()

    def on_restart(restart: Restart) -> None:
        restarts.append(restart)
        killer.rest()

    hunting = asyncio.create_task(killer.hunt(stop), name="soak/killer")
    try:
        outcome = await run_with_restarts(
            msgspec.structs.replace(options, ticks=_ENDLESS),
            log,
            stop,
            Supervision(max_restarts=10 * kills + 10, backoff=0.0),
            on_progress=killer.follow,
            on_restart=on_restart,
        )
    finally:
        hunting.cancel()
    ticks = outcome.totals.ticks
    inline = msgspec.structs.replace(options, ticks=ticks, cells="inline", split=0)
    await run(inline, calm, asyncio.Event())
    return _compare(calm, log, outcome, restarts, killer, time.perf_counter() - began)


class _Killer:
    """Kills a part, waits until the swarm is under way again, kills the next."""

    def __init__(self, kills: int, seed: int, host: str, pause: float) -> None:
        self._pause = pause
        self._host = host
        self.killed: Counter[str] = Counter()
        self._left = kills
        self._random = random.Random(seed)
        self._awake = asyncio.Event()
        self._tick = -1

    def follow(self, tick: int) -> None:
        """Take in how far the run is: it is under way once it moves."""
        if tick > 0 and tick != self._tick:
            self._awake.set()
        self._tick = tick

    def rest(self) -> None:
        """Wait for the next life of the swarm."""
        self._awake.clear()

    async def hunt(self, stop: asyncio.Event) -> None:
        """Kill until enough are killed, and set `stop` once the run has gone on."""
        while self._left:
            await self._awake.wait()
            await asyncio.sleep(self._random.uniform(0.0, self._pause))
            if not self._awake.is_set():
                continue
            victim = self._random.choice((self._host, *VICTIMS))
            if self._kill(victim):
                self.killed[victim] += 1
                self._left -= 1
                self._awake.clear()
        await self._awake.wait()
        stop.set()

    def _kill(self, victim: str) -> bool:
        parts: dict[str, list[psutil.Process]] = {}
        for who, process in parts_of(psutil.Process()):
            parts.setdefault(who.partition("/")[0], []).append(process)
        if not {*SERVICES, self._host} <= parts.keys():
            return False  # it is coming up, or going down
        for kind in victim.split("+"):
            self._random.choice(parts[kind]).send_signal(signal.SIGKILL)
        return True


def _compare(
    calm: Path,
    log: Path,
    outcome: Outcome,
    restarts: list[Restart],
    killer: _Killer,
    seconds: float,
) -> Soaked:
    recording = open_whole(log)
    told = list(recording.messages(("observe", "state", "decide", "wave")))
    heard = [recorded.message for recorded in told]
    kinds = (wire.Observation, wire.State, wire.Decision)
    keys = [(type(m), m.tick) for m in heard if isinstance(m, kinds)]
    completeness = recording.completeness()
    verdict, ticks = verify(log), outcome.totals.ticks
    return Soaked(
        ticks=ticks,
        kills=killer.killed.total(),
        killed=dict(sorted(killer.killed.items())),
        restarts=len(restarts),
        redone=sum(restart.lost for restart in restarts),
        repeated=sum(isinstance(m, wire.WaveStart) and m.repeats > 0 for m in heard),
        lost=sum(completeness.missing.values()),
        doubled=len(keys) - len(set(keys)),
        equal=_course(calm, ticks) == _course(log, ticks),
        verified=verdict.same and verdict.complete,
        files=verdict.files,
        seconds=seconds,
    )


def _course(log: Path, ticks: int) -> list[tuple[object, ...]]:
    """Return the states and decisions of a recorded run, but for its last decision.

    A run that is asked to stop has decided on its next tick already.
    """
    found: list[tuple[object, ...]] = []
    for recorded in open_whole(log).messages(("state", "decide")):
        match recorded.message:
            case wire.State() as state:
                found.append(("state", state.tick, state.literals, state.incoherent))
            case wire.Decision() as decision if decision.tick < ticks:
                found.append(("decide", decision.tick, decision.action, decision.why))
    return found


def main(arguments: list[str] | None = None) -> int:
    """Soak, print what came of it, and return the exit code."""
    given = _parser().parse_args(arguments)
    source = open_source(given.source, given.seed, {"places": given.sensors + 1})
    source.close()
    options = RunOptions(
        source=given.source,
        arguments={"places": given.sensors + 1},
        body=body_of(source, "walker"),
        seed=given.seed,
        cells=given.cells,
        workers=min(2, given.sensors),
        split=given.split,
        keyframe_every=given.keyframe_every,
    )
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory(prefix="neurosnap-soak-") as folder:
        try:
            with console.status(f"{given.kills} kills"):
                found = asyncio.run(
                    soak(options, given.kills, given.seed, Path(folder), given.pause)
                )
        except NeurosnapError as error:
            print(f"error: {error}", file=sys.stderr)
            return 1
    for name, value in msgspec.structs.asdict(found).items():
        print(f"{name:10} {value}")
    if given.json:
        print(json.dumps(msgspec.to_builtins(found)))
    fine = found.equal and found.verified and not (found.lost or found.doubled)
    return 0 if fine else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="soak", description=__doc__.split("\n")[0])
    parser.add_argument("--kills", type=int, default=20, help="parts to kill")
    parser.add_argument("--seed", type=int, default=0, help="draws whom, and when")
    parser.add_argument(
        "--pause", type=float, default=0.4, help="seconds between kills, at most"
    )
    parser.add_argument("--sensors", type=int, default=8, help="cells of the swarm")
    parser.add_argument(
        "--cells", choices=("process", "worker"), default="process", help="as in run"
    )
    parser.add_argument("--split", type=in_bytes, default=0, help="as in run")
    parser.add_argument(
        "--keyframe-every", type=int, default=1000, help="ticks between key-frames"
    )
    parser.add_argument("--source", default="neurosnap/Path-v0", help="a path world")
    parser.add_argument("--json", action="store_true", help="one object, last")
    return parser


if __name__ == "__main__":
    sys.exit(main())
