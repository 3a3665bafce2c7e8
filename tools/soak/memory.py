"""Checks that the memory of a run's processes does not grow.

It is looked at once in a while, and a line is laid through what each process has from a
tenth of the run on, when all is loaded that ever is.
"""

import asyncio
from contextlib import suppress

import msgspec
import numpy as np
import psutil

from tests.support.swarm_processes import parts_of

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


class Gauge:
    """Looks at the memory of this process and of its children.

    Args:
        pause: Seconds between two looks.
    """

    def __init__(self, pause: float) -> None:
        self._pause = pause
        self.tick = 0
        self._moving = asyncio.Event()
        self.samples: list[tuple[int, dict[str, int]]] = []

    def follow(self, tick: int) -> None:
        """Follow the ticks of the run; look at once when all parts are there."""
        self.tick = tick
        if tick and not self._moving.is_set():
            self._moving.set()
            self.samples.append((tick, resident(psutil.Process())))

    async def watch(self, seconds: float) -> None:
        """Look again and again, until so long after the first tick."""
        await self._moving.wait()
        with suppress(TimeoutError):
            async with asyncio.timeout(None if np.isinf(seconds) else seconds):
                while True:
                    await asyncio.sleep(self._pause)
                    self.samples.append((self.tick, resident(psutil.Process())))

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


def resident(launcher: psutil.Process) -> dict[str, int]:
    """Return the bytes in memory of a launcher and its parts, by kind of process."""
    found = {"launcher": launcher.memory_info().rss}
    for who, process in parts_of(launcher):
        kind = who.partition("/")[0]
        with suppress(psutil.NoSuchProcess):
            found[kind] = found.get(kind, 0) + process.memory_info().rss
    return found
