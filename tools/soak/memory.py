"""Long runs of which nothing is killed: does their memory grow?

The readings are drawn: some sensors at random, the others made of them, so that there
is something to learn. The memory of every process is looked at once in a while, and a
line is laid through what it has from a tenth of the run on, when all is loaded that
ever is.
"""

import asyncio
import random
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np
import psutil

from neurosnap.protocol.run_options import RunOptions
from neurosnap.recording.read.recording import part_paths
from neurosnap.recording.replay.verify import verify
from neurosnap.runtime.registry import parts_of
from neurosnap.runtime.request import RunRequest, Watcher
from neurosnap.runtime.run import run

_WARM = 0.1  # share of the run whose memory does not count


class Memory(msgspec.Struct, kw_only=True):
    """What one process, or all cells together, had in memory."""

    begin: int
    """Bytes after a tenth of the run."""
    end: int
    """Bytes at the end."""
    most: int
    """The most bytes at any time."""
    slope: float
    """Bytes a tick from a tenth of the run on, by least squares."""


class LongRun(msgspec.Struct, kw_only=True):
    """How a long run went."""

    ticks: int
    seconds: float
    samples: int
    files: int
    """Files of the recording."""
    recorded: int
    """Their bytes."""
    lost: int
    """Messages missing from it."""
    verified: bool
    """A replay derives all of it again."""
    memory: dict[str, Memory]
    """By process; that of this one under ``launcher``."""

    @property
    def fine(self) -> bool:
        """Nothing is lost, and all of it is derived again."""
        return self.verified and not self.lost

    def lines(self) -> Iterator[str]:
        """Yield a line about the memory of each process."""
        for name, memory in self.memory.items():
            yield (
                f"{name:12} {memory.begin / 2**20:8.1f} MiB {memory.end / 2**20:8.1f}"
                f" MiB {memory.slope:+9.2f} bytes a tick"
            )


def write_readings(path: Path, rows: int, sensors: int, seed: int) -> None:
    """Write a file of readings in which a third of the sensors determine the rest."""
    chance = random.Random(seed)
    free = max(1, sensors // 3)
    with path.open("w", encoding="utf-8") as file:
        file.write(",".join(f"s{number}" for number in range(sensors)) + "\n")
        for _ in range(rows):
            base = [chance.random() < 0.3 for _ in range(free)]
            made = (
                base[k % free] or base[(k + 1) % free] for k in range(sensors - free)
            )
            file.write(",".join(str(int(bit)) for bit in (*base, *made)) + "\n")


class Gauge:
    """Looks at the memory of this process and of its children.

    Args:
        pause: Seconds between two looks.
    """

    def __init__(self, pause: float) -> None:
        self._pause = pause
        self.tick = 0
        self.moving = asyncio.Event()
        """Set once there is a first tick."""
        self.samples: list[tuple[int, dict[str, int]]] = []

    def follow(self, tick: int) -> None:
        """Follow the ticks of the run; look at once when all parts are there."""
        self.tick = tick
        if tick and not self.moving.is_set():
            self.moving.set()
            self.samples.append((tick, _resident()))

    async def watch(self) -> None:
        """Look again and again, until cancelled."""
        while True:
            await self.moving.wait()
            await asyncio.sleep(self._pause)
            self.samples.append((self.tick, _resident()))

    def memory(self) -> dict[str, Memory]:
        """Return what each process had, from a tenth of the run on."""
        warm = _WARM * self.tick
        kept = [sample for sample in self.samples if sample[0] >= warm]
        kept = kept or self.samples[:1]  # it was over before there was another
        measured = {}
        for name in sorted({name for _, found in kept for name in found}):
            # At the end some have gone already.
            there = [(tick, found[name]) for tick, found in kept if name in found]
            ticks, held = np.array(there, np.float64).T
            slope = np.polyfit(ticks, held, 1)[0] if np.ptp(ticks) > 0 else 0.0
            measured[name] = Memory(
                begin=int(held[0]),
                end=int(held[-1]),
                most=int(held.max()),
                slope=float(slope),
            )
        return measured


def _resident() -> dict[str, int]:
    """Return the bytes in memory by kind of process."""
    me = psutil.Process()
    found = {"launcher": me.memory_info().rss}
    for who, process in parts_of(me):
        kind = who.partition("/")[0]
        with suppress(psutil.NoSuchProcess):
            found[kind] = found.get(kind, 0) + process.memory_info().rss
    return found


async def long_run(
    options: RunOptions,
    folder: Path,
    *,
    pause: float = 1.0,
    seconds: float = float("inf"),
) -> LongRun:
    """Make a run and measure.

    Args:
        options: What to run.
        folder: Where it is recorded.
        pause: Seconds between two looks at the memory.
        seconds: So long after its first tick the run is ended in order.
    """
    gauge, log, stop = Gauge(pause), folder / "run.mcap", asyncio.Event()
    watching = asyncio.create_task(gauge.watch(), name="soak/gauge")
    ending = asyncio.create_task(
        _end_after(seconds, gauge.moving, stop), name="soak/end"
    )
    began = time.perf_counter()
    try:
        outcome = await run(RunRequest(options, log), stop, Watcher(gauge.follow))
    finally:
        watching.cancel()
        ending.cancel()
    paths = list(part_paths(log).values())
    balance = outcome.completeness
    return LongRun(
        ticks=outcome.totals.ticks,
        seconds=time.perf_counter() - began,
        samples=len(gauge.samples),
        files=len(paths),
        recorded=sum(path.stat().st_size for path in paths),
        lost=0 if balance is None else sum(balance.missing.values()),
        verified=verify(log).same,
        memory=gauge.memory(),
    )


async def _end_after(
    seconds: float, moving: asyncio.Event, stop: asyncio.Event
) -> None:
    await moving.wait()
    try:
        async with asyncio.timeout(None if np.isinf(seconds) else seconds):
            await stop.wait()
    except TimeoutError:
        stop.set()
